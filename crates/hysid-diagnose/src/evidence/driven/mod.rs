//! Process noise on one output: how much of it an unknown force makes beside the noise of the sensor, by the likelihood of the residual.
//!
//! One coefficient beyond the scale, the share of the force, and a further one where the force or the sensor's noise has a memory: its pole. A path through which
//! nothing finite passes gives no model.
//!
//! Reference: P. J. Brockwell and R. A. Davis, Time Series, section 12.2 (the likelihood by the innovations of the filter).

pub(super) mod fit;

use std::borrow::Cow;
use std::sync::Arc;

use super::response::{Colours, Filter, MovingFilter};

/// Process noise on one output.
#[derive(Debug, Clone, PartialEq)]
pub struct Driven {
    filter: Filter,
    /// That of the rows it was fitted to, where the machine answers a force differently along its motion. Elsewhere the mean way holds.
    moving: Option<Arc<MovingFilter>>,
    /// The state in whose derivative the force enters.
    pub(super) entry: usize,
    pub(super) colours: Colours,
    /// Variance of the force, over that of the innovations of the sensor's noise.
    pub(super) share: f64,
    /// Standard deviation of the innovations of the sensor's noise.
    pub(super) sigma: f64,
    /// Standard deviation of what it was fitted to.
    rms: f64,
}

impl Driven {
    /// Number of coefficients beyond the scale: the share of the force, colours.
    pub fn coefficients(&self) -> usize {
        self.colours.coefficients()
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
        self.sigma / (1.0 - self.colours.sensor * self.colours.sensor).sqrt()
    }

    /// Standard deviation of what it was fitted to.
    pub fn noise_rms(&self) -> f64 {
        self.rms
    }

    /// The state in whose derivative a force enters that the machine answers differently along its motion.
    pub fn moving_from(&self) -> Option<usize> {
        self.moving.as_ref().map(|_| self.entry)
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
        let e = differenced(e, self.colours.sensor);
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
            transpose_differenced(v, self.colours.sensor);
        }
    }

    /// Colours unit white noise in place.
    pub fn colour(&self, run: usize, w: &mut [f64]) {
        self.run(run, w.len(), |sigma, predicted, k| {
            let innovation = w[k] * sigma * self.sigma;
            w[k] = predicted + innovation;
            innovation
        });
        remembered(w, self.colours.sensor);
    }

    /// Logarithm of the determinant of the map from the white samples of a run of `n` rows.
    pub fn log_scale(&self, run: usize, n: usize) -> f64 {
        let own = self.moving(run, n).map_or_else(|| self.filter.log_scale(n), |moving| moving.log_scale(run));
        n as f64 * self.sigma.ln() + own - first_scale(self.colours.sensor).ln()
    }

    /// The same for rows of another motion: by the mean way.
    pub fn elsewhere(&self) -> Self {
        Self { moving: None, ..self.clone() }
    }
}

/// What the first sample of a first-order autoregression is scaled by, to be as large as its innovations.
pub(super) fn first_scale(pole: f64) -> f64 {
    (1.0 - pole * pole).sqrt()
}

/// A run less what a first-order autoregression of this pole tells from the sample before.
pub(super) fn differenced(e: &[f64], pole: f64) -> Cow<'_, [f64]> {
    if pole == 0.0 {
        return Cow::Borrowed(e);
    }
    let first = e.iter().take(1).map(|e| first_scale(pole) * e);
    Cow::Owned(first.chain(e.windows(2).map(|pair| pair[1] - pole * pair[0])).collect())
}

/// The transpose of [`differenced`], in place.
pub(super) fn transpose_differenced(v: &mut [f64], pole: f64) {
    if pole != 0.0 {
        let first = first_scale(pole);
        for k in 0..v.len() {
            let next = v.get(k + 1).copied().unwrap_or(0.0);
            v[k] = if k == 0 { first * v[0] } else { v[k] } - pole * next;
        }
    }
}

/// The inverse of [`differenced`], in place.
pub(super) fn remembered(w: &mut [f64], pole: f64) {
    if pole != 0.0 {
        let mut last = None;
        for w in w {
            *w = last.map_or_else(|| *w / first_scale(pole), |last: f64| *w + pole * last);
            last = Some(*w);
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::DVector;

    use super::super::response::samples::*;
    use super::*;
    use crate::evidence::below::Below;
    use crate::evidence::response::Moved;
    use crate::evidence::{ForcePath, NoiseModel, norm2};

    #[test]
    fn levels_of_sensor_and_force_come_back() {
        let path = oscillator();
        let size = 40.0;
        let e: Vec<Vec<f64>> =
            (0..2).map(|i| simulated(&path, &white(6000, 20 + i), size, 40 + i).into_iter().collect()).collect();
        let (m, _) = Driven::fit(&path, || None, &[&e[0], &e[1]], 4.7, f64::NEG_INFINITY).unwrap();
        assert_eq!(m.coefficients(), 1);
        assert!((m.sigma - 1.0).abs() < 0.03, "{}", m.sigma);
        // The variance of the force, from the filter's settled innovation: it grows with the share alone.
        let same = Filter::new(&path, Colours::WHITE, size * size, 6000).unwrap();
        assert!((m.innovation() / same.sigma(usize::MAX) - 1.0).abs() < 0.04);
    }

    #[test]
    fn the_innovations_are_the_cholesky_factor_of_the_covariance() {
        let (n, variance, sigma) = (40, 50.0, 1.7);
        let (white_both, force, sensor) =
            (Colours::WHITE, Colours { force: 0.75, sensor: 0.0 }, Colours { force: 0.0, sensor: 0.6 });
        let both = Colours { force: 0.75, sensor: 0.6 };
        let paths = [oscillator(), integrator(), still(), still().along(Some(Arc::new(swaying(n))))];
        for (path, colours) in paths.iter().flat_map(|path| [white_both, force, sensor, both].map(|c| (path, c))) {
            let e = white(n, 4);
            let filter = Filter::new(path, colours, variance, n).unwrap();
            let moving = path
                .course()
                .map(|course| Arc::new(Moved::new(&course, colours, &[&e]).unwrap().filter(variance).unwrap()));
            let noise = Driven { filter, moving, entry: path.entry(), colours, share: variance, sigma, rms: 1.0 };
            let factor = covariance(&answers(path, n), variance, colours).cholesky().unwrap().l() * sigma;
            let near = |a: &[f64], b: &DVector<f64>| a.iter().zip(b.iter()).all(|(a, b)| (a - b).abs() < 1e-6);
            let column = DVector::from_column_slice(&e);
            let mut w = vec![0.0; n];
            noise.whiten(0, &e, &mut w);
            assert!(near(&w, &factor.solve_lower_triangular(&column).unwrap()), "{path:?} {colours:?}");
            noise.colour(0, &mut w);
            assert!(near(&w, &column), "{path:?} {colours:?}");
            let log: f64 = factor.diagonal().iter().map(|d| d.ln()).sum();
            assert!((log - noise.log_scale(0, n)).abs() < 1e-6, "{log} {}", noise.log_scale(0, n));
            assert_eq!(noise.is_along(0, n), path.course().is_some());
            if noise.is_along(0, n) {
                w.copy_from_slice(&e);
                noise.transpose(0, &mut w);
                assert!(near(&w, &factor.tr_solve_lower_triangular(&column).unwrap()), "{colours:?}");
            }
            // Rows of another number, and of another motion, are those of the mean way.
            let mut other = vec![0.0; n - 1];
            noise.whiten(0, &e[1..], &mut other);
            let mut expected = other.clone();
            noise.elsewhere().whiten(0, &e[1..], &mut expected);
            assert_eq!(other, expected);
        }
    }

    #[test]
    fn the_memory_of_the_sensor_and_the_share_of_the_force_come_back() {
        let (path, pole) = (oscillator(), 0.7);
        let forces = white(6000, 7);
        let own = autoregressive(6000, pole, 8);
        // What the force makes, without the noise that is white.
        let (with, without) = (simulated(&path, &forces, 40.0, 9), simulated(&path, &vec![0.0; 6000], 0.0, 9));
        let e: Vec<f64> = with.iter().zip(&without).zip(&own).map(|((a, b), own)| a - b + own).collect();
        let m = NoiseModel::fit(&[&e], 16, std::slice::from_ref(&path));
        assert!(m.is_driven() && m.coefficients() == 2, "{}", m.coefficients());
        let (m, _) = Driven::fit(&path, || None, &[&e], 4.4, f64::NEG_INFINITY).unwrap();
        assert!((m.colours.sensor - pole).abs() < 0.05 && m.colours.force == 0.0, "{:?}", m.colours);
        assert!((m.sensor_rms() - 1.0).abs() < 0.05, "{}", m.sensor_rms());
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
