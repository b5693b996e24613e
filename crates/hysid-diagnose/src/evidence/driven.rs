//! Process noise on one output: how much of it an unknown force makes beside the noise of the sensor, by the likelihood of the residual.
//!
//! One coefficient beyond the scale, the share of the force, and a second one where the force has a memory: its pole, out of a few. The share is searched over decades
//! by steps that shrink, from the best of the pole before; scales are profiled. A path through which nothing finite passes gives no model.
//!
//! Reference: P. J. Brockwell and R. A. Davis, Time Series, section 12.2 (the likelihood by the innovations of the filter).

use std::sync::Arc;

use super::projector::norm2;
use super::response::{Filter, ForcePath, Moved, MovingFilter};

/// Poles of a coloured force's autoregression: samples of memory double from one to the next.
const POLES: [f64; 4] = [0.5, 0.75, 0.88, 0.94];
/// Decades between the first guesses of the share of the force, and where the search ends.
const DECADES: (f64, f64) = (1.0, 0.25);
/// Log likelihood by which a white force may trail another model before its colour is not asked for.
const HOPELESS: f64 = 150.0;
/// Decades of the share of the force in the output's power that are searched.
const RANGE: (f64, f64) = (-3.0, 9.0);
/// Shares of a force, in the power of the sensor's noise, that are tried before any other where nothing else speaks for one.
const HINTS: [f64; 2] = [0.03, 0.5];
/// Rows of the longest stretch that a scale of the response is taken from.
const SCALE_ROWS: usize = 4000;

/// Process noise on one output.
#[derive(Debug, Clone, PartialEq)]
pub struct Driven {
    filter: Filter,
    /// That of the rows it was fitted to, where the machine answers a force differently along its motion. Elsewhere the mean way holds.
    moving: Option<Arc<MovingFilter>>,
    pole: f64,
    /// Standard deviation of the sensor's noise.
    sigma: f64,
    /// Standard deviation of what it was fitted to.
    rms: f64,
}

/// A point of the search: the decade of the force's share, the log likelihood there, and what comes with it.
type Point<T> = (f64, f64, T);

impl Driven {
    /// The process noise of these stretches of one residual by this way, with its log likelihood; colour of the force where it pays `price`,
    /// looked for where a white one comes near the likelihood `most` of another model.
    pub fn fit(path: &ForcePath, stretches: &[&[f64]], price: f64, most: f64) -> Option<(Self, f64)> {
        let white = Self::steady(path, 0.0, stretches, (0.0, DECADES.0))?;
        let mut coloured: Option<Point<Self>> = None;
        if white.1 >= most - HOPELESS {
            for pole in POLES {
                let from = coloured.as_ref().map_or(white.0, |c| c.0);
                let Some(found) = Self::steady(path, pole, stretches, (from, 0.5 * DECADES.0)) else { break };
                if coloured.as_ref().is_some_and(|c| found.1 < c.1) {
                    break;
                }
                coloured = Some(found);
            }
        }
        let chosen = coloured.filter(|c| c.1 - price > white.1).unwrap_or(white);
        let chosen = Self::along(path, &chosen, stretches).filter(|moving| moving.1 > chosen.1).unwrap_or(chosen);
        Some((chosen.2, chosen.1))
    }

    /// Whether a little of a white force is likelier than the likelihood `most` of a model without one.
    pub fn hinted(path: &ForcePath, stretches: &[&[f64]], most: f64) -> bool {
        Self::scale(path, 0.0, stretches).is_some_and(|(rows, unit)| {
            HINTS.into_iter().any(|share| {
                Self::with(path, 0.0, share / unit, rows, stretches).is_some_and(|(likelihood, _)| likelihood > most)
            })
        })
    }

    /// Rows of the longest stretch, and the output's variance there for a force of unit variance; `None` where nothing finite passes.
    fn scale(path: &ForcePath, pole: f64, stretches: &[&[f64]]) -> Option<(usize, f64)> {
        let rows = stretches.iter().map(|s| s.len()).max()?;
        let unit = path.variance(pole, rows.min(SCALE_ROWS));
        (unit > 0.0 && unit.is_finite()).then_some((rows, unit))
    }

    /// The best share of a force with this pole by the mean way, from a decade on by steps that shrink.
    fn steady(path: &ForcePath, pole: f64, stretches: &[&[f64]], from: (f64, f64)) -> Option<Point<Self>> {
        let (rows, unit) = Self::scale(path, pole, stretches)?;
        search(from, |t| Self::with(path, pole, 10f64.powf(t) / unit, rows, stretches))
    }

    /// The same by the way from row to row, where there is one, from the share by the mean way.
    fn along(path: &ForcePath, mean: &Point<Self>, stretches: &[&[f64]]) -> Option<Point<Self>> {
        let (pole, rms) = (mean.2.pole, mean.2.rms);
        let (rows, unit) = Self::scale(path, pole, stretches)?;
        let moved = Moved::new(path.course()?, pole, stretches)?;
        let (t, likelihood, sigma) = search((mean.0, 0.5 * DECADES.0), |t| {
            let (squares, log) = moved.innovations(10f64.powf(t) / unit, stretches)?;
            profiled(squares, log, stretches)
        })?;
        let variance = 10f64.powf(t) / unit;
        let (filter, moving) = (Filter::new(path, pole, variance, rows)?, moved.filter(variance)?);
        Some((t, likelihood, Self { filter, moving: Some(Arc::new(moving)), pole, sigma, rms }))
    }

    /// With this pole and variance of the force, for unit variance of the sensor's noise; the scale of both is that of the stretches.
    fn with(path: &ForcePath, pole: f64, variance: f64, rows: usize, stretches: &[&[f64]]) -> Option<(f64, Self)> {
        let filter = Filter::new(path, pole, variance, rows)?;
        let (mut squares, mut power, mut log) = (0.0, 0.0, 0.0);
        for s in stretches {
            filter.run(s.len(), |sigma, predicted, k| {
                let innovation = s[k] - predicted;
                squares += (innovation / sigma).powi(2);
                innovation
            });
            power += norm2(s);
            log += filter.log_scale(s.len());
        }
        let (likelihood, sigma) = profiled(squares, log, stretches)?;
        let rms = (power / total(stretches)).sqrt();
        Some((likelihood, Self { filter, moving: None, pole, sigma, rms }))
    }

    /// Number of coefficients beyond the scale: the share of the force, its colour.
    pub fn coefficients(&self) -> usize {
        if self.pole == 0.0 { 1 } else { 2 }
    }

    /// Number of states of the filter.
    pub fn order(&self) -> usize {
        self.filter.order()
    }

    /// Standard deviation of the innovations, far from the start.
    pub fn innovation(&self) -> f64 {
        self.sigma * self.moving.as_ref().map_or_else(|| self.filter.sigma(usize::MAX), |moving| moving.innovation())
    }

    /// Standard deviation of the sensor's noise, beside what the force makes.
    pub fn sensor_rms(&self) -> f64 {
        self.sigma
    }

    /// Standard deviation of what it was fitted to.
    pub fn noise_rms(&self) -> f64 {
        self.rms
    }

    /// The filter of a run of so many rows along its motion, where that is the one it was fitted to.
    fn moving(&self, run: usize, rows: usize) -> Option<&MovingFilter> {
        self.moving.as_deref().filter(|moving| moving.has(run, rows))
    }

    /// Runs through a run of so many rows: `f(sigma, prediction, row)` gives the innovation.
    fn run(&self, run: usize, rows: usize, f: impl FnMut(f64, f64, usize) -> f64) {
        match self.moving(run, rows) {
            Some(moving) => moving.run(run, f),
            None => self.filter.run(rows, f),
        }
    }

    /// Whitens a run of contiguous rows into `out` (same length).
    pub fn whiten(&self, run: usize, e: &[f64], out: &mut [f64]) {
        self.run(run, e.len(), |sigma, predicted, k| {
            out[k] = (e[k] - predicted) / (sigma * self.sigma);
            e[k] - predicted
        });
    }

    /// Whether a run of so many rows is whitened along its motion.
    pub fn is_along(&self, run: usize, rows: usize) -> bool {
        self.moving(run, rows).is_some()
    }

    /// The transpose of [`Driven::whiten`] for such a run, in place.
    pub fn transpose(&self, run: usize, v: &mut [f64]) {
        if let Some(moving) = self.moving(run, v.len()) {
            v.iter_mut().for_each(|x| *x /= self.sigma);
            moving.transpose(run, v);
        }
    }

    /// Colours unit white noise in place.
    pub fn colour(&self, run: usize, w: &mut [f64]) {
        self.run(run, w.len(), |sigma, predicted, k| {
            let innovation = w[k] * sigma * self.sigma;
            w[k] = predicted + innovation;
            innovation
        });
    }

    /// Logarithm of the determinant of the map from the white samples of a run of `n` rows.
    pub fn log_scale(&self, run: usize, n: usize) -> f64 {
        let own = self.moving(run, n).map_or_else(|| self.filter.log_scale(n), |moving| moving.log_scale(run));
        n as f64 * self.sigma.ln() + own
    }

    /// The same for rows of another motion: by the mean way.
    pub fn elsewhere(&self) -> Self {
        Self { moving: None, ..self.clone() }
    }
}

/// Rows of stretches, in all.
fn total(stretches: &[&[f64]]) -> f64 {
    stretches.iter().map(|s| s.len()).sum::<usize>() as f64
}

/// Log likelihood and standard deviation of the sensor's noise, from the innovations for a sensor of unit variance; `None` where they are not finite.
fn profiled(squares: f64, log: f64, stretches: &[&[f64]]) -> Option<(f64, f64)> {
    let rows = total(stretches);
    let variance = squares / rows;
    let finite = variance > 0.0 && variance.is_finite();
    finite.then(|| (-0.5 * rows * (1.0 + variance.ln()) - log, variance.sqrt()))
}

/// The decade at which a log likelihood is highest, from a first one on by steps that shrink; `at` gives it with what comes with it.
fn search<T>((start, step): (f64, f64), at: impl Fn(f64) -> Option<(f64, T)>) -> Option<Point<T>> {
    let at = |t: f64| at(t).map(|(likelihood, with)| (t, likelihood, with));
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

#[cfg(test)]
mod tests {
    use super::super::response::samples::*;
    use super::*;
    use crate::evidence::NoiseModel;
    use crate::evidence::below::Below;

    #[test]
    fn levels_of_sensor_and_force_come_back() {
        let path = oscillator();
        let size = 40.0;
        let e: Vec<Vec<f64>> =
            (0..2).map(|i| simulated(&path, &white(6000, 20 + i), size, 40 + i).into_iter().collect()).collect();
        let (m, _) = Driven::fit(&path, &[&e[0], &e[1]], 4.7, f64::NEG_INFINITY).unwrap();
        assert_eq!(m.coefficients(), 1);
        assert!((m.sigma - 1.0).abs() < 0.03, "{}", m.sigma);
        // The variance of the force, from the filter's settled innovation: it grows with the share alone.
        let same = Filter::new(&path, 0.0, size * size, 6000).unwrap();
        assert!((m.innovation() / same.sigma(usize::MAX) - 1.0).abs() < 0.04);
    }

    #[test]
    fn what_is_whitened_is_white_and_bic_prefers_the_plant() {
        // Ljung and Box over 20 lags: chi squared with 20 degrees, 1 in 1000 above 45.3.
        for (path, size, pole) in [(oscillator(), 20.0, 0.0), (integrator(), 30.0, 0.0), (oscillator(), 60.0, 0.9)] {
            let e = simulated(&path, &autoregressive(4000, pole, 1), size, 2);
            let m = NoiseModel::fit(&[&e], 16, std::slice::from_ref(&path));
            assert!(
                m.is_driven() && m.coefficients() == if pole == 0.0 { 1 } else { 2 },
                "{pole} {}",
                m.coefficients()
            );
            let mut w = vec![0.0; e.len()];
            m.whiten(0, &e, &mut w);
            let n = w.len() as f64;
            let portmanteau: f64 = (1..=20)
                .map(|lag| {
                    let r: f64 = w[lag..].iter().zip(&w).map(|(a, b)| a * b).sum::<f64>() / norm2(&w);
                    n * (n + 2.0) * r * r / (n - lag as f64)
                })
                .sum();
            assert!(portmanteau < 45.3, "{portmanteau}");
            // Of unit variance, the mean at its own size: it was taken down by what lies below the lowest line.
            let mut whole = w.clone();
            Below::rising(1.0).colour(&mut whole);
            assert!((norm2(&whole) / n - 1.0).abs() < 1e-9, "{}", norm2(&whole) / n);
            m.colour(0, &mut w);
            assert!(w.iter().zip(&e).all(|(a, b)| (a - b).abs() < 1e-9 * (1.0 + b.abs())));
        }
    }

    #[test]
    fn a_little_of_a_force_is_found_where_an_autoregression_sees_white_noise() {
        let path = integrator();
        for seed in 0..5 {
            let recorded = |size: f64| simulated(&path, &white(2000, 50 + seed), size, seed);
            let fit = |e: &[f64], paths: &[ForcePath]| NoiseModel::fit(&[e], 16, paths);
            assert!(!fit(&recorded(0.0), std::slice::from_ref(&path)).is_driven(), "{seed}");
            assert!(fit(&recorded(LITTLE), std::slice::from_ref(&path)).is_driven(), "{seed}");
            assert_eq!(fit(&recorded(LITTLE), &[]).coefficients(), 0, "{seed}");
        }
    }

    /// Size of a force through an integrator of which autoregressions see nothing in 2000 samples.
    const LITTLE: f64 = 0.12;

    #[test]
    fn other_noise_is_not_taken_for_process_noise() {
        let path = oscillator();
        assert!(!NoiseModel::fit(&[&white(4000, 8)], 16, std::slice::from_ref(&path)).is_driven());
        assert!(!NoiseModel::fit(&[&autoregressive(4000, 0.8, 9)], 16, &[path]).is_driven());
    }
}
