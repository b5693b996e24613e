//! Inputs that were not recorded, and what simulations answer to them.
//!
//! They are the recorded ones mirrored (each about the middle of its range) and reversed in time, which have the same levels and the same band, and lead
//! elsewhere; and twice as large, where a spring that softens by a power of the displacement pushes. They begin as they were recorded and fade over, so that
//! nothing hangs on how states begin.

use hysid_plant::{Drive, Initial, Simulation};
use hysid_signal::range;

use crate::data::DataSet;
use crate::model::base::Base;
use crate::model::{Model, Values};

/// What is left out of a fresh input before it is judged: one part of so many.
const RUN_IN: usize = 5;

/// The fitted simulation as it starts anew: where the document says, free states where they were found at the start of the longest recording.
pub fn started(base: &Base<'_>) -> Simulation {
    started_at(base, &base.fit.theta)
}

/// The same with other values of its unknowns.
pub(super) fn started_at(base: &Base<'_>, theta: &[f64]) -> Simulation {
    let mut document = base.model.document(theta);
    let (longest, found) = (base.model.data().longest(), base.model.values(theta).initials);
    for state in document.states.iter_mut().filter(|s| s.initial == Initial::Free) {
        let start = longest.and_then(|at| found.get(&(at, state.name.clone())).copied());
        state.initial = Initial::Number(start.unwrap_or(0.0));
    }
    document
}

/// An input as a data set, with what a simulation answers to it as its outputs; `None` where it diverges.
pub fn answered(document: &Simulation, drive: &Drive, substeps: usize) -> Option<DataSet> {
    let silent = vec![vec![0.0; drive.len()]; document.outputs.len()];
    let empty = DataSet::of_drive(drive.clone(), silent, drive.period_s());
    let mut fixed = document.clone();
    fixed.parameters.iter_mut().for_each(|p| p.fixed = true);
    let model = Model::new(&fixed, &empty, substeps).ok()?;
    let y = model.predict(&model.theta(&Values::default()))?;
    Some(empty.with_outputs(y))
}

/// The squared distance of two answers to one input after the run-in, each output in units of its noise.
pub(super) fn apart(a: &DataSet, b: &DataSet, noise: &[f64]) -> f64 {
    let outputs = a.stretches[0].outputs.iter().zip(&b.stretches[0].outputs).zip(noise);
    let squares = outputs.map(|((a, b), noise)| {
        a.iter().zip(b).skip(a.len() / RUN_IN).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / noise.powi(2)
    });
    squares.sum()
}

/// What makes another input of a recorded one.
pub(super) type Change = fn(&[f64]) -> Vec<f64>;

/// The input of the longest recording with this change, which it fades into; `None` where there is none.
pub(super) fn changed(data: &DataSet, change: Change) -> Option<Drive> {
    let recorded = &data.stretches[data.longest()?].drive;
    let inputs = recorded.inputs().iter().map(|u| faded(u, &change(u))).collect();
    Drive::new(recorded.start_s(), recorded.period_s(), recorded.len(), inputs).ok()
}

/// The first series, which gives way to the second over the first half of the run-in: a start is as it was recorded.
fn faded(from: &[f64], to: &[f64]) -> Vec<f64> {
    let length = (from.len() / (2 * RUN_IN)).max(1) as f64;
    let share = |n: usize| (n as f64 / length).min(1.0);
    from.iter().zip(to).enumerate().map(|(n, (a, b))| a + share(n) * (b - a)).collect()
}

/// A series from its end to its beginning.
pub(super) fn reversed(u: &[f64]) -> Vec<f64> {
    u.iter().rev().copied().collect()
}

/// A series mirrored about the middle of its range.
pub(super) fn mirror_image(u: &[f64]) -> Vec<f64> {
    about_the_middle(u, -1.0)
}

/// A series twice as far from the middle of its range.
pub(super) fn doubled(u: &[f64]) -> Vec<f64> {
    about_the_middle(u, 2.0)
}

/// A series so many times as far from the middle of its range.
fn about_the_middle(u: &[f64], times: f64) -> Vec<f64> {
    let (low, high) = range(u.iter().copied());
    let middle = 0.5 * (low + high);
    u.iter().map(|x| middle + times * (x - middle)).collect()
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A drive that nothing holds, pushed one way first, with this damping and a further force.
    pub fn drive(damping: f64, force: &str) -> Simulation {
        let text = format!(
            "[time]\nperiod_s = 0.01\n[inputs]\nu = \"u_N\"\n[parameters]\nb = {{ value = {damping}, min = 0.0, max = 9.0 }}\n\
             [states]\nq = {{ derivative = \"w\", initial = 0.0 }}\nw = {{ derivative = \"u - b*w{force}\", initial = 0.0 }}\n\
             [outputs]\nq_m = \"q\"\n"
        );
        Simulation::parse(&text, "drive").unwrap()
    }

    #[test]
    fn a_fresh_input_begins_as_it_was_recorded() {
        let recorded: Vec<f64> = (0..100).map(|n| f64::from(n) + 1.0).collect();
        for change in [mirror_image, reversed, doubled] {
            let fresh = faded(&recorded, &change(&recorded));
            assert_eq!(fresh[0], recorded[0]);
            assert_eq!(fresh[100 / RUN_IN..], change(&recorded)[100 / RUN_IN..]);
        }
    }
}
