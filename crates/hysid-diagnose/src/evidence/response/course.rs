//! The way of a force to an output from row to row.

use std::sync::Arc;

use super::Colours;
use super::gains::Row;
use super::moving::Chain;

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

    /// Matrix, force and output of a row of a run.
    fn step(&self, run: usize, k: usize) -> (&[f64], &[f64], &[f64]) {
        let (n, width, values) = (self.states, Self::width(self.states), &self.runs[run].values);
        let stored = (values.len() / width).max(1);
        let (a, rest) = values[k % stored * width..][..width].split_at(n * n);
        let (b, c) = rest.split_at(n);
        (a, b, c)
    }

    /// The same of each row.
    pub(super) fn steps(
        &self,
        run: usize,
    ) -> impl DoubleEndedIterator<Item = (&[f64], &[f64], &[f64])> + ExactSizeIterator {
        (0..self.rows(run)).map(move |k| self.step(run, k))
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
}

impl Chain for Course {
    fn states(&self) -> usize {
        self.states
    }

    fn together(&self) -> usize {
        self.together
    }

    fn remembered(&self) -> Option<usize> {
        self.remembered
    }

    fn recur(&self, run: usize) -> Option<usize> {
        let rows = &self.runs[run];
        let stored = rows.values.len() / Self::width(self.states);
        (stored < rows.count).then_some(stored)
    }

    fn rows(&self, run: usize) -> usize {
        self.runs.get(run).map_or(0, |rows| rows.count)
    }

    fn put<const N: usize>(&self, run: usize, k: usize, row: &mut Row<N>) {
        let (a, b, c) = self.step(run, k);
        row.moves = (k + 1) % self.together == 0;
        if row.moves {
            row.a.as_flattened_mut().copy_from_slice(a);
            row.b.copy_from_slice(b);
        }
        row.c.copy_from_slice(c);
    }
}
