//! Noise with a stated variance: white, or coloured by an autoregression; and the variance that a signal-to-noise ratio asks for.
//!
//! The stream is PCG-64 (`rand_pcg::Pcg64Mcg`), the same on every platform for a given seed.

use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

/// What can be wrong with a request for noise.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NoiseError {
    /// A variance must be a finite number of 0 or more.
    #[error("the noise variance is {0}; it must be a finite number of 0 or more")]
    BadVariance(f64),
    /// The autoregression does not die out.
    #[error("the autoregression {0:?} is not stable; all its poles must lie inside the unit circle")]
    Unstable(Vec<f64>),
    /// A constant signal has no variance to compare the noise with.
    #[error("the signal is constant, so a signal-to-noise ratio says nothing; give the noise variance instead")]
    ConstantSignal,
    /// A signal-to-noise ratio must be a finite number.
    #[error("the signal-to-noise ratio is {0} dB; it must be a finite number")]
    BadRatio(f64),
}

/// White Gaussian noise: `samples` values of mean 0 and this `variance` (unit of the signal, squared).
///
/// # Errors
/// The variance is negative or not finite.
pub fn white_noise(samples: usize, variance: f64, seed: u64) -> Result<Vec<f64>, NoiseError> {
    let deviation = deviation(variance)?;
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    Ok((0..samples).map(|_| deviation * unit_normal(&mut random)).collect())
}

/// Stationary Gaussian noise `e[n] = a[0] e[n-1] + a[1] e[n-2] + ... + w[n]` whose own variance is `variance`.
///
/// With no coefficients it is [`white_noise`].
///
/// # Errors
/// The variance is negative or not finite; the autoregression is not stable.
pub fn autoregressive_noise(a: &[f64], samples: usize, variance: f64, seed: u64) -> Result<Vec<f64>, NoiseError> {
    let deviation = deviation(variance)?;
    let gain = stationary_gain(a).ok_or_else(|| NoiseError::Unstable(a.to_vec()))?;
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    // The first samples are dropped until the start from rest is forgotten: exp(-30) of it is left.
    let settle = if a.is_empty() { 0 } else { settling_samples(a) };
    let mut e = vec![0.0; settle + samples];
    for n in 0..e.len() {
        let past: f64 = a.iter().zip(e[..n].iter().rev()).map(|(a, e)| a * e).sum();
        e[n] = past + deviation / gain * unit_normal(&mut random);
    }
    Ok(e.split_off(settle))
}

/// The variance of the noise that gives `signal` this ratio in dB: `var(signal) / 10^(snr_db/10)`.
///
/// # Errors
/// The ratio is not finite; the signal is constant or has no finite sample.
pub fn variance_for_snr(signal: &[f64], snr_db: f64) -> Result<f64, NoiseError> {
    if !snr_db.is_finite() {
        return Err(NoiseError::BadRatio(snr_db));
    }
    let finite: Vec<f64> = signal.iter().copied().filter(|s| s.is_finite()).collect();
    let mean = finite.iter().sum::<f64>() / finite.len().max(1) as f64;
    let variance = finite.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / finite.len().max(1) as f64;
    if variance > 0.0 { Ok(variance / 10f64.powf(snr_db / 10.0)) } else { Err(NoiseError::ConstantSignal) }
}

fn unit_normal(random: &mut Pcg64Mcg) -> f64 {
    StandardNormal.sample(random)
}

fn deviation(variance: f64) -> Result<f64, NoiseError> {
    if variance.is_finite() && variance >= 0.0 { Ok(variance.sqrt()) } else { Err(NoiseError::BadVariance(variance)) }
}

/// Standard deviation of the autoregression driven by unit white noise; `None` where it is not stable.
///
/// Levinson's recursion downwards: the process is stable if and only if every reflection coefficient is inside (-1, 1), and
/// its variance is the product of `1/(1 - k^2)`.
fn stationary_gain(a: &[f64]) -> Option<f64> {
    let mut a = a.to_vec();
    let mut variance = 1.0;
    while let Some(k) = a.pop() {
        let left = 1.0 - k * k;
        if !(left > 0.0 && k.is_finite()) {
            return None;
        }
        variance /= left;
        let mirrored: Vec<f64> = a.iter().rev().copied().collect();
        for (a, m) in a.iter_mut().zip(mirrored) {
            *a = (*a + k * m) / left;
        }
    }
    Some(f64::sqrt(variance))
}

/// How many samples the impulse response takes to fall below exp(-30) of its peak for good (at most a million).
fn settling_samples(a: &[f64]) -> usize {
    let mut past = vec![0.0; a.len()];
    past[0] = 1.0;
    let mut peak = 1.0f64;
    for n in 0..1_000_000 {
        let next: f64 = a.iter().zip(&past).map(|(a, e)| a * e).sum();
        past.rotate_right(1);
        past[0] = next;
        peak = peak.max(next.abs());
        if past.iter().all(|e| e.abs() < 1e-13 * peak) {
            return n;
        }
    }
    1_000_000
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moments(e: &[f64], lag: usize) -> f64 {
        e.iter().zip(&e[lag..]).map(|(a, b)| a * b).sum::<f64>() / (e.len() - lag) as f64
    }

    #[test]
    fn white_noise_has_its_variance_and_its_seed() {
        let e = white_noise(100_000, 4.0, 7).unwrap();
        assert!((moments(&e, 0) - 4.0).abs() < 0.06);
        assert!(moments(&e, 1).abs() < 0.05);
        assert_eq!(e, white_noise(100_000, 4.0, 7).unwrap());
        assert_ne!(e, white_noise(100_000, 4.0, 8).unwrap());
        // The stream is part of what a seed promises: fixtures rest on it.
        assert_eq!(e[..2], white_noise(2, 4.0, 7).unwrap()[..]);
    }

    #[test]
    fn coloured_noise_has_the_variance_and_correlation_of_theory() {
        // AR(2): rho_1 = a1/(1 - a2), rho_2 = a1 rho_1 + a2.
        let (a1, a2) = (1.2, -0.6);
        let e = autoregressive_noise(&[a1, a2], 400_000, 0.5, 3).unwrap();
        let rho = a1 / (1.0 - a2);
        let v = moments(&e, 0);
        assert!((v - 0.5).abs() < 0.01, "variance {v}");
        assert!((moments(&e, 1) / v - rho).abs() < 0.01);
        assert!((moments(&e, 2) / v - (a1 * rho + a2)).abs() < 0.01);
    }

    #[test]
    fn an_unstable_autoregression_is_refused() {
        for a in [&[1.0][..], &[-1.1], &[1.2, 0.5], &[f64::NAN]] {
            assert!(matches!(autoregressive_noise(a, 10, 1.0, 1), Err(NoiseError::Unstable(_))), "{a:?}");
        }
    }

    #[test]
    fn a_ratio_of_20_db_is_a_hundredth_of_the_variance() {
        let s = [1.0, -1.0, 1.0, -1.0];
        approx::assert_relative_eq!(variance_for_snr(&s, 20.0).unwrap(), 0.01);
        assert_eq!(variance_for_snr(&[2.0, 2.0], 20.0), Err(NoiseError::ConstantSignal));
        assert_eq!(variance_for_snr(&[], 20.0), Err(NoiseError::ConstantSignal));
    }
}
