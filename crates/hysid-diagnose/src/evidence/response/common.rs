//! The way of one force to several outputs at once.
//!
//! What a force makes is in each output with a delay and a shape of its own, so what one of them has shown tells what the others will. The outputs that were
//! recorded at one moment are taken one after the other: each is a row of a [`Course`] of its own, after the last of which the states move on. The filter of that
//! course is the joint one, as the noises of the sensors are independent.
//!
//! Reference: B. D. O. Anderson, J. B. Moore, Optimal Filtering, Prentice-Hall (1979), sec. 6.4 (sequential processing of simultaneous outputs).

use std::sync::Arc;

use super::course::Rows;
use super::moving::Moved;
use super::{Colours, Course, ForcePath, between};

/// The noise of one output's sensor: standard deviation of its innovations, and the pole of a first-order autoregression (0 where it is white).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::evidence) struct Sensor {
    pub sigma: f64,
    pub pole: f64,
}

/// The way from a force to some outputs, from row to row.
#[derive(Debug, Clone, PartialEq)]
pub struct CommonPath {
    /// The state in whose derivative the force enters, among all of the simulation.
    entry: usize,
    /// Those that it reaches, in their order.
    outputs: Vec<usize>,
    states: usize,
    /// Of each moment of each run: the matrix to the next (by rows), what a unit force adds, each of the outputs. One moment stands for all where they are alike.
    runs: Vec<Rows>,
}

impl CommonPath {
    /// Of a force at state `entry`, by the moments of each run and their number; `None` where fewer than two outputs are reached, or a value is not finite.
    pub fn new(entry: usize, outputs: Vec<usize>, states: usize, runs: Vec<(Vec<f64>, usize)>) -> Option<Self> {
        let finite = states > 0 && runs.iter().all(|(values, _)| values.iter().all(|x| x.is_finite()));
        let runs = runs.into_iter().map(|(values, count)| Rows { values, count }).collect();
        (finite && outputs.len() > 1).then_some(Self { entry, outputs, states, runs })
    }

    /// The mean way into the derivative of state `entry` of `dx/dt = a x`, out by `y = c x` (both by rows), for a force that is held through `period_s`; `moments` tells
    /// those of each run that the outputs which it reaches recorded together. `None` where it reaches fewer than two, or nothing finite does.
    pub fn held(
        (a, c): (&[f64], &[f64]),
        entry: usize,
        period_s: f64,
        moments: impl FnOnce(&[usize]) -> Vec<usize>,
    ) -> Option<Self> {
        let n = a.len().isqrt();
        let reaches = |c: &[f64]| ForcePath::held(a, entry, c, period_s).is_some();
        let outputs: Vec<usize> = (c.chunks_exact(n).enumerate()).filter(|(_, c)| reaches(c)).map(|(o, _)| o).collect();
        let shown = |i: usize| outputs.iter().map(|o| c[o * n + i].abs()).sum::<f64>();
        let all: Vec<f64> = (0..n).map(shown).collect();
        let path = ForcePath::held(a, entry, &all, period_s)?;
        let kept = between(n, entry, |i, j| a[i * n + j] != 0.0, |i| all[i] != 0.0);
        let mut values: Vec<f64> = path.a.transpose().iter().chain(path.b.iter()).copied().collect();
        outputs.iter().for_each(|o| values.extend(kept.iter().map(|i| c[o * n + i])));
        let runs = moments(&outputs).into_iter().map(|count| (values.clone(), count)).collect();
        Self::new(entry, outputs, kept.len(), runs)
    }

    /// The state in whose derivative the force enters, among all of the simulation.
    pub fn entry(&self) -> usize {
        self.entry
    }

    /// The outputs that the force reaches.
    pub(in crate::evidence) fn outputs(&self) -> &[usize] {
        &self.outputs
    }

    /// Moments of each run.
    pub(in crate::evidence) fn moments(&self) -> impl ExactSizeIterator<Item = usize> {
        self.runs.iter().map(|run| run.count)
    }

    /// Numbers that a moment takes.
    fn width(&self) -> usize {
        self.states * (self.states + 1 + self.outputs.len())
    }

    /// The outputs one after the other, each in units of its sensor's innovations and less what the sensor's noise before tells of it; the force with a memory of
    /// this pole (0: white).
    pub(in crate::evidence) fn interleaved(&self, sensors: &[Sensor], pole: f64) -> Moved {
        let (n, outputs) = (self.states, self.outputs.len());
        let force = Colours { force: pole, sensor: 0.0 };
        let remembered = (pole != 0.0).then_some(n);
        let known = n + usize::from(pole != 0.0);
        // A sensor whose noise has a memory remembers what it showed last without that noise.
        let shown: Vec<usize> = (0..outputs).filter(|&o| sensors[o].pole != 0.0).collect();
        let states = known + shown.len();
        let mut row = Vec::new();
        let mut moment = |moment: &[f64], values: &mut Vec<f64>| {
            let (a, rest) = moment.split_at(n * n);
            let (b, shows) = rest.split_at(n);
            for (o, c) in shows.chunks_exact(n).enumerate() {
                row.clear();
                force.extend((a, b, c), &mut row);
                let (a, rest) = row.split_at(known * known);
                let b = &rest[..known];
                let start = values.len();
                values.resize(start + Course::width(states), 0.0);
                let (matrix, rest) = values[start..].split_at_mut(states * states);
                let (pushed, output) = rest.split_at_mut(states);
                if o + 1 < outputs {
                    (0..states).for_each(|i| matrix[i * states + i] = 1.0);
                } else {
                    for (to, a) in matrix.chunks_exact_mut(states).zip(a.chunks_exact(known)) {
                        to[..known].copy_from_slice(a);
                    }
                    for (at, &of) in shown.iter().enumerate() {
                        let to = &mut matrix[(known + at) * states..][..n];
                        to.iter_mut().zip(&shows[of * n..][..n]).for_each(|(to, c)| *to = c / sensors[of].sigma);
                    }
                    pushed[..known].copy_from_slice(b);
                }
                output.iter_mut().zip(c).for_each(|(to, c)| *to = c / sensors[o].sigma);
                if let Some(at) = shown.iter().position(|&of| of == o) {
                    output[known + at] = -sensors[o].pole;
                }
            }
        };
        let longer = |run: &Rows| {
            let mut values = Vec::with_capacity(run.values.len() / self.width() * outputs * Course::width(states));
            run.values.chunks_exact(self.width()).for_each(|one| moment(one, &mut values));
            Rows { values, count: run.count * outputs }
        };
        let runs = self.runs.iter().map(longer).collect();
        Moved(Arc::new(Course { states, remembered, together: outputs, runs }))
    }
}
