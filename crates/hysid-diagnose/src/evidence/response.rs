//! The way of an unknown force through the plant to an output, and the filter that whitens what it makes beside white noise of the sensor.
//!
//! `x[k+1] = A x[k] + B w[k]`, `y[k] = C x[k] + e[k]`: `w` is the force, held through a row's period, white or a first-order autoregression; `e` is white.
//! Far from the start the power spectrum is `sigma_e^2 + sigma_w^2 |G|^2` with the plant's own response `G`: a resonance is told in one
//! coefficient, where an autoregression needs four and knows the band's width only as well as the few samples in it tell.
//!
//! Whitening takes the innovations of the Kalman filter: the Cholesky factor of the covariance, exact for every length. The deviation from the
//! simulated course begins at zero, as the error of a simulation does whose initial states are known or fitted, and an integrator may carry it
//! anywhere; nothing wraps from the end to the start. A path that has no finite response gives no model.
//!
//! Reference: P. J. Brockwell and R. A. Davis, Time Series, section 12.2; P. Whittle (1953) for the spectrum.

use hysid_linalg::product_of_rows;
use nalgebra::{DMatrix, DVector};

/// Entries of a vector or of a row of a matrix that are worked on together.
const LANE: usize = 8;
type Lane = [f64; LANE];

/// Change of a gain below which the filter has settled.
const SETTLED: f64 = 1e-8;

/// The way from a force to one output, from row to row.
#[derive(Debug, Clone, PartialEq)]
pub struct ForcePath {
    a: DMatrix<f64>,
    b: DVector<f64>,
    c: DVector<f64>,
}

impl ForcePath {
    /// The way into the derivative of state `entry` of `dx/dt = a x`, out by `y = c x`, for a force that is held through `period_s`.
    ///
    /// `a` is by rows. `None` where the force does not reach the output, or nothing finite does.
    pub fn held(a: &[f64], entry: usize, c: &[f64], period_s: f64) -> Option<Self> {
        let n = c.len();
        if a.len() != n * n || entry >= n || !a.iter().chain(c).all(|x| x.is_finite()) {
            return None;
        }
        // States that the force does not move, or that do not move the output, would grow or drift unseen.
        let spread = |mut on: Vec<bool>, to: &dyn Fn(usize, usize) -> f64| {
            for _ in 0..n {
                for i in 0..n {
                    on[i] |= (0..n).any(|j| on[j] && to(i, j) != 0.0);
                }
            }
            on
        };
        let moved = spread((0..n).map(|i| i == entry).collect(), &|i, j| a[i * n + j]);
        let seen = spread(c.iter().map(|c| *c != 0.0).collect(), &|i, j| a[j * n + i]);
        let kept: Vec<usize> = (0..n).filter(|&i| moved[i] && seen[i]).collect();
        let place = kept.iter().position(|&i| i == entry)?;
        let m = kept.len();
        // The exponential of the equations with the force as a constant state.
        let whole = DMatrix::from_fn(m + 1, m + 1, |i, j| match (kept.get(i), kept.get(j)) {
            (Some(i), Some(j)) => a[i * n + j] * period_s,
            (Some(_), None) if i == place => period_s,
            _ => 0.0,
        })
        .exp();
        let path = Self {
            a: whole.view((0, 0), (m, m)).into_owned(),
            b: whole.view((0, m), (m, 1)).column(0).into_owned(),
            c: DVector::from_iterator(m, kept.iter().map(|&i| c[i])),
        };
        whole.iter().all(|x| x.is_finite()).then_some(path)
    }

    /// Matrix and output of the way with a force of this pole: one with a memory is a state of its own, the last.
    fn with_force(&self, pole: f64) -> (DMatrix<f64>, DVector<f64>) {
        let n = self.c.len();
        if pole == 0.0 {
            return (self.a.clone(), self.c.clone());
        }
        let mut a = self.a.clone().resize(n + 1, n + 1, 0.0);
        a.view_mut((0, n), (n, 1)).copy_from(&self.b);
        a[(n, n)] = pole;
        (a, self.c.clone().resize_vertically(n + 1, 0.0))
    }

    /// By what the covariance of the state rises in the first row, as directions (in lanes) and the matrix between them.
    ///
    /// A white force moves a state that was known. One with a memory has its variance from the start: it moves the others, and the two together, but its own
    /// variance stays.
    fn first_rise(&self, pole: f64, variance: f64) -> (Vec<Vec<Lane>>, [[f64; 2]; 2]) {
        let direction = |parts: DVector<f64>| padded(&DMatrix::from_row_slice(1, parts.len(), parts.as_slice()));
        if pole == 0.0 {
            return (vec![direction(self.b.clone())], [[variance, 0.0], [0.0; 2]]);
        }
        let n = self.c.len();
        let moved = self.b.clone().push(pole);
        let own = DVector::zeros(n).push(pole);
        (vec![direction(moved), direction(own)], [[variance, 0.0], [0.0, -variance]])
    }

    /// Variance of the output, `rows` rows from the start, for a force of unit variance that begins at zero.
    pub(super) fn variance(&self, pole: f64, rows: usize) -> f64 {
        let (mut force, mut x, mut sum) = ((1.0 - pole * pole).sqrt(), DVector::zeros(self.c.len()), 0.0);
        for _ in 0..rows {
            x = &self.a * &x + &self.b * force;
            force *= pole;
            sum += self.c.dot(&x).powi(2);
        }
        sum
    }
}

/// Inner product of a few numbers.
fn dot_short(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

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

/// The filter of a path and a share of the force, for noise of the sensor with unit variance.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Filter {
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
    pub(super) fn new(path: &ForcePath, pole: f64, variance: f64, rows: usize) -> Option<Self> {
        let (a, c) = path.with_force(pole);
        let n = c.len();
        let lanes = n.div_ceil(LANE);
        let columns = padded(&a.transpose());
        let (mut rises, mut sizes) = path.first_rise(pole, variance);
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
    pub(super) fn sigma(&self, k: usize) -> f64 {
        self.sigmas[k.min(self.sigmas.len() - 1)]
    }

    /// Runs through a stretch: `f(sigma, prediction, sample)` gives the innovation.
    pub(super) fn run(&self, len: usize, mut f: impl FnMut(f64, f64, usize) -> f64) {
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

    /// Number of states.
    pub(super) fn order(&self) -> usize {
        self.c.len()
    }

    pub(super) fn log_scale(&self, n: usize) -> f64 {
        let first: f64 = self.sigmas.iter().take(n).map(|s| s.ln()).sum();
        first + n.saturating_sub(self.sigmas.len()) as f64 * self.sigma(usize::MAX).ln()
    }
}

/// Plants and noises that the tests of process noise share.
#[cfg(test)]
pub(super) mod samples {
    use super::*;
    use rand_distr::{Distribution, StandardNormal};

    pub const PERIOD: f64 = 0.02;
    /// Natural frequency in rad/s, damping ratio.
    pub const PLANT: (f64, f64) = (12.0, 0.05);

    /// `x' = v`, `v' = -w^2 x - 2 z w v + force`, `y = x`, and a state that nothing sees.
    pub fn oscillator() -> ForcePath {
        let (w, z) = PLANT;
        let a = [0.0, 1.0, 0.0, -w * w, -2.0 * z * w, 0.0, 0.0, 1.0, 0.0];
        ForcePath::held(&a, 1, &[1.0, 0.0, 0.0], PERIOD).unwrap()
    }

    pub fn integrator() -> ForcePath {
        ForcePath::held(&[0.0, 1.0, 0.0, -0.5], 1, &[1.0, 0.0], PERIOD).unwrap()
    }

    pub fn white(n: usize, seed: u64) -> Vec<f64> {
        let mut rng = crate::random::generator(seed, 11);
        (0..n).map(|_| StandardNormal.sample(&mut rng)).collect()
    }

    /// Process noise as the path's own equations make it, beside white noise of unit variance.
    pub fn simulated(path: &ForcePath, force: &[f64], size: f64, seed: u64) -> Vec<f64> {
        let mut x = DVector::zeros(path.c.len());
        let sensor = white(force.len(), seed);
        force
            .iter()
            .zip(sensor)
            .map(|(w, e)| {
                let y = path.c.dot(&x) + e;
                x = &path.a * &x + &path.b * (size * w);
                y
            })
            .collect()
    }

    pub fn autoregressive(n: usize, pole: f64, seed: u64) -> Vec<f64> {
        let mut last = 0.0;
        white(n, seed)
            .into_iter()
            .map(|e| {
                last = pole * last + (1.0f64 - pole * pole).sqrt() * e;
                last
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::samples::*;
    use super::*;
    use hysid_signal::fourier;

    #[test]
    fn the_gain_of_a_resonance_is_that_of_its_closed_form() {
        // |G(s)|^2 = 1 / ((w^2 - f^2)^2 + (2 z w f)^2), from the lines of the impulse response; the hold falls off as a sinc.
        let path = oscillator();
        let n = 4096;
        let mut x = path.b.clone();
        let response: Vec<f64> = (0..n)
            .map(|_| {
                let y = path.c.dot(&x);
                x = &path.a * &x;
                y
            })
            .collect();
        let (w, z) = PLANT;
        for (k, (re, im)) in fourier(&response).iter().enumerate().skip(1).take(n / 8) {
            let f = std::f64::consts::TAU * k as f64 / (n as f64 * PERIOD);
            let half = 0.5 * f * PERIOD;
            let closed = (half.sin() / half).powi(2) / ((w * w - f * f).powi(2) + (2.0 * z * w * f).powi(2));
            let found = re * re + im * im;
            // Aliases of the held force are what is left above the resonance.
            assert!((found / closed - 1.0).abs() < 0.02 + 0.3 * (f / 160.0), "{k}: {found} {closed}");
        }
    }

    #[test]
    fn a_double_integrator_is_discretised_exactly() {
        let path = ForcePath::held(&[0.0, 1.0, 0.0, 0.0], 1, &[1.0, 0.0], 0.1).unwrap();
        assert!((path.b[0] - 0.005).abs() < 1e-15 && (path.b[1] - 0.1).abs() < 1e-15);
        assert!(ForcePath::held(&[0.0, 0.0, 0.0, 0.0], 1, &[1.0, 0.0], 0.1).is_none(), "does not reach the output");
        assert!(ForcePath::held(&[f64::NAN], 0, &[1.0], 0.1).is_none());
    }

    #[test]
    fn the_innovations_are_the_cholesky_factor_of_the_covariance() {
        // The covariance written down from the impulse response, for a white and a coloured force.
        for (path, pole) in [(oscillator(), 0.0), (integrator(), 0.0), (oscillator(), 0.75)] {
            let (n, share) = (40, 50.0);
            let (a, c) = path.with_force(pole);
            // What is added at each row, and what is there at the start.
            let (mut added, mut p) = (DMatrix::zeros(c.len(), c.len()), DMatrix::zeros(c.len(), c.len()));
            if pole == 0.0 {
                added = &path.b * path.b.transpose();
            } else {
                let last = c.len() - 1;
                (added[(last, last)], p[(last, last)]) = (1.0 - pole * pole, 1.0);
            }
            let covariance = {
                let mut all = DMatrix::identity(n, n);
                for i in 0..n {
                    let mut row = &p * &c;
                    for j in i..n {
                        let v = share * c.dot(&row);
                        all[(i, j)] += v;
                        if j > i {
                            all[(j, i)] += v;
                        }
                        row = &a * row;
                    }
                    p = &a * &p * a.transpose() + &added;
                }
                all
            };
            let factor = covariance.cholesky().unwrap();
            let e = white(n, 4);
            let expected = factor.l().solve_lower_triangular(&DVector::from_column_slice(&e)).unwrap();
            let filter = Filter::new(&path, pole, share, n).unwrap();
            let mut w = vec![0.0; n];
            filter.run(n, |sigma, predicted, k| {
                w[k] = (e[k] - predicted) / sigma;
                e[k] - predicted
            });
            assert!(w.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-6), "{pole}");
            let log: f64 = factor.l().diagonal().iter().map(|d| d.ln()).sum();
            assert!((log - filter.log_scale(n)).abs() < 1e-6, "{log} {}", filter.log_scale(n));
        }
    }
}
