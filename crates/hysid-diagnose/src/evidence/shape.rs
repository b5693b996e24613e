//! The shape of a spectrum on a logarithmic frequency axis: piecewise linear in the logarithms of frequency and power.
//!
//! Knots stand one or two octaves apart, or there is a single corner; heights are fitted by Whittle's likelihood to the lines of discrete cosine
//! transforms. Removing a shape divides the lines by its root: an orthogonal transform, a scaling, and back, so rows stay in order of time.
//! Fourier transforms would take the end of a recording and its beginning for neighbours: noise that wanders jumps there, the jump is a noise of all
//! frequencies, and no shape could be told from it.
//!
//! Reference: P. Whittle (1953); P. J. Brockwell and R. A. Davis, Time Series, section 10.8; for the lines, R. J. Clarke, IEE Proc. F 128 (1981) 359-360.

use std::f64::consts::LN_2;

use hysid_signal::{cosine_transform, inverse_cosine_transform};
use nalgebra::{DMatrix, DVector};

/// Standard deviation of the prior of a knot's log power about 0: what the simulation's own parameters have taken out of the residual
/// must not look like a noise of power zero.
const PRIOR_SD: f64 = 3.0;

/// The first line of a whole period, from which on shapes are fitted. What a half period would tell is what the mean would: a single line of any height is
/// nothing that a spectrum's shape may follow, a drift is an effect, and an offset is one.
pub(super) const FIRST: usize = 2;
/// Lines up to which the rise towards low frequency is measured, from the first of a whole period; the steepest counts.
const LAST: [usize; 2] = [8 * FIRST, 32 * FIRST];

/// The exponent by which a power falls with frequency from the first line of a whole period on, given its logarithm at each.
pub(super) fn rise(log_power: impl Fn(usize) -> f64) -> f64 {
    let slope = |last: usize| (log_power(FIRST) - log_power(last)) / ((last / FIRST) as f64).ln();
    LAST.into_iter().map(slope).fold(f64::NEG_INFINITY, f64::max)
}

/// Log power against log frequency.
#[derive(Debug, Clone, PartialEq)]
pub struct SpectralShape {
    /// Natural logarithm of the frequencies of the knots, in cycles a sample, ascending.
    knots: Vec<f64>,
    /// Natural logarithm of the power at the knots; 0 is the power of the autoregression's innovations.
    heights: Vec<f64>,
}

/// Frequency of line `k` of `n` samples, in cycles a sample; the mean counts as the first line.
pub(super) fn frequency(k: usize, n: usize) -> f64 {
    k.max(1) as f64 / (2 * n) as f64
}

/// Knots everywhere between the lowest frequency of `n` samples and the highest, one or two octaves apart.
pub(super) fn even_knots(n: usize) -> Vec<Vec<f64>> {
    let (low, high) = (frequency(FIRST, n).ln(), 0.5f64.ln());
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
pub(super) fn corners(n: usize) -> Vec<Vec<f64>> {
    let (low, high) = (frequency(FIRST, n).ln(), 0.5f64.ln());
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
    /// Natural logarithm of the power at line `k` of `n` samples. Below the first knot what rises goes on rising.
    pub(super) fn log_power(&self, k: usize, n: usize) -> f64 {
        let x = frequency(k, n).ln();
        let (i, w) = match (self.knots.as_slice(), self.heights.as_slice()) {
            (&[first, second, ..], &[low, high, ..]) if x < first && low > high => (0, (x - first) / (second - first)),
            _ => between(&self.knots, x),
        };
        let above = self.heights.get(i + 1).copied().unwrap_or(self.heights[i]);
        (1.0 - w) * self.heights[i] + w * above
    }

    /// Multiplies the lines of `x` by `exp(sign/2 log power)` in place.
    pub(super) fn scale(&self, x: &mut [f64], sign: f64) {
        let n = x.len();
        cosine_transform(x);
        for (k, line) in x.iter_mut().enumerate() {
            *line *= (0.5 * sign * self.log_power(k, n)).exp();
        }
        inverse_cosine_transform(x);
    }

    /// Whether it has a single corner from which it falls to both sides: no noise does, but the few lines below a low corner do by chance, and an offset
    /// would stand out of them.
    pub(super) fn is_peak(&self) -> bool {
        matches!(self.heights.as_slice(), &[low, corner, high] if low < corner && corner > high)
    }

    /// [`rise`] of the lowest lines of `n` samples.
    pub(super) fn rise(&self, n: usize) -> f64 {
        rise(|k| self.log_power(k, n))
    }

    /// Number of coefficients: heights, and the place of a single corner.
    pub(super) fn coefficients(&self) -> usize {
        self.heights.len() + usize::from(self.heights.len() == 3)
    }

    /// Half the logarithm of the determinant of `n` samples' covariance.
    pub(super) fn log_scale(&self, n: usize) -> f64 {
        (0..n).map(|k| 0.5 * self.log_power(k, n)).sum()
    }

    /// Fits heights at `knots` to the lines of several series: (log frequency, power, how many). Returns the shape and its gain in log
    /// likelihood over a flat spectrum of power 1.
    pub(super) fn fit(knots: Vec<f64>, lines: &[(f64, f64, f64)]) -> Option<(Self, f64)> {
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
