//! The noise of an output: an autoregression, and the shape that the spectrum of its innovations still has on a logarithmic frequency axis.
//!
//! An autoregression of order 16 resolves a sixteenth of the sampling frequency. Noise that rises towards low frequency (1/f, drift of a
//! sensor) and a slow mismatch in a recording that was sampled a hundred times faster both lie below that. Without the shape such a
//! residual would count as white, and a model that removes it would gain nothing in likelihood. The shape is piecewise linear in the
//! logarithms of frequency and power, with knots one or two octaves apart or a single corner, fitted by Whittle's likelihood; BIC decides
//! whether it is there.
//!
//! Whitening divides the discrete Fourier transform of the autoregression's innovations by the root of the shape: an orthogonal transform, a
//! scaling, and back. The rows stay in order of time. The residual's wrap from end to start is the approximation (the autoregression has
//! taken the steep part of the spectrum by then).
//!
//! Reference: P. Whittle (1953); P. J. Brockwell and R. A. Davis, Time Series, section 10.8.

use std::collections::BTreeMap;
use std::f64::consts::LN_2;

use hysid_signal::{fourier, inverse_fourier};
use nalgebra::{DMatrix, DVector};

use super::ar::{ArModel, fit_ar};
use super::projector::norm2;

/// Standard deviation of the prior of a knot's log power about 0: what the simulation's own parameters have taken out of the residual
/// must not look like a noise of power zero.
const PRIOR_SD: f64 = 3.0;
/// Orders up to which a short autoregression is tried with a corner, beside the one that BIC chooses without a shape.
const SHORT_ORDERS: [usize; 2] = [0, 2];
/// Bins of an octave that lines are gathered in.
const BINS: f64 = 24.0;
/// Fewest samples for a shape.
const SHORTEST: usize = 128;

/// Log power against log frequency.
#[derive(Debug, Clone, PartialEq)]
pub struct SpectralShape {
    /// Natural logarithm of the frequencies of the knots, in cycles a sample, ascending.
    knots: Vec<f64>,
    /// Natural logarithm of the power at the knots; 0 is the power of the autoregression's innovations.
    heights: Vec<f64>,
}

/// Line `k` of `n` samples as a logarithm of frequency; the mean counts as half the first line.
fn log_frequency(k: usize, n: usize) -> f64 {
    ((k as f64).max(0.5) / n as f64).ln()
}

/// How many real numbers line `k` of `n` samples stands for.
fn multiplicity(k: usize, n: usize) -> f64 {
    if k == 0 || 2 * k == n { 1.0 } else { 2.0 }
}

/// Knots everywhere between the lowest frequency of `n` samples and the highest, one or two octaves apart.
fn even_knots(n: usize) -> Vec<Vec<f64>> {
    let (low, high) = ((1.0 / n as f64).ln(), 0.5f64.ln());
    let even = |octaves: f64| {
        let count = ((high - low) / (octaves * LN_2)).round().max(1.0) as usize;
        (0..=count).map(|i| low + (high - low) * i as f64 / count as f64).collect()
    };
    vec![even(1.0), even(2.0)]
}

/// A single knot between the lowest frequency of `n` samples and the highest, at each octave.
///
/// Noise that rises below a corner (1/f, a random walk beside white noise) is so told in a few coefficients: were only the many on offer,
/// an effect with two would be a cheap way to say the same.
fn corners(n: usize) -> Vec<Vec<f64>> {
    let (low, high) = ((1.0 / n as f64).ln(), 0.5f64.ln());
    let last = ((high - low) / LN_2).floor() as usize;
    (2..last).map(|octave| vec![low, low + octave as f64 * LN_2, high]).collect()
}

/// The two knots around `x` and the weight of the upper one.
fn between(knots: &[f64], x: f64) -> (usize, f64) {
    let last = knots.len() - 1;
    if last == 0 || x <= knots[0] {
        return (0, 0.0);
    }
    if x >= knots[last] {
        return (last - 1, 1.0);
    }
    let upper = knots.partition_point(|k| *k <= x).clamp(1, last);
    (upper - 1, (x - knots[upper - 1]) / (knots[upper] - knots[upper - 1]))
}

impl SpectralShape {
    /// Natural logarithm of the power at line `k` of `n` samples.
    fn log_power(&self, k: usize, n: usize) -> f64 {
        let (i, w) = between(&self.knots, log_frequency(k, n));
        let above = self.heights.get(i + 1).copied().unwrap_or(self.heights[i]);
        (1.0 - w) * self.heights[i] + w * above
    }

    /// Multiplies the lines of `x` by `exp(sign/2 log power)` in place.
    fn scale(&self, x: &mut [f64], sign: f64) {
        let n = x.len();
        let mut lines = fourier(x);
        for (k, line) in lines.iter_mut().enumerate() {
            let factor = (0.5 * sign * self.log_power(k, n)).exp();
            line.0 *= factor;
            line.1 *= factor;
        }
        x.copy_from_slice(&inverse_fourier(&lines, n));
    }

    /// Number of coefficients: heights, and the place of a single corner.
    fn coefficients(&self) -> usize {
        self.heights.len() + usize::from(self.heights.len() == 3)
    }

    /// Half the logarithm of the determinant of `n` samples' covariance.
    fn log_scale(&self, n: usize) -> f64 {
        (0..=n / 2).map(|k| 0.5 * multiplicity(k, n) * self.log_power(k, n)).sum()
    }

    /// Fits heights at `knots` to the lines of several series: (log frequency, power, multiplicity). Returns the shape and its gain in log
    /// likelihood over a flat spectrum of power 1.
    fn fit(knots: Vec<f64>, lines: &[(f64, f64, f64)]) -> Option<(Self, f64)> {
        let m = knots.len();
        let at: Vec<(usize, f64)> = lines.iter().map(|l| between(&knots, l.0)).collect();
        let eta = |heights: &[f64], (i, w): (usize, f64)| {
            (1.0 - w) * heights[i] + w * heights.get(i + 1).copied().unwrap_or(heights[i])
        };
        let cost = |heights: &[f64]| -> f64 {
            let whittle: f64 = lines
                .iter()
                .zip(&at)
                .map(|(l, a)| {
                    let e = eta(heights, *a);
                    0.5 * l.2 * (e + l.1 * (-e).exp())
                })
                .sum();
            whittle + heights.iter().map(|h| 0.5 * (h / PRIOR_SD).powi(2)).sum::<f64>()
        };
        let mut heights = vec![0.0; m];
        let flat = cost(&heights);
        let mut best = flat;
        for _ in 0..40 {
            // Fisher scoring.
            let mut information = DMatrix::from_diagonal_element(m, m, PRIOR_SD.powi(-2));
            let mut gradient = DVector::from_iterator(m, heights.iter().map(|h| -h / (PRIOR_SD * PRIOR_SD)));
            for (l, &(i, w)) in lines.iter().zip(&at) {
                let e = eta(&heights, (i, w));
                let slope = 0.5 * l.2 * (l.1 * (-e).exp() - 1.0);
                let j = (i + 1).min(m - 1);
                for (a, wa) in [(i, 1.0 - w), (j, w)] {
                    gradient[a] += slope * wa;
                    for (b, wb) in [(i, 1.0 - w), (j, w)] {
                        information[(a, b)] += 0.5 * l.2 * wa * wb;
                    }
                }
            }
            let step = information.cholesky()?.solve(&gradient);
            let mut share = 1.0;
            let mut moved = false;
            while share > 1e-3 {
                let trial: Vec<f64> =
                    heights.iter().zip(step.iter()).map(|(h, s)| h + share * s.clamp(-3.0, 3.0)).collect();
                let c = cost(&trial);
                if c < best {
                    moved = best - c > 1e-6;
                    best = c;
                    heights = trial;
                    break;
                }
                share *= 0.5;
            }
            if !moved {
                break;
            }
        }
        Some((Self { knots, heights }, flat - best))
    }
}

impl ArModel {
    /// With the shape that the spectrum of its innovations has, where BIC asks for one.
    fn shaped(self, stretches: &[&[f64]], shapes: &[Vec<f64>]) -> NoiseModel {
        let total: usize = stretches.iter().map(|s| s.len()).sum();
        let mut bins: BTreeMap<i64, (f64, f64, f64)> = BTreeMap::new();
        for s in stretches.iter().filter(|s| s.len() >= SHORTEST / 2) {
            let n = s.len();
            let mut w = vec![0.0; n];
            self.whiten(s, &mut w);
            // The mean is left out: a single line of any height is nothing that a spectrum's shape may follow, and an offset is an effect.
            for (k, (re, im)) in fourier(&w).iter().enumerate().skip(1) {
                let power = (re * re + im * im) / n as f64;
                if !power.is_finite() {
                    return NoiseModel { ar: self, shape: None };
                }
                // Neighbours between which no shape bends are one line of higher multiplicity.
                let (x, m) = (log_frequency(k, n), multiplicity(k, n));
                let bin = bins.entry((x * BINS / LN_2).floor() as i64).or_default();
                *bin = (bin.0 + m * x, bin.1 + m * power, bin.2 + m);
            }
        }
        let lines: Vec<(f64, f64, f64)> = bins.into_values().map(|(x, p, m)| (x / m, p / m, m)).collect();
        let price = 0.5 * (total as f64).ln();
        let mut best: (Option<SpectralShape>, f64) = (None, 0.0);
        for knots in shapes {
            let Some((shape, gain)) = SpectralShape::fit(knots.clone(), &lines) else { continue };
            let gain = gain - price * shape.coefficients() as f64;
            if gain > best.1 {
                best = (Some(shape), gain);
            }
        }
        NoiseModel { ar: self, shape: best.0 }
    }
}

/// The noise of one output.
#[derive(Debug, Clone, PartialEq)]
pub struct NoiseModel {
    ar: ArModel,
    shape: Option<SpectralShape>,
}

impl NoiseModel {
    /// White noise of this standard deviation.
    pub fn white(sigma: f64) -> Self {
        Self { ar: ArModel::white(sigma), shape: None }
    }

    /// The noise of these stretches of one residual: an autoregression up to `max_order` (0: white) and the shape where BIC asks for it.
    ///
    /// A short autoregression with a corner may say in few coefficients what a long one says in many, so both are tried.
    pub fn fit(stretches: &[&[f64]], max_order: usize) -> Self {
        let longest = stretches.iter().map(|s| s.len()).max().unwrap_or(0);
        let whole = Self { ar: fit_ar(stretches, max_order), shape: None };
        if max_order == 0 || longest < SHORTEST {
            return whole;
        }
        let bent = corners(longest);
        let mut best = whole.ar.shaped(stretches, &[even_knots(longest), bent.clone()].concat());
        let (mut most, mut seen) = (best.score(stretches), vec![best.order()]);
        for order in SHORT_ORDERS {
            let short = fit_ar(stretches, order);
            if !seen.contains(&short.order()) {
                seen.push(short.order());
                let shaped = short.shaped(stretches, &bent);
                let score = shaped.score(stretches);
                if score > most {
                    (best, most) = (shaped, score);
                }
            }
        }
        best
    }

    /// Log likelihood of these stretches less half of `ln n` for each coefficient.
    fn score(&self, stretches: &[&[f64]]) -> f64 {
        let total: usize = stretches.iter().map(|s| s.len()).sum();
        let likelihood: f64 = stretches
            .iter()
            .map(|s| {
                let mut w = vec![0.0; s.len()];
                self.whiten(s, &mut w);
                -0.5 * norm2(&w) - self.log_scale(s.len())
            })
            .sum();
        likelihood - 0.5 * self.coefficients() as f64 * (total.max(2) as f64).ln()
    }

    /// Number of coefficients beyond the scale.
    pub fn coefficients(&self) -> usize {
        self.ar.order() + self.shape.as_ref().map_or(0, SpectralShape::coefficients)
    }

    /// Order of the autoregression.
    pub fn order(&self) -> usize {
        self.ar.order()
    }

    /// Standard deviation of the autoregression's innovations.
    pub fn innovation(&self) -> f64 {
        self.ar.innovation()
    }

    /// Standard deviation of the noise itself.
    pub fn noise_rms(&self) -> f64 {
        self.ar.noise_rms()
    }

    /// Whitens one contiguous stretch into `out` (same length): unit variance where the model holds.
    pub fn whiten(&self, e: &[f64], out: &mut [f64]) {
        self.ar.whiten(e, out);
        if let Some(shape) = &self.shape {
            shape.scale(out, -1.0);
        }
    }

    /// Colours unit white noise in place: the inverse of [`NoiseModel::whiten`].
    pub fn colour(&self, w: &mut [f64]) {
        if let Some(shape) = &self.shape {
            shape.scale(w, 1.0);
        }
        self.ar.colour(w);
    }

    /// Logarithm of the determinant of the transformation of `n` samples from white: their share of a log likelihood.
    pub fn log_scale(&self, n: usize) -> f64 {
        n as f64 * self.innovation().ln() + self.shape.as_ref().map_or(0.0, |s| s.log_scale(n))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evidence::norm2;
    use rand_distr::{Distribution, StandardNormal};

    fn white(n: usize, seed: u64) -> Vec<f64> {
        let mut rng = crate::random::generator(seed, 7);
        (0..n).map(|_| StandardNormal.sample(&mut rng)).collect()
    }

    /// Noise whose power goes as one over frequency, by shaping the lines of white noise.
    fn pink(n: usize, seed: u64) -> Vec<f64> {
        let mut lines = fourier(&white(n, seed));
        for (k, l) in lines.iter_mut().enumerate() {
            let a = 1.0 / (k.max(1) as f64 / n as f64).sqrt();
            *l = (l.0 * a, l.1 * a);
        }
        inverse_fourier(&lines, n)
    }

    /// Power of the lowest lines of a whitened series over that of all.
    fn lowest(m: &NoiseModel, e: &[f64]) -> f64 {
        let mut w = vec![0.0; e.len()];
        m.whiten(e, &mut w);
        let power: Vec<f64> = fourier(&w).iter().map(|(re, im)| (re * re + im * im) / e.len() as f64).collect();
        power[1..20].iter().sum::<f64>() / 19.0
    }

    #[test]
    fn one_over_f_noise_is_white_down_to_the_lowest_lines() {
        for seed in 0..5 {
            let e = pink(4000, seed);
            let low = lowest(&NoiseModel::fit(&[&e], 16), &e);
            assert!((0.5..1.8).contains(&low), "{low}");
        }
    }

    #[test]
    fn white_and_autoregressive_noise_need_no_shape() {
        let mut e = white(3000, 3);
        assert_eq!(NoiseModel::fit(&[&e], 16).coefficients(), 0);
        for n in 1..e.len() {
            e[n] += 0.9 * e[n - 1];
        }
        assert!(NoiseModel::fit(&[&e], 16).shape.is_none());
    }

    #[test]
    fn whitening_and_colouring_are_inverse_and_the_determinant_is_that_of_the_map() {
        let m = NoiseModel::fit(&[&pink(4000, 1)], 2);
        assert!(m.shape.is_some());
        let e = pink(600, 2);
        let mut w = vec![0.0; 600];
        m.whiten(&e, &mut w);
        m.colour(&mut w);
        assert!(e.iter().zip(&w).all(|(a, b)| (a - b).abs() < 1e-9 * (1.0 + a.abs())));
        // The shape's determinant, column by column, on a short stretch.
        let (n, shape) = (41, m.shape.unwrap());
        let columns: Vec<f64> = (0..n)
            .flat_map(|i| {
                let mut unit = vec![0.0; n];
                unit[i] = 1.0;
                shape.scale(&mut unit, 1.0);
                unit
            })
            .collect();
        let log = DMatrix::from_column_slice(n, n, &columns).lu().determinant().abs().ln();
        assert!((log - shape.log_scale(n)).abs() < 1e-9, "{log} {}", shape.log_scale(n));
    }

    #[test]
    fn a_slow_mismatch_in_a_fast_recording_costs_likelihood() {
        // Sensor noise with and without a slow random wander, sampled far faster than it moves: the model without it must gain.
        let n = 8000;
        let e: Vec<f64> = white(n, 5);
        let mut slow = vec![0.0; n];
        for k in 1..12 {
            let phase = 1.7 * (k * k) as f64;
            for (i, s) in slow.iter_mut().enumerate() {
                *s += 20.0 * (std::f64::consts::TAU * k as f64 * i as f64 / n as f64 + phase).sin();
            }
        }
        let with: Vec<f64> = e.iter().zip(&slow).map(|(e, s)| e + s).collect();
        let likelihood = |e: &[f64]| {
            let m = NoiseModel::fit(&[e], 16);
            let mut w = vec![0.0; n];
            m.whiten(e, &mut w);
            -0.5 * norm2(&w) - m.log_scale(n)
        };
        assert!(likelihood(&e) > likelihood(&with) + 50.0, "{} {}", likelihood(&e), likelihood(&with));
    }
}
