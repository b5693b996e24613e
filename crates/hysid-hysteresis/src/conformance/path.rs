//! Paths of an input over equal steps of its range: every step between two reversals is a sample.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// Steps over the range.
pub(super) const STEPS: usize = 240;

/// Draws paths; a function of its seed.
pub(super) struct Paths {
    random: Pcg64Mcg,
    lower: f64,
    step: f64,
}

impl Paths {
    pub(super) fn new(lower: f64, upper: f64, seed: u64) -> Self {
        Self { random: Pcg64Mcg::seed_from_u64(seed), lower, step: (upper - lower) / STEPS as f64 }
    }

    /// A whole number from `from` to `to`, both included.
    pub(super) fn between(&mut self, from: usize, to: usize) -> usize {
        self.random.random_range(from..=to)
    }

    /// Some reversals anywhere in the range.
    pub(super) fn reversals(&mut self, count: usize) -> Vec<usize> {
        (0..count).map(|_| self.between(0, STEPS)).collect()
    }

    /// The path that starts at the first of these and goes to each next one, sample by sample.
    pub(super) fn through(&self, reversals: &[usize]) -> Vec<f64> {
        let Some(&first) = reversals.first() else { return Vec::new() };
        let mut at = first;
        let mut path = vec![self.value(at)];
        for &to in &reversals[1..] {
            while at != to {
                at = if to > at { at + 1 } else { at - 1 };
                path.push(self.value(at));
            }
        }
        path
    }

    /// The input at a step.
    pub(super) fn value(&self, step: usize) -> f64 {
        self.lower + self.step * step as f64
    }
}
