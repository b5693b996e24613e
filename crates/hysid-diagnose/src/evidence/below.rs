//! What a noise has below the lowest line of a recording: it shows as a mean.
//!
//! The mean of a recording is no line like the others. Where a noise falls with frequency as a power, and goes on so below the first line, all that
//! lies there is in the mean: under 1/f noise an offset several times as high as the first line is no effect. How far down it goes on no recording
//! tells; sensors and amplifiers do so over decades. An offset under white noise is judged as before.

/// Decades below the lowest line over which noise that rises towards low frequency is taken to go on rising.
const DECADES: f64 = 3.0;

/// How many times the power of the first line the mean of a noise holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Below {
    /// The root of that.
    root: f64,
}

impl Below {
    /// As much as the first line: nothing rises.
    pub(super) const LEVEL: Self = Self { root: 1.0 };

    /// Of a noise whose power falls with frequency by this exponent: the integral of `f^-s` over the decades below 1.
    pub(super) fn rising(exponent: f64) -> Self {
        const STEPS: usize = 32;
        let s = exponent.clamp(0.0, 2.0);
        let width = DECADES * std::f64::consts::LN_10 / STEPS as f64;
        let at = |i: usize| ((s - 1.0) * width * (i as f64 + 0.5)).exp();
        Self { root: (width * (0..STEPS).map(at).sum::<f64>()).max(1.0).sqrt() }
    }

    /// Takes the excess out of the mean of whitened samples.
    pub(super) fn whiten(self, w: &mut [f64]) {
        shift(w, 1.0 / self.root - 1.0);
    }

    /// The inverse of [`Below::whiten`].
    pub(super) fn colour(self, w: &mut [f64]) {
        shift(w, self.root - 1.0);
    }

    /// Its share of the logarithm of the determinant of a stretch.
    pub(super) fn log_scale(self) -> f64 {
        self.root.ln()
    }
}

/// Adds a multiple of the mean.
fn shift(w: &mut [f64], share: f64) {
    if share != 0.0 && !w.is_empty() {
        let more = share * w.iter().sum::<f64>() / w.len() as f64;
        w.iter_mut().for_each(|w| *w += more);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_excess_is_the_integral_in_closed_form() {
        let lowest = 10f64.powf(-DECADES);
        for (s, expected) in [(1.0, -lowest.ln()), (0.5, 2.0 * (1.0 - lowest.sqrt())), (2.0, 1.0 / lowest - 1.0)] {
            let root = Below::rising(s).root;
            assert!((root * root / expected - 1.0).abs() < 0.01, "{s}: {} {expected}", root * root);
        }
        assert_eq!(Below::rising(0.0), Below::LEVEL);
        assert_eq!(Below::rising(-1.0), Below::LEVEL);
    }
}
