//! Whether the screening sees each form of a law: what a form does, outside of what the simulation's own parameters do, must be in the columns of the
//! screening form to a share, or the form is fitted only where another one happens to be near.

use hysid_plant::Compiled;

use super::motion::{Bench, SAMPLES, with};
use super::recovery::SelfRecord;
use crate::evidence::{Projector, norm2};
use crate::mechanism::{Amplitudes, Mechanism, Purpose, Signals};
use crate::refit::Problem;
use crate::slot::Slot;

/// Size of an effect relative to the outputs at which its response is its tangent.
const SMALL: f64 = 0.001;

impl Bench {
    /// The share (of the squared norm) of what a form of a law does outside of what the baseline's parameters do that the columns of its screening form, at
    /// the best point of their grid, hold; `None` where it does nothing there.
    pub fn seen(&self, mechanism: &'static Mechanism, slot: &Slot, signals: &Signals, purpose: Purpose) -> Option<f64> {
        let written = mechanism.rewrite(&self.simulation, slot, signals, purpose).ok()?;
        let truth = self.truth(&written, SMALL)?;
        let screening = mechanism.rewrite(&self.simulation, slot, signals, Purpose::Screening).ok()?;
        let apart = mechanism.law_at(slot, Purpose::Screening).amplitudes == Amplitudes::Apart;
        let mut fixed = screening.simulation.clone();
        for shape in &screening.shapes {
            fixed.parameter_mut(&shape.name)?.fixed = true;
        }
        let mut best: Option<f64> = None;
        for start in screening.starts() {
            let mut at = with(&fixed, &start);
            for amplitude in &screening.amplitudes {
                at.parameter_mut(&amplitude.name)?.value = 0.0;
            }
            let compiled = Compiled::new(&at).ok()?;
            let problem = SelfRecord::new(&compiled, &self.drive, &truth.outputs);
            let theta = compiled.theta();
            let values: Vec<f64> = problem.fitted.iter().map(|&i| theta[i]).collect();
            let Some((residual, tangents)) = problem.tangent(&values) else { continue };
            let whitened = |v: &[f64]| problem.whitener.apply(&problem.layout, v);
            let name = |k: usize| &compiled.parameters()[problem.fitted[k]].name;
            let (own, added): (Vec<usize>, Vec<usize>) =
                (0..tangents.len()).partition(|&k| screening.amplitudes.iter().all(|a| a.name != *name(k)));
            let baseline = Projector::new(own.iter().map(|&k| whitened(&tangents[k])));
            let mut r = whitened(&residual);
            baseline.remove(&mut r);
            let before = norm2(&r);
            if before < (1e-7 * SMALL).powi(2) * SAMPLES as f64 {
                continue;
            }
            let groups: Vec<Vec<usize>> = if apart { added.iter().map(|k| vec![*k]).collect() } else { vec![added] };
            for group in groups {
                let (mut all, mut left) = (baseline.clone(), r.clone());
                for k in group {
                    all.push(whitened(&tangents[k]));
                }
                all.remove(&mut left);
                let share = 1.0 - norm2(&left) / before;
                best = Some(best.map_or(share, |b: f64| b.max(share)));
            }
        }
        best
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mechanism::conformance::benches;
    use crate::mechanism::{Form, catalogue, mechanism};

    /// Share of what a form does that its screening must hold on one bench at least.
    const LEAST: f64 = 0.5;

    /// What is read off the recording that it is missing in (its lines, its steps), and what is no small change of anything.
    fn is_not_small(id: &str, purpose: Purpose) -> bool {
        let between_parts = ["spring_clearance", "backlash"].contains(&id) && purpose == Purpose::Form(Form::Other);
        between_parts || ["periodic_disturbance", "quantisation"].contains(&id)
    }

    #[test]
    fn the_screening_sees_every_form_of_a_law() {
        let benches = benches();
        let mut blind = Vec::new();
        for mechanism in catalogue() {
            let at = |b| Bench::slots(b, mechanism).into_iter().map(move |(slot, signals)| (b, slot, signals));
            let places: Vec<(&Bench, Slot, Signals)> = benches.iter().flat_map(at).collect();
            let mut purposes: Vec<Purpose> = Vec::new();
            for (_, slot, _) in &places {
                let forms = mechanism.forms(slot).into_iter().map(|(purpose, _)| purpose);
                forms.for_each(|p| {
                    if !purposes.contains(&p) {
                        purposes.push(p)
                    }
                });
            }
            for purpose in purposes.into_iter().filter(|p| !is_not_small(mechanism.id, *p)) {
                let has_it = |slot: &Slot| mechanism.forms(slot).iter().any(|(p, _)| *p == purpose);
                let mut shares = places
                    .iter()
                    .filter(|(_, slot, _)| has_it(slot))
                    .filter_map(|(b, slot, signals)| b.seen(mechanism, slot, signals, purpose));
                if shares.all(|share| share < LEAST) {
                    blind.push(format!("{} {purpose:?}", mechanism.id));
                }
            }
        }
        assert!(blind.is_empty(), "not seen where it is screened: {blind:?}");
    }

    /// Over several turns no wave of one or two periods a turn is near the square of the angle.
    #[test]
    fn an_inertia_that_grows_over_many_turns_is_screened() {
        let text = "[time]\nperiod_s = 0.01\n[inputs]\nu = \"torque_Nm\"\n[parameters]\nJ = { value = 0.2, min = 0.02, unit = \"kg m^2\" }\n\
                    b = { value = 0.4, min = 0.04, unit = \"N m s\" }\n[states]\nq = { derivative = \"w\", initial = 0.0, unit = \"rad\" }\n\
                    w = { derivative = \"(u - b*w)/J\", initial = 0.0, unit = \"rad/s\" }\n[outputs]\nq_rad = \"q\"\n";
        let simulation = hysid_plant::Simulation::parse(text, "axis.sim.toml").unwrap();
        let law = mechanism("position_dependent_inertia").unwrap();
        for size in [0.5, 40.0] {
            let bench = Bench::new(&simulation, 0.01, size).unwrap();
            let (slot, signals) = bench.slots(law).remove(0);
            for (purpose, _) in law.forms(&slot) {
                let share = bench.seen(law, &slot, &signals, purpose).unwrap();
                assert!(share > 0.8, "{size} {purpose:?}: {share}");
            }
        }
    }
}
