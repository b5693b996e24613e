//! The way of one force to several outputs at once.
//!
//! What a force makes is in each output with a delay and a shape of its own, so what one of them has shown tells what the others will. The outputs that were
//! recorded at one moment are taken one after the other: each is a row of a [`Course`] of its own, after the last of which the states move on. The filter of that
//! course is the joint one, as the noises of the sensors are independent.
//!
//! Reference: B. D. O. Anderson, J. B. Moore, Optimal Filtering, Prentice-Hall (1979), sec. 6.4 (sequential processing of simultaneous outputs).

use std::sync::Arc;

use super::course::Rows;
use super::gains::Row;
use super::moving::{Chain, Innovations, Moved, MovingFilter, innovations};
use super::{Course, ForcePath, between, pushed};

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
    pub(in crate::evidence) fn interleaved<'a>(&'a self, sensors: &'a [Sensor], pole: f64) -> Interleaved<'a> {
        let shown: Vec<usize> = (0..self.outputs.len()).filter(|&o| sensors[o].pole != 0.0).collect();
        let known = self.states + usize::from(pole != 0.0);
        Interleaved { path: self, sensors, pole, states: known + shown.len(), shown }
    }
}

/// A common way with noises of some sizes and colours, as rows of one output each. They are made where they are asked for: many sizes are tried.
pub(in crate::evidence) struct Interleaved<'a> {
    path: &'a CommonPath,
    sensors: &'a [Sensor],
    pole: f64,
    /// Those of the path, that of a force with a memory, and one of each sensor whose noise has a memory: what it showed last without that noise.
    states: usize,
    /// The sensors whose noise has a memory.
    shown: Vec<usize>,
}

impl Interleaved<'_> {
    /// Puts output `o` of a moment into a row (matrix, force, output), zero before but for the same entries of another moment. Matrix and force are those of its last
    /// row, after which the states move on.
    fn put_output(&self, moment: &[f64], o: usize, [matrix, force, output]: [&mut [f64]; 3]) {
        let (n, states) = (self.path.states, self.states);
        let (a, rest) = moment.split_at(n * n);
        let (b, shows) = rest.split_at(n);
        let first = states - self.shown.len();
        let scaled = |of: usize, to: &mut [f64]| {
            to.iter_mut().zip(&shows[of * n..][..n]).for_each(|(to, c)| *to = c / self.sensors[of].sigma);
        };
        if self.moves(o) {
            pushed(self.pole, (a, b), matrix, force);
            self.shown.iter().enumerate().for_each(|(at, &of)| scaled(of, &mut matrix[(first + at) * states..][..n]));
        }
        scaled(o, &mut output[..n]);
        if let Some(at) = self.shown.iter().position(|&of| of == o) {
            output[first + at] = -self.sensors[o].pole;
        }
    }

    /// Whether the states move on after this output.
    fn moves(&self, o: usize) -> bool {
        o + 1 == self.path.outputs.len()
    }

    /// [`Innovations`] of stretches under a force of this variance.
    pub(in crate::evidence) fn innovations(&self, variance: f64, stretches: &[Vec<f64>]) -> Option<Innovations> {
        innovations(self, variance, stretches)
    }

    /// The filter for a force of this variance.
    pub(in crate::evidence) fn filter(&self, variance: f64) -> Option<MovingFilter> {
        let (n, outputs) = (self.states, self.path.outputs.len());
        let run = |run: &Rows| {
            let moments = run.values.len() / self.path.width();
            let mut values = vec![0.0; moments * outputs * Course::width(n)];
            let rows = values.chunks_exact_mut(Course::width(n));
            let each = run.values.chunks_exact(self.path.width()).flat_map(|m| (0..outputs).map(move |o| (m, o)));
            for (row, (moment, o)) in rows.zip(each) {
                let (matrix, rest) = row.split_at_mut(n * n);
                let (force, output) = rest.split_at_mut(n);
                self.put_output(moment, o, [&mut *matrix, force, output]);
                if !self.moves(o) {
                    (0..n).for_each(|i| matrix[i * n + i] = 1.0);
                }
            }
            Rows { values, count: run.count * outputs }
        };
        let runs = self.path.runs.iter().map(run).collect();
        Moved(Arc::new(Course { states: n, remembered: self.remembered(), together: outputs, runs })).filter(variance)
    }
}

impl Chain for Interleaved<'_> {
    fn states(&self) -> usize {
        self.states
    }

    fn together(&self) -> usize {
        self.path.outputs.len()
    }

    fn remembered(&self) -> Option<usize> {
        (self.pole != 0.0).then_some(self.path.states)
    }

    fn recur(&self, run: usize) -> Option<usize> {
        let run = &self.path.runs[run];
        let stored = run.values.len() / self.path.width();
        (stored < run.count).then_some(stored * self.path.outputs.len())
    }

    fn rows(&self, run: usize) -> usize {
        self.path.runs[run].count * self.path.outputs.len()
    }

    fn put<const N: usize>(&self, run: usize, k: usize, row: &mut Row<N>) {
        let (run, width, outputs) = (&self.path.runs[run], self.path.width(), self.path.outputs.len());
        let stored = (run.values.len() / width).max(1);
        row.moves = self.moves(k % outputs);
        row.c = [0.0; N];
        let moment = &run.values[k / outputs % stored * width..][..width];
        self.put_output(moment, k % outputs, [row.a.as_flattened_mut(), &mut row.b, &mut row.c]);
    }
}
