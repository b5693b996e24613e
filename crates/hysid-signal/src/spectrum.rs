//! Spectra by the fast Fourier transform: power and cross spectra by Welch's method, coherence, correlation.
//!
//! Densities are one-sided, in (unit squared)/Hz: summed over the lines and multiplied by their spacing they give the
//! variance. Reference: Welch, IEEE Trans. Audio Electroacoust. 15 (1967) 70-73.

use std::cell::RefCell;

use realfft::RealFftPlanner;

/// What can be wrong with a request for a spectrum.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SpectrumError {
    /// Input and output must have equally many samples.
    #[error("the input has {u} samples and the output {y}; a cross spectrum needs equally many")]
    UnequalLengths {
        /// Samples of the input.
        u: usize,
        /// Samples of the output.
        y: usize,
    },
    /// The segment must hold at least 8 samples and fit into the signal.
    #[error("segments of {segment} samples in a signal of {samples}; a segment must have 8 samples or more and fit in")]
    BadSegment {
        /// Samples of a segment.
        segment: usize,
        /// Samples of the signal.
        samples: usize,
    },
    /// The sampling period must be a finite number above zero.
    #[error("the sampling period is {0} s; it must be a finite number above zero")]
    BadPeriod(f64),
    /// A sample is not a finite number.
    #[error("sample {0} is not a finite number; cut the recording at its gaps first")]
    NotFinite(usize),
}

/// Welch's estimate of the spectra of an input and an output, one value for each frequency line from 0 to the Nyquist frequency.
#[derive(Debug, Clone, PartialEq)]
pub struct CrossSpectrum {
    /// The lines, in Hz.
    pub frequency_hz: Vec<f64>,
    /// Power density of the input.
    pub uu: Vec<f64>,
    /// Power density of the output.
    pub yy: Vec<f64>,
    /// Cross density `conj(U) Y` as (real, imaginary).
    pub uy: Vec<(f64, f64)>,
    /// How many segments were averaged.
    pub segments: usize,
}

impl CrossSpectrum {
    /// `|S_uy|^2 / (S_uu S_yy)` at each line, from 0 to 1; 0 where there is no power. With a single segment it is 1 everywhere.
    pub fn coherence(&self) -> Vec<f64> {
        let lines = self.uu.iter().zip(&self.yy).zip(&self.uy);
        lines
            .map(|((uu, yy), (re, im))| if uu * yy > 0.0 { ((re * re + im * im) / (uu * yy)).min(1.0) } else { 0.0 })
            .collect()
    }

    /// The frequency response `S_uy / S_uu` (estimator H1, for noise on the output) as (real, imaginary); 0 where the input has no power.
    pub fn response(&self) -> Vec<(f64, f64)> {
        let lines = self.uu.iter().zip(&self.uy);
        lines.map(|(uu, (re, im))| if *uu > 0.0 { (re / uu, im / uu) } else { (0.0, 0.0) }).collect()
    }
}

/// The lines in Hz and the one-sided power density of `u` at each, by Welch's method (see [`cross_spectrum`]).
///
/// # Errors
/// As for [`cross_spectrum`].
pub fn power_spectrum(u: &[f64], period_s: f64, segment: usize) -> Result<(Vec<f64>, Vec<f64>), SpectrumError> {
    let spectrum = cross_spectrum(u, u, period_s, segment)?;
    Ok((spectrum.frequency_hz, spectrum.uu))
}

/// Welch's spectra of `u` and `y`: segments of `segment` samples that overlap by half, mean removed, Hann window, averaged.
///
/// # Errors
/// Unequal lengths, a segment below 8 samples or longer than the signal, a bad period, a sample that is not finite.
pub fn cross_spectrum(u: &[f64], y: &[f64], period_s: f64, segment: usize) -> Result<CrossSpectrum, SpectrumError> {
    if u.len() != y.len() {
        return Err(SpectrumError::UnequalLengths { u: u.len(), y: y.len() });
    }
    if segment < 8 || segment > u.len() {
        return Err(SpectrumError::BadSegment { segment, samples: u.len() });
    }
    if !(period_s.is_finite() && period_s > 0.0) {
        return Err(SpectrumError::BadPeriod(period_s));
    }
    if let Some(n) = u.iter().zip(y).position(|(u, y)| !(u.is_finite() && y.is_finite())) {
        return Err(SpectrumError::NotFinite(n));
    }
    let window: Vec<f64> =
        (0..segment).map(|n| (std::f64::consts::PI * n as f64 / segment as f64).sin().powi(2)).collect();
    let energy: f64 = window.iter().map(|w| w * w).sum();
    let transform = |signal: &[f64]| {
        let mean = signal.iter().sum::<f64>() / segment as f64;
        fourier(&signal.iter().zip(&window).map(|(s, w)| (s - mean) * w).collect::<Vec<_>>())
    };
    let lines = segment / 2 + 1;
    let mut sum = CrossSpectrum {
        frequency_hz: (0..lines).map(|k| k as f64 / (segment as f64 * period_s)).collect(),
        uu: vec![0.0; lines],
        yy: vec![0.0; lines],
        uy: vec![(0.0, 0.0); lines],
        segments: 0,
    };
    for start in (0..=u.len() - segment).step_by(segment / 2) {
        let (us, ys) = (transform(&u[start..start + segment]), transform(&y[start..start + segment]));
        for (k, ((ur, ui), (yr, yi))) in us.into_iter().zip(ys).enumerate() {
            sum.uu[k] += ur * ur + ui * ui;
            sum.yy[k] += yr * yr + yi * yi;
            sum.uy[k].0 += ur * yr + ui * yi;
            sum.uy[k].1 += ur * yi - ui * yr;
        }
        sum.segments += 1;
    }
    for k in 0..lines {
        // One-sided: every line but 0 and the Nyquist frequency also stands for its mirror image.
        let sides = if k == 0 || 2 * k == segment { 1.0 } else { 2.0 };
        let scale = sides * period_s / (energy * sum.segments as f64);
        sum.uu[k] *= scale;
        sum.yy[k] *= scale;
        sum.uy[k] = (sum.uy[k].0 * scale, sum.uy[k].1 * scale);
    }
    Ok(sum)
}

thread_local! {
    /// Plans by length: a caller that whitens a thousand columns of one length asks for the same plan a thousand times.
    static PLANNER: RefCell<RealFftPlanner<f64>> = RefCell::new(RealFftPlanner::new());
}

/// The discrete Fourier transform of a real signal, `sum u[n] exp(-2 pi i k n/N)` for `k` from 0 to `N/2`, as (real, imaginary).
pub fn fourier(u: &[f64]) -> Vec<(f64, f64)> {
    if u.is_empty() {
        return Vec::new();
    }
    let plan = PLANNER.with_borrow_mut(|p| p.plan_fft_forward(u.len()));
    let (mut input, mut output) = (u.to_vec(), plan.make_output_vec());
    // The transform fails only on slices of a wrong length, and these come from the plan.
    let done = plan.process(&mut input, &mut output);
    debug_assert!(done.is_ok());
    output.iter().map(|c| (c.re, c.im)).collect()
}

/// The real signal of `samples` samples that has this transform: the inverse of [`fourier`]. Lines that are not given are 0.
pub fn inverse_fourier(lines: &[(f64, f64)], samples: usize) -> Vec<f64> {
    if samples == 0 {
        return Vec::new();
    }
    let plan = PLANNER.with_borrow_mut(|p| p.plan_fft_inverse(samples));
    let (mut input, mut output) = (plan.make_input_vec(), plan.make_output_vec());
    for (c, (re, im)) in input.iter_mut().zip(lines) {
        (c.re, c.im) = (*re, *im);
    }
    // A real signal has no imaginary part at line 0 and, for an even length, at the Nyquist line.
    let last = input.len() - 1;
    input[0].im = 0.0;
    if samples.is_multiple_of(2) {
        input[last].im = 0.0;
    }
    let done = plan.process(&mut input, &mut output);
    debug_assert!(done.is_ok());
    output.iter().map(|v| v / samples as f64).collect()
}

/// `sum a[n] b[n + lag]` for lags from 0 to `most_lag`, no mean removed and not divided; `a` and `b` equally long.
///
/// The value at lag 0 of `(a, a)` is the energy of `a`. Lags beyond the signal are 0. Cost: two transforms of twice the length.
pub fn correlation(a: &[f64], b: &[f64], most_lag: usize) -> Vec<f64> {
    let samples = a.len().min(b.len());
    let length = (2 * samples).next_power_of_two().max(2);
    let padded = |s: &[f64]| {
        let mut s = s[..samples].to_vec();
        s.resize(length, 0.0);
        fourier(&s)
    };
    let product: Vec<(f64, f64)> = padded(a)
        .into_iter()
        .zip(padded(b))
        .map(|((ar, ai), (br, bi))| (ar * br + ai * bi, ar * bi - ai * br))
        .collect();
    let mut r = inverse_fourier(&product, length);
    r.truncate(samples.min(most_lag + 1));
    r.resize(most_lag + 1, 0.0);
    r
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::white_noise;

    #[test]
    fn the_density_sums_to_the_variance() {
        let e = white_noise(40_000, 2.0, 1).unwrap();
        let (f, s) = power_spectrum(&e, 0.01, 256).unwrap();
        let total: f64 = s.iter().sum::<f64>() * (f[1] - f[0]);
        assert!((total - 2.0).abs() < 0.05, "{total}");
        assert_eq!(f.last(), Some(&50.0));
    }

    #[test]
    fn a_sine_shows_at_its_line() {
        let u: Vec<f64> = (0..1000).map(|n| (std::f64::consts::TAU * 5.0 * n as f64 / 100.0).sin()).collect();
        let (f, s) = power_spectrum(&u, 0.01, 200).unwrap();
        let peak = (0..s.len()).max_by(|&a, &b| s[a].total_cmp(&s[b])).unwrap();
        approx::assert_relative_eq!(f[peak], 5.0, epsilon = 1e-12);
    }

    #[test]
    fn response_and_coherence_of_a_delayed_gain_with_noise() {
        let u = white_noise(200_001, 1.0, 1).unwrap();
        let e = white_noise(200_000, 1.0, 2).unwrap();
        let y: Vec<f64> = (0..200_000).map(|n| 2.0 * u[n] + e[n]).collect();
        let s = cross_spectrum(&u[1..], &y, 1.0, 100).unwrap();
        let (gain, phase): (Vec<f64>, Vec<f64>) = s.response().iter().map(|(r, i)| (r.hypot(*i), i.atan2(*r))).unzip();
        let coherence = s.coherence();
        for k in 5..45 {
            // y[n] = 2 u[n] while the input passed in starts one sample later: a delay of one sample.
            assert!((gain[k] - 2.0).abs() < 0.1, "gain {}", gain[k]);
            assert!((phase[k] + std::f64::consts::TAU * s.frequency_hz[k]).abs() < 0.05, "phase {}", phase[k]);
            assert!((coherence[k] - 0.8).abs() < 0.05, "coherence {}", coherence[k]);
        }
    }

    #[test]
    fn transform_inverse_and_correlation_agree_with_brute_force() {
        for samples in [1usize, 2, 7, 16] {
            let a = white_noise(samples, 1.0, 3).unwrap();
            let b = white_noise(samples, 1.0, 4).unwrap();
            for (x, y) in inverse_fourier(&fourier(&a), samples).iter().zip(&a) {
                approx::assert_abs_diff_eq!(x, y, epsilon = 1e-13);
            }
            for (lag, r) in correlation(&a, &b, 20).iter().enumerate() {
                let brute: f64 = (0..samples.saturating_sub(lag)).map(|n| a[n] * b[n + lag]).sum();
                approx::assert_abs_diff_eq!(*r, brute, epsilon = 1e-12);
            }
        }
        assert_eq!(correlation(&[], &[], 2), vec![0.0; 3]);
    }

    #[test]
    fn bad_requests_are_refused() {
        let u = [1.0; 16];
        assert!(matches!(cross_spectrum(&u, &u[1..], 1.0, 8), Err(SpectrumError::UnequalLengths { .. })));
        assert!(matches!(cross_spectrum(&u, &u, 1.0, 17), Err(SpectrumError::BadSegment { .. })));
        assert!(matches!(cross_spectrum(&u, &u, 0.0, 8), Err(SpectrumError::BadPeriod(_))));
        assert!(matches!(cross_spectrum(&[f64::NAN; 8], &[0.0; 8], 1.0, 8), Err(SpectrumError::NotFinite(0))));
    }
}
