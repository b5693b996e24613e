//! The part of the suite that holds derivatives to differences: what a fit goes by.

use hysid_plant::{Compiled, Direction, Run, Simulation};

use super::Breach;
use super::motion::{Bench, outputs, rms, with};
use crate::mechanism::{Mechanism, Rewritten, Signals};
use crate::slot::Slot;

/// Share of an amplitude's natural size at which the derivatives are taken.
const SHARE: f64 = 0.15;
/// Difference of a derivative from the differences of the simulation, as a share of its size, that is no breach: a jump of the output moves
/// with a parameter, and a sample may lie on either side of it.
const TOLERANCE: f64 = 0.2;

impl Bench {
    /// Whether the derivatives of the outputs by every parameter of the law, in all its forms, are those of the
    /// simulation. Shapes that least squares are known not to move are left out.
    pub fn check_derivatives(&self, mechanism: &'static Mechanism, slot: &Slot, signals: &Signals) -> Vec<Breach> {
        let mut breaches = Vec::new();
        for (purpose, _) in mechanism.forms(slot) {
            let Ok(written) = mechanism.rewrite(&self.simulation, slot, signals, purpose) else { continue };
            let starts = written.starts();
            let Some(start) = starts.get(starts.len() / 4) else { continue };
            let mut values = start.clone();
            values.extend(written.amplitudes.iter().map(|a| (a.name.clone(), SHARE * a.size)));
            let document = with(&written.simulation, &values);
            for (name, off) in self.wrong_derivatives(&written, &document) {
                let what = format!("{purpose:?}: the derivative by {name} is off by {off:.2} of itself at {values:?}");
                breaches.push(self.breach(mechanism, slot, what));
            }
        }
        breaches
    }

    /// Parameters whose derivative is not that of the simulation, with by how much.
    fn wrong_derivatives(&self, written: &Rewritten, document: &Simulation) -> Vec<(String, f64)> {
        let Ok(compiled) = Compiled::new(document) else { return Vec::new() };
        let names = written.amplitudes.iter().map(|a| &a.name);
        let names = names.chain(written.shapes.iter().filter(|s| !s.searched).map(|s| &s.name));
        let fitted: Vec<(&String, usize)> = names.filter_map(|n| compiled.parameter_index(n).map(|i| (n, i))).collect();
        let directions: Vec<Direction<'_>> = fitted.iter().map(|(_, i)| Direction::Parameter(*i)).collect();
        let theta = compiled.theta();
        let found = compiled.sensitivities(&Run::new(&self.drive, &theta), &directions);
        let mut wrong = Vec::new();
        for ((name, _), tangent) in fitted.into_iter().zip(&found.tangents) {
            let value = document.parameter(name).map_or(0.0, |p| p.value);
            let quotients = |eps: f64| -> Option<Vec<Vec<f64>>> {
                let shifted = |by: f64| outputs(&with(document, &[(name.clone(), value + by)]), &self.drive);
                let (up, down) = (shifted(eps)?, shifted(-eps)?);
                let of_output = |(up, down): (&Vec<f64>, &Vec<f64>)| {
                    up.iter().zip(down).map(|(u, d)| (u - d) / (2.0 * eps)).collect()
                };
                Some(up.iter().zip(&down).map(of_output).collect())
            };
            let eps = 1e-6 * value.abs();
            let (Some(wide), Some(narrow)) = (quotients(eps), quotients(0.2 * eps)) else { continue };
            let apart = |a: &[f64], b: &[f64]| {
                let size = rms(a.iter().copied()).max(rms(b.iter().copied())).max(f64::MIN_POSITIVE);
                (size, rms(a.iter().zip(b).map(|(a, b)| a - b)) / size)
            };
            let outputs = tangent.iter().zip(&self.baseline).zip(wide.iter().zip(&narrow));
            let off = outputs.map(|((tangent, baseline), (wide, narrow))| {
                let (size, off) = apart(tangent, wide);
                // What moves an output by less than the digits of the differences tells nothing (a machine that sticks throughout), nor does a
                // motion that parts from its neighbour whatever the distance (a steep ripple).
                let seen = size * value.abs() > 1e-6 * rms(baseline.iter().copied());
                if seen && apart(wide, narrow).1 < TOLERANCE { off } else { 0.0 }
            });
            let off = off.fold(0.0, f64::max);
            if off > TOLERANCE {
                wrong.push((name.clone(), off));
            }
        }
        wrong
    }
}
