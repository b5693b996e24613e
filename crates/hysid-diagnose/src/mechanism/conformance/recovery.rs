//! Recovery of a mechanism from its own noise-free simulation: the heavy part of the suite.

use hysid_plant::{Compiled, Direction, Drive, Run};
use nalgebra::{DMatrix, DVector};

use super::motion::{Bench, SAMPLES, difference, outputs, rms, with};
use crate::evidence::{Layout, NoiseModel, Series, Whitener};
use crate::mechanism::{Mechanism, Purpose, Rewritten, Signals};
use crate::refit::{LmOptions, Problem, levenberg_marquardt};
use crate::slot::{Slot, Target};

/// Most points of the shape grid that a fit is tried from.
const MOST_POINTS: usize = 48;
/// Size of the effect relative to the outputs.
const VISIBLE: f64 = 0.1;
/// Fits from the best points.
const FITS: usize = 5;

/// What a simulation with the mechanism in it gives.
pub(super) struct Truth {
    pub outputs: Vec<Vec<f64>>,
    /// Its difference from the baseline, relative to the outputs.
    effect: f64,
}

impl Bench {
    /// Simulates the mechanism at a point off its grid, then fits it from its grid together with the baseline's own
    /// parameters, which start 1 % off, and returns the rms of what is left over the rms of the effect. `None` where the
    /// effect makes no difference here.
    pub fn recovery(&self, mechanism: &'static Mechanism, slot: &Slot, signals: &Signals) -> Option<f64> {
        let written = mechanism.rewrite(&self.simulation, slot, signals, Purpose::Refit).ok()?;
        let truth = self.truth(&written, VISIBLE)?;
        // What can be read off the recording now: the peaks of the residual, the steps of the output.
        let mut seen = signals.clone();
        seen.peaks_hz = self.peaks_hz(&truth.outputs);
        if let Target::Output(column) = &slot.target {
            let at = self.simulation.outputs.iter().position(|o| o.column == *column);
            seen.measure(at.and_then(|i| truth.outputs.get(i).cloned()));
        }
        let written = mechanism.rewrite(&self.simulation, slot, &seen, Purpose::Refit).ok()?;
        let compiled = Compiled::new(&written.simulation).ok()?;
        let problem = SelfRecord::new(&compiled, &self.drive, &truth.outputs);
        let candidates = self.candidates(&written, &problem);
        let mut left = f64::INFINITY;
        for (_, theta) in candidates.iter().take(FITS) {
            let options = LmOptions { iterations: 50, tolerance: 1e-9 };
            let (layout, whitener) = (&problem.layout, &problem.whitener);
            if let Some(fit) = levenberg_marquardt(&problem, theta, layout, whitener, None, options) {
                left = left.min(problem.size(&fit.residual));
            }
            if left < 1e-3 * truth.effect {
                break;
            }
        }
        Some(left / truth.effect)
    }

    /// Starts with their remainders, best first: for each point of the grid the amplitudes that the tangent at zero proposes,
    /// and three shares of their sizes.
    fn candidates(&self, written: &Rewritten, problem: &SelfRecord<'_>) -> Vec<(f64, Vec<f64>)> {
        let own = written.parameters(&self.simulation);
        let parameters: Vec<_> =
            problem.fitted.iter().filter_map(|i| problem.compiled.parameters().get(*i)).cloned().collect();
        // Where nothing of the law is left to fit, the question is only whether what was read off the recording is right.
        let off = if parameters.iter().any(|p| own.contains(&p.name)) { 1.01 } else { 1.0 };
        let starts = written.starts();
        let mut tried = Vec::new();
        for start in starts.iter().step_by(starts.len().div_ceil(MOST_POINTS)) {
            let at = |share: f64| -> Vec<f64> {
                let value = |p: &hysid_plant::Parameter| {
                    let amplitude = written.amplitudes.iter().find(|a| a.name == p.name);
                    let shape = start.iter().find(|(n, _)| *n == p.name);
                    let value = match (amplitude, shape) {
                        (Some(a), _) => share * a.size,
                        (None, Some((_, value))) => *value,
                        (None, None) => off * p.value,
                    };
                    value.clamp(p.lower(), p.upper())
                };
                parameters.iter().map(value).collect()
            };
            if written.amplitudes.is_empty() {
                tried.push(at(0.0));
                continue;
            }
            tried.extend([0.02, 0.1, 0.3].map(at));
            let zero = at(0.0);
            let linear: Vec<usize> = (0..parameters.len())
                .filter(|i| parameters.get(*i).is_some_and(|p| !start.iter().any(|(n, _)| *n == p.name)))
                .collect();
            if let Some(step) = problem.linear_step(&zero, &linear) {
                let mut theta = zero;
                for (i, change) in linear.iter().zip(step) {
                    if let (Some(value), Some(p)) = (theta.get_mut(*i), parameters.get(*i))
                        && own.contains(&p.name)
                    {
                        *value = (*value + change).clamp(p.lower(), p.upper());
                    }
                }
                tried.push(theta);
            }
        }
        let mut judged: Vec<(f64, Vec<f64>)> =
            tried.into_iter().filter_map(|theta| problem.residual(&theta).map(|r| (problem.size(&r), theta))).collect();
        judged.sort_by(|a, b| a.0.total_cmp(&b.0));
        judged
    }

    /// The largest lines of the difference from the baseline, in Hz.
    fn peaks_hz(&self, target: &[Vec<f64>]) -> Vec<f64> {
        let Some((target, baseline)) = target.first().zip(self.baseline.first()) else { return Vec::new() };
        let residual: Vec<f64> = target.iter().zip(baseline).map(|(t, y)| t - y).collect();
        let lines = hysid_signal::fourier(&residual);
        let mut power: Vec<(usize, f64)> =
            lines.iter().enumerate().skip(1).map(|(k, (re, im))| (k, re * re + im * im)).collect();
        power.sort_by(|a, b| b.1.total_cmp(&a.1));
        let width = 1.0 / (self.drive.period_s() * residual.len().max(1) as f64);
        // Between the lines too: a peak rarely falls on one.
        power.iter().take(3).flat_map(|(k, _)| [-0.5, 0.0, 0.5].map(|part| (*k as f64 + part) * width)).collect()
    }

    /// The response at a point off the grid, between two neighbours; of a few such points and amplitudes the one whose effect
    /// is nearest to this share of the outputs.
    pub(super) fn truth(&self, written: &Rewritten, size: f64) -> Option<Truth> {
        let starts = written.starts();
        let shares: &[f64] = if written.amplitudes.is_empty() { &[0.0] } else { &[0.15, 0.05, 0.015, 0.4] };
        let off = |effect: f64| (effect / size).ln().abs();
        let mut best: Option<Truth> = None;
        for at in [starts.len() / 2, starts.len() / 4, 3 * starts.len() / 4] {
            let (one, two) = (starts.get(at)?, starts.get((at + 1).min(starts.len() - 1))?);
            let between = one.iter().zip(two).map(|((name, a), (_, b))| (name.clone(), 0.6 * a + 0.4 * b));
            let shapes: Vec<(String, f64)> = between.collect();
            for share in shares {
                let mut values = shapes.clone();
                for a in &written.amplitudes {
                    let p = written.simulation.parameter(&a.name)?;
                    values.push((a.name.clone(), (share * size / VISIBLE * a.size).clamp(p.lower(), p.upper())));
                }
                let Some(outputs) = outputs(&with(&written.simulation, &values), &self.drive) else { continue };
                let effect = difference(&self.baseline, &outputs);
                if effect > 1e-4 && best.as_ref().is_none_or(|b| off(effect) < off(b.effect)) {
                    best = Some(Truth { outputs, effect });
                }
            }
        }
        best
    }
}

/// The fit of a simulation to the outputs of another.
pub(super) struct SelfRecord<'a> {
    compiled: &'a Compiled,
    drive: &'a Drive,
    target: &'a [Vec<f64>],
    /// Places of the parameters that are fitted.
    pub fitted: Vec<usize>,
    bounds: Vec<(f64, f64)>,
    pub layout: Layout,
    pub whitener: Whitener,
}

impl<'a> SelfRecord<'a> {
    pub fn new(compiled: &'a Compiled, drive: &'a Drive, target: &'a [Vec<f64>]) -> Self {
        let fitted = compiled.estimated();
        let bounds =
            fitted.iter().filter_map(|i| compiled.parameters().get(*i)).map(|p| (p.lower(), p.upper())).collect();
        let series =
            (0..target.len()).map(|o| Series { stretch: 0, output: o, first: 0, rows: o * SAMPLES..(o + 1) * SAMPLES });
        let layout = Layout { series: series.collect(), outputs: target.len() };
        let sizes = target.iter().map(|y| rms(y.iter().copied()).max(f64::MIN_POSITIVE));
        let whitener = Whitener::of(sizes.map(NoiseModel::white).collect());
        Self { compiled, drive, target, fitted, bounds, layout, whitener }
    }

    fn theta(&self, values: &[f64]) -> Vec<f64> {
        let mut theta = self.compiled.theta();
        for (i, value) in self.fitted.iter().zip(values) {
            if let Some(slot) = theta.get_mut(*i) {
                *slot = *value;
            }
        }
        theta
    }

    fn stack(&self, outputs: &[Vec<f64>]) -> Vec<f64> {
        self.target.iter().zip(outputs).flat_map(|(t, y)| t.iter().zip(y).map(|(t, y)| t - y)).collect()
    }

    /// Rms of a stack, each output in units of its own rms.
    fn size(&self, stack: &[f64]) -> f64 {
        rms(self.whitener.apply(&self.layout, stack).into_iter())
    }

    /// The changes of these parameters that the tangent proposes.
    fn linear_step(&self, values: &[f64], which: &[usize]) -> Option<Vec<f64>> {
        let (residual, tangents) = self.tangent(values)?;
        let columns: Vec<Vec<f64>> =
            which.iter().filter_map(|i| tangents.get(*i)).map(|t| self.whitener.apply(&self.layout, t)).collect();
        let norms: Vec<f64> = columns.iter().map(|c| rms(c.iter().copied()).max(f64::MIN_POSITIVE)).collect();
        let target = DVector::from_vec(self.whitener.apply(&self.layout, &residual));
        let matrix = DMatrix::from_fn(target.len(), columns.len(), |i, j| {
            columns.get(j).and_then(|c| c.get(i)).copied().unwrap_or(0.0) / norms.get(j).copied().unwrap_or(1.0)
        });
        let mut gram = matrix.transpose() * &matrix;
        for i in 0..gram.nrows() {
            gram[(i, i)] *= 1.0 + 1e-9;
        }
        let solution = gram.cholesky()?.solve(&(matrix.transpose() * target));
        Some(solution.iter().zip(&norms).map(|(s, n)| s / n).collect())
    }
}

impl Problem for SelfRecord<'_> {
    fn bounds(&self) -> &[(f64, f64)] {
        &self.bounds
    }

    fn residual(&self, values: &[f64]) -> Option<Vec<f64>> {
        let theta = self.theta(values);
        let response = self.compiled.simulate(&Run::new(self.drive, &theta));
        response.diverged.is_none().then(|| self.stack(&response.outputs))
    }

    fn tangent(&self, values: &[f64]) -> Option<(Vec<f64>, Vec<Vec<f64>>)> {
        let theta = self.theta(values);
        let directions: Vec<Direction<'_>> = self.fitted.iter().map(|i| Direction::Parameter(*i)).collect();
        let found = self.compiled.sensitivities(&Run::new(self.drive, &theta), &directions);
        let mut all = found.tangents.iter().flatten().flatten();
        let finite = found.response.diverged.is_none() && all.all(|t| t.is_finite());
        let tangents = found.tangents.into_iter().map(|outputs| outputs.concat()).collect();
        finite.then(|| (self.stack(&found.response.outputs), tangents))
    }
}
