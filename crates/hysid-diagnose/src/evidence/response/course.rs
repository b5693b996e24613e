//! The way of a force to an output from row to row.

use std::sync::Arc;

use super::Colours;
use super::gains::{Gaining, Row};

/// A run of rows: each of its own, or a few that recur.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Rows {
    /// Of each row: the matrix to the next row (by rows), what a unit force adds to it, the output.
    pub values: Vec<f64>,
    /// Rows of the run.
    pub count: usize,
}

/// A way from a force to one output that changes from row to row, for each run of rows; or to several that are recorded at one moment, whose rows follow each other.
#[derive(Debug, Clone, PartialEq)]
pub struct Course {
    pub(super) states: usize,
    /// The state that is a force with a memory, which has its variance from the start.
    pub(super) remembered: Option<usize>,
    /// Rows of one moment: the states move on after the last of them.
    pub(super) together: usize,
    pub(super) runs: Vec<Rows>,
}

impl Course {
    /// Of the rows of each run (matrix, force, output); `None` where one is not finite.
    pub fn new(states: usize, runs: Vec<Vec<f64>>) -> Option<Self> {
        let finite = states > 0 && runs.iter().flatten().all(|x| x.is_finite());
        let rows = |values: Vec<f64>| Rows { count: values.len() / Self::width(states), values };
        finite.then(|| Self { states, remembered: None, together: 1, runs: runs.into_iter().map(rows).collect() })
    }

    /// Numbers that a row takes.
    pub(super) const fn width(states: usize) -> usize {
        states * (states + 2)
    }

    /// Rows of a run.
    pub(super) fn rows(&self, run: usize) -> usize {
        self.runs.get(run).map_or(0, |rows| rows.count)
    }

    /// Matrix, force and output of each row of a run.
    pub(super) fn steps(
        &self,
        run: usize,
    ) -> impl DoubleEndedIterator<Item = (&[f64], &[f64], &[f64])> + ExactSizeIterator {
        let (n, width, rows) = (self.states, Self::width(self.states), &self.runs[run]);
        let stored = (rows.values.len() / width).max(1);
        (0..rows.count).map(move |k| {
            let (a, rest) = rows.values[k % stored * width..][..width].split_at(n * n);
            let (b, c) = rest.split_at(n);
            (a, b, c)
        })
    }

    /// Rows after which those of a run recur; `None` where each is of its own.
    fn recur(&self, run: usize) -> Option<usize> {
        let rows = &self.runs[run];
        let stored = rows.values.len() / Self::width(self.states);
        (stored < rows.count).then_some(stored)
    }

    /// The same for noises of these colours.
    pub(super) fn coloured(self: &Arc<Self>, colours: Colours) -> Arc<Self> {
        if colours == Colours::WHITE {
            return Arc::clone(self);
        }
        let n = self.states;
        let states = n + colours.states();
        let longer = |run: usize| {
            let mut values = Vec::with_capacity(self.rows(run) * Self::width(states));
            self.steps(run).for_each(|row| colours.extend(row, &mut values));
            Rows { values, count: self.rows(run) }
        };
        let remembered = (colours.force != 0.0).then_some(n);
        Arc::new(Self { states, remembered, together: 1, runs: (0..self.runs.len()).map(longer).collect() })
    }

    /// The rows of a run by arrays.
    pub(super) fn rows_of<const N: usize>(&self, run: usize) -> impl Iterator<Item = Row<N>> {
        self.steps(run).enumerate().map(|(k, (a, b, c))| Row {
            moves: (k + 1) % self.together == 0,
            a: std::array::from_fn(|i| std::array::from_fn(|j| a[i * N + j])),
            b: std::array::from_fn(|i| b[i]),
            c: std::array::from_fn(|i| c[i]),
        })
    }

    /// Powers and gains before the first row of a run, under a force of this variance.
    pub(super) fn begun<const N: usize>(&self, run: usize, variance: f64) -> Gaining<N> {
        Gaining::new(variance, self.remembered, self.recur(run))
    }
}
