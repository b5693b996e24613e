//! Decimators: every L-th sample, plainly or after a low-pass without delay.

use crate::chebyshev;
use crate::kaiser;
use crate::zero_phase::{forward_backward, symmetric};

/// Which samples are kept, counted from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// 0, L, 2L, ...
    First,
    /// L-1, 2L-1, ...: counted from 1, the samples L, 2L, ... This is what the paper's tables were computed from.
    Lth,
    /// Those that make the last sample one of them, as MATLAB's `decimate` does.
    LastKept,
    /// This one (below L) and every L-th after it.
    Offset(usize),
}

impl Phase {
    /// The first sample kept of `samples` samples.
    pub fn offset(self, samples: usize, factor: usize) -> usize {
        match self {
            Self::First => 0,
            Self::Lth => factor - 1,
            Self::LastKept => samples.saturating_sub(1) % factor,
            Self::Offset(k) => k % factor,
        }
    }
}

/// How the sampling rate is reduced.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Decimator {
    /// Every L-th sample as it is. What lies above the new Nyquist frequency is aliased.
    Plain,
    /// A Chebyshev type I low-pass of order 8 (ripple 0.05 dB, cut-off at 0.8 of the new Nyquist frequency), run forward and backward with
    /// odd reflection of 24 samples at the ends: what MATLAB's `decimate` does by default.
    Chebyshev,
    /// A linear-phase Kaiser FIR low-pass, flat to 0.8 of the new Nyquist frequency and down by 60 dB from there on.
    Kaiser,
}

/// What can be wrong with a reduction.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DecimateError {
    /// The factor is 0.
    #[error("the factor is 0; it must be 1 (no reduction) or more")]
    Factor,
    /// Too few samples would remain.
    #[error("{samples} samples, every {factor}th of which is kept, leave {left}; at least {needed} are needed")]
    TooFewSamples {
        /// Samples given.
        samples: usize,
        /// The factor.
        factor: usize,
        /// Samples left.
        left: usize,
        /// Samples needed.
        needed: usize,
    },
    /// A named channel is not there.
    #[error("the recording has no channel `{0}`")]
    MissingChannel(String),
    /// A sample that is not finite inside what must be free of gaps.
    #[error("sample {0} is missing; give each stretch between gaps by itself")]
    Gap(usize),
}

/// Samples that the filter continues at either end before it runs forward and backward: three times the order.
const CHEBYSHEV_PAD: usize = 24;

impl Decimator {
    /// Every `factor`-th sample of `x`, a stretch without a gap. A factor of 1 returns `x` as it is.
    ///
    /// # Errors
    /// A factor of 0; no sample left; a sample that is not finite; for [`Self::Chebyshev`], 24 samples or fewer.
    pub fn apply(self, x: &[f64], factor: usize, phase: Phase) -> Result<Vec<f64>, DecimateError> {
        if factor == 0 {
            return Err(DecimateError::Factor);
        }
        if let Some(n) = x.iter().position(|v| !v.is_finite()) {
            return Err(DecimateError::Gap(n));
        }
        let offset = phase.offset(x.len(), factor);
        let left = x.len().saturating_sub(offset).div_ceil(factor);
        let too_few = |needed| DecimateError::TooFewSamples { samples: x.len(), factor, left, needed };
        if left == 0 {
            return Err(too_few(1));
        }
        let every = |x: &[f64]| x.iter().copied().skip(offset).step_by(factor).collect();
        match self {
            _ if factor == 1 => Ok(x.to_vec()),
            Self::Plain => Ok(every(x)),
            Self::Chebyshev if x.len() <= CHEBYSHEV_PAD => Err(too_few(CHEBYSHEV_PAD / factor + 1)),
            Self::Chebyshev => {
                let sections = chebyshev::low_pass(4, 0.05, 0.8 / factor as f64);
                Ok(every(&forward_backward(&sections, x, CHEBYSHEV_PAD)))
            }
            Self::Kaiser => Ok(symmetric(&kaiser::low_pass(factor), x, offset, factor)),
        }
    }

    /// Original samples at each end of a stretch whose values after the filter rest on invented ones beyond the end.
    ///
    /// For [`Self::Chebyshev`], whose memory has no end, the samples after which its slowest part has decayed to a thousandth.
    pub fn edge(self, factor: usize) -> usize {
        match self {
            _ if factor <= 1 => 0,
            Self::Plain => 0,
            Self::Kaiser => kaiser::low_pass(factor).len() / 2,
            Self::Chebyshev => {
                let sections = chebyshev::low_pass(4, 0.05, 0.8 / factor as f64);
                let slowest = sections.iter().map(|s| s.a[1].sqrt()).fold(0.0, f64::max);
                (1e-3_f64.ln() / slowest.ln()).ceil() as usize
            }
        }
    }

    /// The squared gain at `w` radians per original sample.
    pub(crate) fn power_gain(self, factor: usize) -> Box<dyn Fn(f64) -> f64> {
        match self {
            Self::Plain => Box::new(|_| 1.0),
            Self::Chebyshev => Box::new(move |w| chebyshev::squared_gain(8, 0.05, 0.8 / factor as f64, w).powi(2)),
            Self::Kaiser => {
                let taps = kaiser::low_pass(factor);
                let half = taps.len() / 2;
                let gain = move |w: f64| {
                    // 2 cos(w) times one cosine minus the one before is the next (Chebyshev's recurrence).
                    let (twice, mut before, mut here) = (2.0 * w.cos(), w.cos(), 1.0);
                    let mut sum = taps[half];
                    for t in &taps[half + 1..] {
                        (before, here) = (here, twice * here - before);
                        sum += 2.0 * t * here;
                    }
                    sum * sum
                };
                Box::new(gain)
            }
        }
    }

    /// What it is called on the command line and in reports.
    pub fn label(self) -> &'static str {
        match self {
            Self::Plain => "none (plain compression)",
            Self::Chebyshev => "Chebyshev I, order 8, forward and backward",
            Self::Kaiser => "Kaiser FIR, zero phase",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plain_compression_takes_the_samples_that_the_phase_names() {
        let x: Vec<f64> = (0..10).map(f64::from).collect();
        let cases: [(Phase, usize, &[f64]); 6] = [
            (Phase::First, 3, &[0.0, 3.0, 6.0, 9.0]),
            (Phase::Lth, 3, &[2.0, 5.0, 8.0]),
            (Phase::LastKept, 4, &[1.0, 5.0, 9.0]),
            (Phase::Offset(1), 3, &[1.0, 4.0, 7.0]),
            (Phase::Lth, 10, &[9.0]),
            (Phase::Lth, 1, &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]),
        ];
        for (phase, factor, expected) in cases {
            assert_eq!(Decimator::Plain.apply(&x, factor, phase).unwrap(), expected, "{phase:?} {factor}");
        }
    }

    #[test]
    fn bad_input_is_refused() {
        let x = [0.0; 20];
        assert_eq!(Decimator::Plain.apply(&x, 0, Phase::First), Err(DecimateError::Factor));
        assert!(matches!(
            Decimator::Plain.apply(&x, 21, Phase::Lth),
            Err(DecimateError::TooFewSamples { left: 0, .. })
        ));
        assert!(matches!(Decimator::Chebyshev.apply(&x, 2, Phase::First), Err(DecimateError::TooFewSamples { .. })));
        assert_eq!(Decimator::Kaiser.apply(&[1.0, f64::NAN], 2, Phase::First), Err(DecimateError::Gap(1)));
    }

    #[test]
    fn filters_remove_what_would_be_aliased_and_keep_the_rest() {
        let slow: Vec<f64> = (0..4000).map(|n| (0.02 * n as f64).sin()).collect();
        let fast: Vec<f64> = (0..4000).map(|n| (2.0 * n as f64).sin()).collect();
        for decimator in [Decimator::Chebyshev, Decimator::Kaiser] {
            let kept = decimator.apply(&slow, 10, Phase::First).unwrap();
            let edge = decimator.edge(10) / 10 + 1;
            let inner = edge..kept.len() - edge;
            for k in inner.clone() {
                assert!((kept[k] - slow[10 * k]).abs() < 0.012, "{decimator:?} at {k}");
            }
            let removed = decimator.apply(&fast, 10, Phase::First).unwrap();
            assert!(removed[inner].iter().all(|v| v.abs() < 2e-3), "{decimator:?}");
        }
    }

    /// The reference was computed once with SciPy 1.17.1:
    /// `x = [sin(.3 n) + .5 cos(1.7 n) + .01 n for n in range(60)]; b, a = cheby1(8, .05, .8/4); filtfilt(b, a, x, padtype="odd", padlen=24)[3::4]`
    /// (SciPy's forward and backward run has MATLAB's edge treatment for these settings).
    #[test]
    fn the_chebyshev_decimator_agrees_with_scipy() {
        let x: Vec<f64> = (0..60).map(f64::from).map(|n| (0.3 * n).sin() + 0.5 * (1.7 * n).cos() + 0.01 * n).collect();
        let y = Decimator::Chebyshev.apply(&x, 4, Phase::LastKept).unwrap();
        let reference = [
            0.785187060600,
            0.898570160206,
            -0.012558316427,
            -0.861864017306,
            -0.337629947509,
            0.791332066437,
            1.221572488406,
            0.453977363244,
            -0.566238868548,
            -0.328197011923,
            0.725787033977,
            1.469769587742,
            0.939214242238,
            -0.286989983775,
            0.200873628008,
        ];
        assert_eq!(y.len(), reference.len());
        for (a, b) in y.iter().zip(reference) {
            assert!((a - b).abs() < 1e-9, "{a} {b}");
        }
    }
}
