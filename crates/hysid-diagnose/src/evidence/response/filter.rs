//! The filter that whitens what a force makes beside white noise of the sensor.
//!
//! Whitening takes the innovations of the Kalman filter: the Cholesky factor of the covariance, exact for every length. The deviation from the
//! simulated course begins at zero, as the error of a simulation does whose initial states are known or fitted, and an integrator may carry it
//! anywhere; nothing wraps from the end to the start. A path that has no finite response gives no model.

use hysid_linalg::product_of_rows;
use nalgebra::{DMatrix, DVector};

use super::{Colours, ForcePath, dot_short};

/// Entries of a vector or of a row of a matrix that are worked on together.
const LANE: usize = 8;
type Lane = [f64; LANE];

/// Change of a gain below which the filter has settled.
pub(super) const SETTLED: f64 = 1e-8;

/// y += factor x.
fn add(factor: f64, x: &[Lane], y: &mut [Lane]) {
    y.as_flattened_mut().iter_mut().zip(x.as_flattened()).for_each(|(y, x)| *y += factor * x);
}

/// The rows of a matrix, each filled up with zeros to whole lanes.
fn padded(matrix: &DMatrix<f64>) -> Vec<Lane> {
    let lanes = matrix.ncols().div_ceil(LANE);
    let mut rows = vec![[0.0; LANE]; matrix.nrows() * lanes];
    for (i, row) in matrix.row_iter().enumerate() {
        row.iter().enumerate().for_each(|(j, x)| rows[i * lanes + j / LANE][j % LANE] = *x);
    }
    rows
}

/// By what the covariance of the state rises in the first row, as directions (in lanes) and the matrix between them.
///
/// A white force moves a state that was known. One with a memory has its variance from the start: it moves the others, and the two together, but its own
/// variance stays.
fn first_rise(path: &ForcePath, colours: Colours, variance: f64) -> (Vec<Vec<Lane>>, [[f64; 2]; 2]) {
    let rest = usize::from(colours.sensor != 0.0);
    let direction = |parts: DVector<f64>| {
        let whole = parts.len() + rest;
        let parts = parts.resize_vertically(whole, 0.0);
        padded(&DMatrix::from_row_slice(1, parts.len(), parts.as_slice()))
    };
    if colours.force == 0.0 {
        return (vec![direction(path.b.clone())], [[variance, 0.0], [0.0; 2]]);
    }
    let n = path.c.len();
    let moved = path.b.clone().push(colours.force);
    let own = DVector::zeros(n).push(colours.force);
    (vec![direction(moved), direction(own)], [[variance, 0.0], [0.0, -variance]])
}

/// The filter of a path and a share of the force, for noise of the sensor with unit variance.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::evidence) struct Filter {
    /// The matrix's columns, in lanes.
    columns: Vec<Lane>,
    c: Vec<f64>,
    /// Standard deviation of each row's innovation, until the filter has settled; the last one goes on.
    sigmas: Vec<f64>,
    /// What each row's innovation adds to the predicted state, in lanes.
    gains: Vec<Lane>,
}

impl Filter {
    /// For stretches of up to `rows` rows and a force of this variance; `None` where it is not finite.
    ///
    /// The covariance of the state never appears: from row to row it changes by a matrix of rank one (a white force) or two, whose factors follow a recursion
    /// of their own (M. Morf, G. S. Sidhu and T. Kailath, IEEE Transactions on Automatic Control 19 (1974), 315).
    pub(in crate::evidence) fn new(path: &ForcePath, colours: Colours, variance: f64, rows: usize) -> Option<Self> {
        let (a, c) = path.coloured(colours);
        let n = c.len();
        let lanes = n.div_ceil(LANE);
        let columns = padded(&a.transpose());
        let (mut rises, mut sizes) = first_rise(path, colours, variance);
        let (mut power, mut gain) = (1.0_f64, vec![[0.0; LANE]; lanes]);
        let (mut sigmas, mut gains): (Vec<f64>, Vec<Lane>) = (Vec::new(), Vec::new());
        let mut ahead = rises.clone();
        for _ in 0..rows.max(1) {
            let sigma = power.sqrt();
            gains.extend(gain.iter().map(|lane| lane.map(|g| g / power)));
            let (before, own) = gains.as_flattened().split_at((gains.len() - lanes) * LANE);
            if !sigma.is_finite() || own.iter().any(|g| !g.is_finite()) {
                return None;
            }
            let near = |x: f64, y: f64| (x - y).abs() <= SETTLED * (1e-6 + x.abs());
            let settled = sigmas.last().is_some_and(|last| {
                let last_gain = &before[before.len() - own.len()..];
                near(sigma, *last) && own.iter().zip(last_gain).all(|(x, y)| near(*x, *y))
            });
            sigmas.push(sigma);
            // The first rows of a chain of integrators see nothing of the force.
            if settled && sigmas.len() > 2 * n + 2 {
                break;
            }
            let seen = [0, 1].map(|i| rises.get(i).map_or(0.0, |rise| dot_short(c.as_slice(), rise.as_flattened())));
            let told = sizes.map(|row| row[0] * seen[0] + row[1] * seen[1]);
            let next = power + told[0] * seen[0] + told[1] * seen[1];
            for (i, row) in sizes.iter_mut().enumerate() {
                row.iter_mut().zip(told).for_each(|(size, other)| *size += told[i] * other / power);
            }
            for ((rise, ahead), told) in rises.iter().zip(&mut ahead).zip(told) {
                product_of_rows(rise.as_flattened(), &columns, lanes, ahead);
                add(told, ahead, &mut gain);
            }
            power = next;
            for ((rise, ahead), seen) in rises.iter_mut().zip(&mut ahead).zip(seen) {
                add(-seen / power, &gain, ahead);
                std::mem::swap(rise, ahead);
            }
        }
        Some(Self { columns, c: c.as_slice().to_vec(), sigmas, gains })
    }

    /// Standard deviation of the innovation of row `k`.
    pub(in crate::evidence) fn sigma(&self, k: usize) -> f64 {
        self.sigmas[k.min(self.sigmas.len() - 1)]
    }

    /// Runs through a stretch: `f(sigma, prediction, sample)` gives the innovation.
    pub(in crate::evidence) fn run(&self, len: usize, mut f: impl FnMut(f64, f64, usize) -> f64) {
        let lanes = self.c.len().div_ceil(LANE);
        let (mut x, mut next) = (vec![[0.0; LANE]; lanes], vec![[0.0; LANE]; lanes]);
        for k in 0..len {
            let row = k.min(self.sigmas.len() - 1);
            let innovation = f(self.sigmas[row], dot_short(&self.c, x.as_flattened()), k);
            product_of_rows(x.as_flattened(), &self.columns, lanes, &mut next);
            let gain = self.gains[row * lanes..(row + 1) * lanes].as_flattened();
            next.as_flattened_mut().iter_mut().zip(gain).for_each(|(next, gain)| *next += gain * innovation);
            std::mem::swap(&mut x, &mut next);
        }
    }

    /// Sum of squares of the scaled innovations of stretches, and of the logarithms of their standard deviations.
    pub(in crate::evidence) fn innovations(&self, stretches: &[Vec<f64>]) -> (f64, f64) {
        let mut squares = 0.0;
        for s in stretches {
            self.run(s.len(), |sigma, predicted, k| {
                let innovation = s[k] - predicted;
                squares += (innovation / sigma).powi(2);
                innovation
            });
        }
        (squares, stretches.iter().map(|s| self.log_scale(s.len())).sum())
    }

    /// Number of states.
    pub(in crate::evidence) fn order(&self) -> usize {
        self.c.len()
    }

    pub(in crate::evidence) fn log_scale(&self, n: usize) -> f64 {
        let first: f64 = self.sigmas.iter().take(n).map(|s| s.ln()).sum();
        first + n.saturating_sub(self.sigmas.len()) as f64 * self.sigma(usize::MAX).ln()
    }
}
