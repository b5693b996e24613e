//! Process noise: an unknown force that reaches an output through the plant, beside white noise of the sensor.
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

use nalgebra::{DMatrix, DVector};

use super::projector::norm2;

/// Poles of the force's autoregression, white first: samples of memory double from one to the next.
const POLES: [f64; 5] = [0.0, 0.5, 0.75, 0.88, 0.94];
/// Decades between the first guesses of the share of the force, and where the search ends.
const DECADES: (f64, f64) = (1.0, 0.125);
/// Decades of the share of the force in the output's power that are searched.
const RANGE: (f64, f64) = (-3.0, 9.0);
/// Change of a gain below which the filter has settled.
const SETTLED: f64 = 1e-10;
/// Rows of the longest stretch that a scale of the response is taken from.
const SCALE_ROWS: usize = 4000;

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

    /// The way with a force of unit variance and this pole: matrix, output, covariance of what is added at each row and at the start.
    fn noise(&self, pole: f64) -> (DMatrix<f64>, DVector<f64>, DMatrix<f64>, DMatrix<f64>) {
        let n = self.c.len();
        if pole == 0.0 {
            return (self.a.clone(), self.c.clone(), &self.b * self.b.transpose(), DMatrix::zeros(n, n));
        }
        let mut a = self.a.clone().resize(n + 1, n + 1, 0.0);
        a.view_mut((0, n), (n, 1)).copy_from(&self.b);
        a[(n, n)] = pole;
        let mut added = DMatrix::zeros(n + 1, n + 1);
        let mut start = added.clone();
        added[(n, n)] = 1.0 - pole * pole;
        start[(n, n)] = 1.0;
        (a, self.c.clone().resize_vertically(n + 1, 0.0), added, start)
    }

    /// Variance of the output, `rows` rows from the start, for a force of unit variance.
    fn variance(&self, pole: f64, rows: usize) -> f64 {
        let (a, c, added, mut p) = self.noise(pole);
        let mut last = 0.0;
        for _ in 0..rows {
            p = &a * &p * a.transpose() + &added;
            let v = c.dot(&(&p * &c));
            if v > 0.0 && (v - last).abs() < 1e-6 * v {
                return v;
            }
            last = v;
        }
        last
    }
}

/// One row's part in the filter.
#[derive(Debug, Clone, PartialEq)]
struct Step {
    /// Standard deviation of the innovation.
    sigma: f64,
    /// What an innovation adds to the predicted state.
    gain: Vec<f64>,
}

/// The filter of a path and a share of the force, for noise of the sensor with unit variance.
#[derive(Debug, Clone, PartialEq)]
struct Filter {
    /// By rows.
    a: Vec<f64>,
    c: Vec<f64>,
    /// Until it has settled; the last one goes on.
    steps: Vec<Step>,
}

impl Filter {
    /// For stretches of up to `rows` rows and a force of this variance; `None` where it is not finite.
    fn new(path: &ForcePath, pole: f64, variance: f64, rows: usize) -> Option<Self> {
        let (a, c, added, start) = path.noise(pole);
        let (added, mut p) = (added * variance, start * variance);
        let mut steps: Vec<Step> = Vec::new();
        for _ in 0..rows.max(1) {
            let pc = &p * &c;
            let power = 1.0 + c.dot(&pc).max(0.0);
            let k = &pc / power;
            let gain = &a * &k;
            p = &a * (&p - &k * pc.transpose()) * a.transpose() + &added;
            p = 0.5 * (&p + p.transpose());
            let step = Step { sigma: power.sqrt(), gain: gain.as_slice().to_vec() };
            if !step.sigma.is_finite() || step.gain.iter().any(|g| !g.is_finite()) {
                return None;
            }
            let settled = steps.last().is_some_and(|last| {
                let near = |x: f64, y: f64| (x - y).abs() <= SETTLED * (1e-6 + x.abs());
                near(step.sigma, last.sigma) && step.gain.iter().zip(&last.gain).all(|(x, y)| near(*x, *y))
            });
            steps.push(step);
            // The first rows of a chain of integrators see nothing of the force.
            if settled && steps.len() > 2 * c.len() + 2 {
                break;
            }
        }
        Some(Self { a: a.transpose().as_slice().to_vec(), c: c.as_slice().to_vec(), steps })
    }

    fn step(&self, k: usize) -> &Step {
        &self.steps[k.min(self.steps.len() - 1)]
    }

    /// Runs through a stretch: `f(step, prediction, sample)` gives the innovation.
    fn run(&self, len: usize, mut f: impl FnMut(&Step, f64, usize) -> f64) {
        let n = self.c.len();
        let (mut x, mut next) = (vec![0.0; n], vec![0.0; n]);
        for k in 0..len {
            let step = self.step(k);
            let predicted: f64 = self.c.iter().zip(&x).map(|(c, x)| c * x).sum();
            let innovation = f(step, predicted, k);
            for ((next, row), gain) in next.iter_mut().zip(self.a.chunks_exact(n)).zip(&step.gain) {
                *next = row.iter().zip(&x).map(|(a, x)| a * x).sum::<f64>() + gain * innovation;
            }
            std::mem::swap(&mut x, &mut next);
        }
    }

    fn log_scale(&self, n: usize) -> f64 {
        (0..n).map(|k| self.step(k).sigma.ln()).sum()
    }
}

/// Process noise on one output.
#[derive(Debug, Clone, PartialEq)]
pub struct Driven {
    filter: Filter,
    /// Standard deviation of the sensor's noise.
    sigma: f64,
    /// Standard deviation of what it was fitted to.
    rms: f64,
    coefficients: usize,
}

/// A point of the search: the decade of the force's share, and what it comes to.
type Point = (f64, f64, Driven);

impl Driven {
    /// The process noise of these stretches of one residual by this way, with its log likelihood; colour of the force where it pays `price`.
    pub fn fit(path: &ForcePath, stretches: &[&[f64]], price: f64) -> Option<(Self, f64)> {
        let mut best: Option<Point> = None;
        for (i, pole) in POLES.into_iter().enumerate() {
            let from = best.as_ref().map_or((0.0, DECADES.0), |b| (b.0, 0.5 * DECADES.0));
            let Some(found) = Self::search(path, pole, stretches, from) else { break };
            let (first, bar) = (i == 1, best.as_ref().map_or(f64::NEG_INFINITY, |b| b.1));
            if found.1 < bar {
                // A long memory may help where a short one does not.
                if first {
                    continue;
                }
                break;
            }
            if i == 0 || found.1 > bar {
                best = Some(found);
            }
        }
        let coloured = best?;
        if coloured.2.coefficients == 1 {
            return Some((coloured.2, coloured.1));
        }
        let white = Self::search(path, 0.0, stretches, (coloured.0, DECADES.0))?;
        let chosen = if coloured.1 - price > white.1 { coloured } else { white };
        Some((chosen.2, chosen.1))
    }

    /// The best share of a force with this pole, from a decade on by steps that shrink.
    fn search(path: &ForcePath, pole: f64, stretches: &[&[f64]], (start, step): (f64, f64)) -> Option<Point> {
        let rows = stretches.iter().map(|s| s.len()).max()?;
        let unit = path.variance(pole, rows.min(SCALE_ROWS));
        if !(unit > 0.0 && unit.is_finite()) {
            return None;
        }
        let at = |t: f64| -> Option<Point> {
            let (driven, likelihood) = Self::with(path, pole, 10f64.powf(t) / unit, rows, stretches)?;
            Some((t, likelihood, driven))
        };
        let mut best = at(start)?;
        let mut step = step;
        // Likelihoods below and above the best, at the present step.
        let mut beside = [f64::NAN; 2];
        while step >= DECADES.1 {
            let mut moved = false;
            for (side, sign) in [-1.0, 1.0].into_iter().enumerate() {
                while (RANGE.0..=RANGE.1).contains(&(best.0 + sign * step)) {
                    let Some(trial) = at(best.0 + sign * step) else { break };
                    if trial.1 <= best.1 {
                        beside[side] = trial.1;
                        break;
                    }
                    beside[1 - side] = best.1;
                    best = trial;
                    moved = true;
                }
                if moved {
                    break;
                }
            }
            if step * 0.5 < DECADES.1 {
                break;
            }
            step *= 0.5;
        }
        // The vertex of the parabola through the last three.
        let bend = beside[0] + beside[1] - 2.0 * best.1;
        if bend < 0.0
            && let Some(vertex) = at(best.0 + step * (0.5 * (beside[0] - beside[1]) / bend).clamp(-0.5, 0.5))
            && vertex.1 > best.1
        {
            best = vertex;
        }
        Some(best)
    }

    /// With this pole and variance of the force, for unit variance of the sensor's noise; the scale of both is that of the stretches.
    fn with(path: &ForcePath, pole: f64, variance: f64, rows: usize, stretches: &[&[f64]]) -> Option<(Self, f64)> {
        let filter = Filter::new(path, pole, variance, rows)?;
        let total: usize = stretches.iter().map(|s| s.len()).sum();
        let (mut squares, mut power, mut log) = (0.0, 0.0, 0.0);
        for s in stretches {
            filter.run(s.len(), |step, predicted, k| {
                let innovation = s[k] - predicted;
                squares += (innovation / step.sigma).powi(2);
                innovation
            });
            power += norm2(s);
            log += filter.log_scale(s.len());
        }
        let variance = squares / total as f64;
        if !(variance > 0.0 && variance.is_finite()) {
            return None;
        }
        let likelihood = -0.5 * total as f64 * (1.0 + variance.ln()) - log;
        let rms = (power / total as f64).sqrt();
        let coefficients = if pole == 0.0 { 1 } else { 2 };
        Some((Self { filter, sigma: variance.sqrt(), rms, coefficients }, likelihood))
    }

    /// Number of coefficients beyond the scale: the share of the force, its colour.
    pub fn coefficients(&self) -> usize {
        self.coefficients
    }

    /// Number of states of the filter.
    pub fn order(&self) -> usize {
        self.filter.c.len()
    }

    /// Standard deviation of the innovations, far from the start.
    pub fn innovation(&self) -> f64 {
        self.sigma * self.filter.step(usize::MAX).sigma
    }

    /// Standard deviation of what it was fitted to.
    pub fn noise_rms(&self) -> f64 {
        self.rms
    }

    /// Whitens one contiguous stretch into `out` (same length).
    pub fn whiten(&self, e: &[f64], out: &mut [f64]) {
        self.filter.run(e.len(), |step, predicted, k| {
            out[k] = (e[k] - predicted) / (step.sigma * self.sigma);
            e[k] - predicted
        });
    }

    /// Colours unit white noise in place.
    pub fn colour(&self, w: &mut [f64]) {
        self.filter.run(w.len(), |step, predicted, k| {
            let innovation = w[k] * step.sigma * self.sigma;
            w[k] = predicted + innovation;
            innovation
        });
    }

    /// Logarithm of the determinant of the map from `n` white samples.
    pub fn log_scale(&self, n: usize) -> f64 {
        n as f64 * self.sigma.ln() + self.filter.log_scale(n)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evidence::NoiseModel;
    use hysid_signal::fourier;
    use rand_distr::{Distribution, StandardNormal};

    const PERIOD: f64 = 0.02;
    /// Natural frequency in rad/s, damping ratio, mass.
    const PLANT: (f64, f64, f64) = (12.0, 0.05, 2.0);

    /// `x' = v`, `v' = -w^2 x - 2 z w v + force`, `y = x`, and a state that nothing sees.
    fn oscillator() -> ForcePath {
        let (w, z, _) = PLANT;
        let a = [0.0, 1.0, 0.0, -w * w, -2.0 * z * w, 0.0, 0.0, 1.0, 0.0];
        ForcePath::held(&a, 1, &[1.0, 0.0, 0.0], PERIOD).unwrap()
    }

    fn integrator() -> ForcePath {
        ForcePath::held(&[0.0, 1.0, 0.0, -0.5], 1, &[1.0, 0.0], PERIOD).unwrap()
    }

    fn white(n: usize, seed: u64) -> Vec<f64> {
        let mut rng = crate::random::generator(seed, 11);
        (0..n).map(|_| StandardNormal.sample(&mut rng)).collect()
    }

    /// Process noise as the path's own equations make it, beside white noise of unit variance.
    fn simulated(path: &ForcePath, force: &[f64], size: f64, seed: u64) -> Vec<f64> {
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

    fn autoregressive(n: usize, pole: f64, seed: u64) -> Vec<f64> {
        let mut last = 0.0;
        white(n, seed)
            .into_iter()
            .map(|e| {
                last = pole * last + (1.0f64 - pole * pole).sqrt() * e;
                last
            })
            .collect()
    }

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
        let (w, z, _) = PLANT;
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
            let (a, c, added, start) = path.noise(pole);
            let mut p = start;
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
            let model = Driven { filter, sigma: 1.0, rms: 1.0, coefficients: 1 };
            let mut w = vec![0.0; n];
            model.whiten(&e, &mut w);
            assert!(w.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-6), "{pole}");
            let log: f64 = factor.l().diagonal().iter().map(|d| d.ln()).sum();
            assert!((log - model.log_scale(n)).abs() < 1e-6, "{log} {}", model.log_scale(n));
            model.colour(&mut w);
            assert!(w.iter().zip(&e).all(|(a, b)| (a - b).abs() < 1e-9));
        }
    }

    #[test]
    fn levels_of_sensor_and_force_come_back() {
        let path = oscillator();
        let size = 40.0;
        let e: Vec<Vec<f64>> =
            (0..2).map(|i| simulated(&path, &white(6000, 20 + i), size, 40 + i).into_iter().collect()).collect();
        let (m, _) = Driven::fit(&path, &[&e[0], &e[1]], 4.7).unwrap();
        assert_eq!(m.coefficients(), 1);
        assert!((m.sigma - 1.0).abs() < 0.03, "{}", m.sigma);
        // The variance of the force, from the filter's settled innovation: it grows with the share alone.
        let same = Filter::new(&path, 0.0, size * size, 6000).unwrap();
        assert!((m.innovation() / same.step(usize::MAX).sigma - 1.0).abs() < 0.04);
    }

    #[test]
    fn what_is_whitened_is_white_and_bic_prefers_the_plant() {
        // Ljung and Box over 20 lags: chi squared with 20 degrees, 1 in 1000 above 45.3.
        for (path, size, pole) in [(oscillator(), 20.0, 0.0), (integrator(), 30.0, 0.0), (oscillator(), 60.0, 0.9)] {
            let e = simulated(&path, &autoregressive(4000, pole, 1), size, 2);
            let m = NoiseModel::fit(&[&e], 16, std::slice::from_ref(&path));
            assert!(m.is_driven() && m.coefficients() == if pole == 0.0 { 1 } else { 2 }, "{pole} {}", m.coefficients());
            let mut w = vec![0.0; e.len()];
            m.whiten(&e, &mut w);
            let n = w.len() as f64;
            let portmanteau: f64 = (1..=20)
                .map(|lag| {
                    let r: f64 = w[lag..].iter().zip(&w).map(|(a, b)| a * b).sum::<f64>() / norm2(&w);
                    n * (n + 2.0) * r * r / (n - lag as f64)
                })
                .sum();
            assert!(portmanteau < 45.3, "{portmanteau}");
            assert!((norm2(&w) / n - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn other_noise_is_not_taken_for_process_noise() {
        let path = oscillator();
        assert!(!NoiseModel::fit(&[&white(4000, 8)], 16, std::slice::from_ref(&path)).is_driven());
        assert!(!NoiseModel::fit(&[&autoregressive(4000, 0.8, 9)], 16, &[path]).is_driven());
    }
}
