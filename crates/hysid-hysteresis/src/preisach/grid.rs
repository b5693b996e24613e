//! The Preisach operator relay by relay: slow, plain, and what the fast form is held against.

use super::{Scale, Start, Weights};
use crate::{Operator, RelayState, relay};

/// A Preisach operator that keeps and sums every relay of its grid.
#[derive(Debug, Clone)]
pub struct PreisachGrid {
    weights: Weights,
}

impl PreisachGrid {
    pub(super) fn new(weights: Weights) -> Self {
        Self { weights }
    }

    /// How many relays have a weight.
    pub fn relays(&self) -> usize {
        self.weights.weight.iter().filter(|w| **w > 0.0).count()
    }

    fn scale(&self) -> Scale {
        self.weights.scale
    }
}

impl Operator for PreisachGrid {
    /// Every relay, in the order of the weights.
    type State = Vec<RelayState>;

    fn init(&self) -> Vec<RelayState> {
        let cells = self.weights.cells();
        let up = |i: usize, j: usize| match self.weights.start {
            Start::AllOff => false,
            Start::AllOn => true,
            Start::Demagnetised => i + j + 1 < cells,
        };
        let relays = (0..cells).flat_map(|i| (0..=i).map(move |j| (i, j)));
        relays.map(|(i, j)| if up(i, j) { RelayState::Up } else { RelayState::Down }).collect()
    }

    fn step(&self, relays: &mut Vec<RelayState>, u: f64) -> f64 {
        let middles = &self.weights.middles;
        let mut rest = relays.as_mut_slice();
        let mut weights = self.weights.weight.as_slice();
        let mut up = 0.0;
        for (i, &alpha) in middles.iter().enumerate() {
            let (row, below) = rest.split_at_mut(i + 1);
            let (row_weights, weights_below) = weights.split_at(i + 1);
            for ((state, &beta), weight) in row.iter_mut().zip(middles).zip(row_weights) {
                *state = relay(*state, u, beta, alpha);
                if *state == RelayState::Up {
                    up += weight;
                }
            }
            (rest, weights) = (below, weights_below);
        }
        self.scale().output(up)
    }
}
