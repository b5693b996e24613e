//! Everett functions: the weight of all relays between two reversals, which is all that the staircase needs to know.

use std::fmt::Debug;

use super::Weights;

/// The weight of the relays in a triangle of the plane.
///
/// A level is an input as the relays see it.
pub trait Everett: Send + Sync {
    /// A level: ordered like the input.
    type Level: Copy + PartialOrd + Debug + Send + Sync;

    /// The level below every relay, and the level above.
    fn limits(&self) -> (Self::Level, Self::Level);

    /// The levels that an input reaches from below and from above; the second is at most the first.
    ///
    /// They differ only where the input is exactly a threshold, which both a rise and a fall to it pass.
    fn levels(&self, u: f64) -> (Self::Level, Self::Level);

    /// The weight of the relays that go up below the level `a` and come down at or above the level `b`: 0 where `b >= a`.
    fn triangle(&self, a: Self::Level, b: Self::Level) -> f64;

    /// The weight of the relays without memory (equal thresholds) that are up at the level `risen` of [`Self::levels`], where
    /// `triangle` has left them out.
    fn without_memory(&self, risen: Self::Level) -> f64;

    /// The reversals (maximum, minimum), outermost first, that decaying reversals about the middle leave.
    fn demagnetised(&self) -> Vec<(Self::Level, Self::Level)>;
}

/// The Everett function of the relays of a grid; a level is the number of thresholds at or below the input.
#[derive(Debug, Clone)]
pub struct RelayTable {
    lower: f64,
    per_width: f64,
    middles: Vec<f64>,
    /// `triangle(a, b)` for `b < a` at `a(a - 1)/2 + b`.
    triangle: Vec<f64>,
    /// Weight of the first `a` relays of the diagonal.
    diagonal: Vec<f64>,
}

impl RelayTable {
    pub(super) fn new(weights: &Weights) -> Self {
        let cells = weights.cells();
        let mut triangle: Vec<f64> = Vec::with_capacity(cells * (cells + 1) / 2);
        for a in 1..=cells {
            // Row a - 1 summed from the diagonal (left out) to the left, on top of the rows below.
            let row = triangle.len();
            triangle.resize(row + a, 0.0);
            let mut sum = 0.0;
            for b in (0..a - 1).rev() {
                sum += weights.at(a - 1, b);
                let below = triangle[row - (a - 1) + b];
                triangle[row + b] = below + sum;
            }
        }
        let mut diagonal = vec![0.0];
        for i in 0..cells {
            diagonal.push(diagonal[i] + weights.at(i, i));
        }
        let middles = weights.middles.clone();
        Self { lower: weights.lower, per_width: 1.0 / weights.width, middles, triangle, diagonal }
    }
}

impl Everett for RelayTable {
    type Level = usize;

    fn limits(&self) -> (usize, usize) {
        (0, self.middles.len())
    }

    #[inline]
    fn levels(&self, u: f64) -> (usize, usize) {
        // The quotient may be off by rounding; the thresholds themselves decide, as in the grid.
        let guess = (u - self.lower) * self.per_width + 0.5;
        let mut risen = (guess as usize).min(self.middles.len());
        while self.middles.get(risen).is_some_and(|middle| *middle <= u) {
            risen += 1;
        }
        while risen > 0 && self.middles[risen - 1] > u {
            risen -= 1;
        }
        (risen, if risen > 0 && self.middles[risen - 1] == u { risen - 1 } else { risen })
    }

    #[inline]
    fn triangle(&self, a: usize, b: usize) -> f64 {
        if b < a { self.triangle[a * (a - 1) / 2 + b] } else { 0.0 }
    }

    #[inline]
    fn without_memory(&self, risen: usize) -> f64 {
        self.diagonal[risen]
    }

    fn demagnetised(&self) -> Vec<(usize, usize)> {
        let cells = self.middles.len();
        (1..=cells / 2).map(|k| (cells - k, k)).collect()
    }
}

/// The Everett function of a density that is constant in each cell; a level is the input counted in cells.
#[derive(Debug, Clone)]
pub struct SmoothTable {
    weights: Weights,
    /// Weight of the cells (i, j) with `i < p`, `j >= q`, for `q <= p`, at `p(p + 1)/2 + q`.
    nodes: Vec<f64>,
}

impl SmoothTable {
    pub(super) fn new(weights: &Weights) -> Self {
        let cells = weights.cells();
        let mut nodes: Vec<f64> = vec![0.0];
        for p in 1..=cells {
            let row = nodes.len();
            nodes.resize(row + p + 1, 0.0);
            let mut sum = 0.0;
            for q in (0..p).rev() {
                sum += weights.at(p - 1, q);
                nodes[row + q] = nodes[row - p + q] + sum;
            }
        }
        Self { weights: weights.clone(), nodes }
    }

    fn node(&self, p: usize, q: usize) -> f64 {
        if q <= p { self.nodes[p * (p + 1) / 2 + q] } else { 0.0 }
    }

    /// The cell that holds a level, and how far the level lies in it.
    fn cell(&self, level: f64) -> (usize, f64) {
        let cell = (level as usize).min(self.weights.cells() - 1);
        (cell, level - cell as f64)
    }
}

impl Everett for SmoothTable {
    type Level = f64;

    fn limits(&self) -> (f64, f64) {
        (0.0, self.weights.cells() as f64)
    }

    fn levels(&self, u: f64) -> (f64, f64) {
        let level = ((u - self.weights.lower) / self.weights.width).max(0.0).min(self.weights.cells() as f64);
        (level, level)
    }

    fn triangle(&self, a: f64, b: f64) -> f64 {
        if b >= a {
            return 0.0;
        }
        let ((p, along), (q, across)) = (self.cell(a), self.cell(b));
        let corner = |i: usize| self.weights.at(i, i);
        if p == q {
            return corner(p) * (a - b).powi(2);
        }
        // Whole cells; the part of row p; the part of column q; and the part of the cell where the two meet.
        let left = 1.0 - across;
        let row = self.node(p + 1, q + 1) - self.node(p, q + 1) - corner(p);
        let column = self.node(p, q) - self.node(p, q + 1) - corner(q);
        self.node(p, q + 1)
            + along * row
            + along * along * corner(p)
            + left * column
            + left * left * corner(q)
            + along * left * self.weights.at(p, q)
    }

    fn without_memory(&self, _: f64) -> f64 {
        0.0
    }

    fn demagnetised(&self) -> Vec<(f64, f64)> {
        // Half a cell beyond the line on one side of each step and half a cell short on the other: the two cancel.
        let cells = self.weights.cells();
        (1..=cells / 2).map(|k| ((cells - k) as f64 + 0.5, k as f64)).collect()
    }
}
