//! The noise of an output: an autoregression with the shape that the spectrum of its innovations still has on a logarithmic frequency axis, or
//! an unknown force that passes through the plant. Where it rises towards low frequency the mean holds what lies below the lowest line.
//!
//! An autoregression of order 16 resolves a sixteenth of the sampling frequency. Noise that rises towards low frequency (1/f, drift of a
//! sensor) and a slow mismatch in a recording that was sampled a hundred times faster both lie below that. Without the shape such a
//! residual would count as white, and a model that removes it would gain nothing in likelihood. BIC decides whether the shape is there, and
//! whether process noise ([`super::ForcePath`]) says the same in fewer coefficients.
//!
//! The shape is taken from the autoregression's innovations, in cosines: that their mirror image continues them is the approximation.

use std::collections::BTreeMap;
use std::f64::consts::LN_2;
use std::sync::Arc;

use hysid_signal::{Autoregression, cosine_transform};

use super::below::Below;
use super::driven::Driven;
use super::projector::norm2;
use super::response::{Course, ForcePath};
use super::shape::{FIRST, SpectralShape, corners, even_knots, frequency, rise};

/// Orders up to which a short autoregression is tried with a corner, beside the one that BIC chooses without a shape.
const SHORT_ORDERS: [usize; 2] = [0, 2];
/// Bins of an octave that lines are gathered in.
const BINS: f64 = 24.0;
/// Exponent beyond which a shape rises towards low frequency.
const RISING: f64 = 0.3;
/// Exponent beyond which a shape falls towards low frequency as no noise does: what was taken out of a residual leaves such a hole.
const HOLE: f64 = 0.5;
/// Fewest samples for a shape or for process noise.
const SHORTEST: usize = 128;

/// The noise of one output.
#[derive(Debug, Clone, PartialEq)]
pub struct NoiseModel {
    kind: Kind,
    below: Below,
}

#[derive(Debug, Clone, PartialEq)]
enum Kind {
    Shaped(Autoregression, Option<SpectralShape>),
    Driven(Driven),
}

impl NoiseModel {
    fn of(ar: Autoregression, shape: Option<SpectralShape>) -> Self {
        Self { kind: Kind::Shaped(ar, shape), below: Below::LEVEL }
    }

    /// White noise of this standard deviation.
    pub fn white(sigma: f64) -> Self {
        Self::of(Autoregression::white(sigma), None)
    }

    /// The noise of these stretches of one residual: an autoregression up to `max_order` (0: white) and the shape where BIC asks for it, or
    /// process noise by one of these ways where BIC prefers that.
    ///
    /// A short autoregression with a corner may say in few coefficients what a long one says in many, so both are tried.
    pub fn fit(stretches: &[&[f64]], max_order: usize, paths: &[ForcePath]) -> Self {
        Self::along(stretches, max_order, paths, |way| paths[way].course())
    }

    /// The same with courses of the ways, each by its place among them, that are made where they are asked for.
    pub fn along(
        stretches: &[&[f64]],
        max_order: usize,
        paths: &[ForcePath],
        course: impl Fn(usize) -> Option<Arc<Course>>,
    ) -> Self {
        let longest = stretches.iter().map(|s| s.len()).max().unwrap_or(0);
        if max_order == 0 || longest < SHORTEST {
            return Self::of(Autoregression::fit(stretches, max_order), None);
        }
        // The mean is an effect's, or what lies below the lowest line: no autoregression may follow it, which would hide any offset.
        let total: usize = stretches.iter().map(|s| s.len()).sum();
        let mean = stretches.iter().flat_map(|s| s.iter()).sum::<f64>() / total as f64;
        let centred: Vec<Vec<f64>> = stretches.iter().map(|s| s.iter().map(|e| e - mean).collect()).collect();
        let centred: Vec<&[f64]> = centred.iter().map(Vec::as_slice).collect();
        let ar = Autoregression::fit(&centred, max_order);
        let bent = corners(longest);
        let mut seen = vec![ar.order()];
        let mut best = Self::shaped(ar, &centred, &[even_knots(longest), bent.clone()].concat());
        let mut most = best.score(&centred);
        for order in SHORT_ORDERS {
            let short = Autoregression::fit(&centred, order);
            if !seen.contains(&short.order()) {
                seen.push(short.order());
                let shaped = Self::shaped(short, &centred, &bent);
                let score = shaped.score(&centred);
                if score > most {
                    (best, most) = (shaped, score);
                }
            }
        }
        best = best.with_below(longest);
        // What a force has moved by then is in the mean too, and most of it where the plant integrates.
        most = best.score(stretches);
        let price = 0.5 * (total as f64).ln();
        // What looks white to an autoregression may hide a little of a force; most often it does not, and two looks tell.
        let white = best.coefficients() == 0;
        for (way, path) in paths.iter().enumerate() {
            if white && !Driven::hinted(path, stretches, most) {
                continue;
            }
            let Some((driven, likelihood)) = Driven::fit(path, || course(way), stretches, price, most) else {
                continue;
            };
            let score = likelihood - price * driven.coefficients() as f64;
            if score > most {
                let driven = Self { kind: Kind::Driven(driven), below: Below::LEVEL };
                (best, most) = (driven.with_below(longest), score);
            }
        }
        best
    }

    /// The autoregression with the shape that the spectrum of its innovations has, where BIC asks for one.
    fn shaped(ar: Autoregression, stretches: &[&[f64]], shapes: &[Vec<f64>]) -> Self {
        let total: usize = stretches.iter().map(|s| s.len()).sum();
        let mut bins: BTreeMap<i64, (f64, f64, f64)> = BTreeMap::new();
        for s in stretches.iter().filter(|s| s.len() >= SHORTEST / 2) {
            let n = s.len();
            let mut w = vec![0.0; n];
            ar.whiten(s, &mut w);
            cosine_transform(&mut w);
            for (k, line) in w.iter().enumerate().skip(FIRST) {
                let power = line * line;
                if !power.is_finite() {
                    return Self::of(ar, None);
                }
                // Neighbours between which no shape bends are one.
                let x = frequency(k, n).ln();
                let bin = bins.entry((x * BINS / LN_2).floor() as i64).or_default();
                *bin = (bin.0 + x, bin.1 + power, bin.2 + 1.0);
            }
        }
        let lines: Vec<(f64, f64, f64)> = bins.into_values().map(|(x, p, m)| (x / m, p / m, m)).collect();
        let longest = stretches.iter().map(|s| s.len()).max().unwrap_or(0);
        let price = 0.5 * (total as f64).ln();
        let mut best: (Option<SpectralShape>, f64) = (None, 0.0);
        for knots in shapes {
            let Some((shape, gain)) = SpectralShape::fit(knots.clone(), &lines) else { continue };
            let gain = gain - price * shape.coefficients() as f64;
            if gain > best.1 && shape.rise(longest) > -HOLE && !shape.is_peak() {
                best = (Some(shape), gain);
            }
        }
        Self::of(ar, best.0)
    }

    /// With what lies below the lowest line of `n` samples in the mean.
    fn with_below(self, n: usize) -> Self {
        Self { below: Below::rising(self.exponent(n)), ..self }
    }

    /// The exponent by which the power goes on rising below the lowest line of `n` samples.
    fn exponent(&self, n: usize) -> f64 {
        // Whatever passes through the plant is known by its way down to the plant's corner, and 1/f noise is easily taken for it.
        let Kind::Shaped(ar, shape) = &self.kind else { return 1.0 };
        let rise = rise(|k| ar.log_power(frequency(k, n)) + shape.as_ref().map_or(0.0, |s| s.log_power(k, n)));
        // Where a shape is needed for the lowest lines it is 1/f noise at least, whatever the few lines say of its slope. An autoregression is
        // flat below its reach, whatever the noise does there.
        let slow =
            if shape.is_some() { rise > RISING } else { ar.log_power(frequency(FIRST, n)) - ar.log_power(0.25) > LN_2 };
        if slow { rise.max(1.0) } else { rise }
    }

    /// Log likelihood of these stretches less half of `ln n` for each coefficient.
    fn score(&self, stretches: &[&[f64]]) -> f64 {
        let total: usize = stretches.iter().map(|s| s.len()).sum();
        let likelihood: f64 = stretches
            .iter()
            .enumerate()
            .map(|(run, s)| {
                let mut w = vec![0.0; s.len()];
                self.whiten(run, s, &mut w);
                -0.5 * norm2(&w) - self.log_scale(run, s.len())
            })
            .sum();
        likelihood - 0.5 * self.coefficients() as f64 * (total.max(2) as f64).ln()
    }

    /// Number of coefficients beyond the scale.
    pub fn coefficients(&self) -> usize {
        match &self.kind {
            Kind::Shaped(ar, shape) => ar.order() + shape.as_ref().map_or(0, SpectralShape::coefficients),
            Kind::Driven(driven) => driven.coefficients(),
        }
    }

    /// Order of the autoregression, or of the filter; 0 for white noise.
    pub fn order(&self) -> usize {
        match &self.kind {
            Kind::Shaped(ar, _) => ar.order(),
            Kind::Driven(driven) => driven.order(),
        }
    }

    /// Whether it is that of a force through the plant.
    pub fn is_driven(&self) -> bool {
        self.driven().is_some()
    }

    /// The force through the plant whose noise it is.
    pub(super) fn driven(&self) -> Option<&Driven> {
        match &self.kind {
            Kind::Driven(driven) => Some(driven),
            Kind::Shaped(..) => None,
        }
    }

    /// The state in whose derivative a force enters that the machine answers differently along its motion; `None` where there is no such force.
    pub fn moving_from(&self) -> Option<usize> {
        self.driven().and_then(Driven::moving_from)
    }

    /// Standard deviation of the sensor's noise beside that of a force through the plant; `None` where there is no such force.
    pub fn beside_a_force(&self) -> Option<f64> {
        self.driven().map(Driven::sensor_rms)
    }

    /// The same for rows of another motion than that it was fitted to.
    pub fn elsewhere(&self) -> Self {
        match &self.kind {
            Kind::Driven(driven) => Self { kind: Kind::Driven(driven.elsewhere()), below: self.below },
            Kind::Shaped(..) => self.clone(),
        }
    }

    /// Whether it goes on below the lowest line as an equation says that holds at every frequency: a force through the plant, or an autoregression alone.
    pub fn is_known_below(&self) -> bool {
        matches!(self.kind, Kind::Driven(_) | Kind::Shaped(_, None))
    }

    /// Standard deviation of the innovations.
    pub fn innovation(&self) -> f64 {
        match &self.kind {
            Kind::Shaped(ar, _) => ar.innovation(),
            Kind::Driven(driven) => driven.innovation(),
        }
    }

    /// Standard deviation of the noise itself.
    pub fn noise_rms(&self) -> f64 {
        match &self.kind {
            Kind::Shaped(ar, _) => ar.noise_rms(),
            Kind::Driven(driven) => driven.noise_rms(),
        }
    }

    /// Whitens a run of contiguous rows into `out` (same length): unit variance where the model holds. Runs are counted as the stretches were that it was fitted to.
    pub fn whiten(&self, run: usize, e: &[f64], out: &mut [f64]) {
        match &self.kind {
            Kind::Shaped(ar, shape) => {
                ar.whiten(e, out);
                if let Some(shape) = shape {
                    shape.scale(out, -1.0);
                }
            }
            Kind::Driven(driven) => driven.whiten(run, e, out),
        }
        self.below.whiten(out);
    }

    /// The transpose of [`NoiseModel::whiten`], in place. A filter that does not change with time is transposed by running it backwards; only the start, where it is
    /// not settled, differs.
    pub fn transpose(&self, run: usize, v: &mut [f64]) {
        if let Kind::Driven(driven) = &self.kind
            && driven.is_along(run, v.len())
        {
            self.below.whiten(v);
            return driven.transpose(run, v);
        }
        v.reverse();
        let backwards = v.to_vec();
        self.whiten(run, &backwards, v);
        v.reverse();
    }

    /// Scales the mean of a residual down to what it would be if the noise did not rise below the lowest line.
    pub fn discount_mean(&self, e: &mut [f64]) {
        self.below.whiten(e);
    }

    /// Colours unit white noise in place: the inverse of [`NoiseModel::whiten`].
    pub fn colour(&self, run: usize, w: &mut [f64]) {
        self.below.colour(w);
        match &self.kind {
            Kind::Shaped(ar, shape) => {
                if let Some(shape) = shape {
                    shape.scale(w, 1.0);
                }
                ar.colour(w);
            }
            Kind::Driven(driven) => driven.colour(run, w),
        }
    }

    /// Logarithm of the determinant of the transformation of a run of `n` samples from white: their share of a log likelihood.
    pub fn log_scale(&self, run: usize, n: usize) -> f64 {
        let lines = match &self.kind {
            Kind::Shaped(ar, shape) => n as f64 * ar.innovation().ln() + shape.as_ref().map_or(0.0, |s| s.log_scale(n)),
            Kind::Driven(driven) => driven.log_scale(run, n),
        };
        lines + self.below.log_scale()
    }
}

#[cfg(test)]
mod tests;
