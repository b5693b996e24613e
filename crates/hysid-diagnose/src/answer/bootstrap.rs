//! Intervals for a ratio of errors, by resampling blocks of time.
//!
//! Errors of one recording are correlated in time, so single samples must not be resampled: blocks are, the same ones above and below the line.

use rand::RngExt;

use crate::evidence::quantile;
use crate::random::generator;

/// A ratio of rms errors with its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ratio {
    /// `rms(after) / rms(before)`.
    pub value: f64,
    /// 2.5 % quantile.
    pub low: f64,
    /// 97.5 % quantile.
    pub high: f64,
}

/// Root mean square; `NaN` for nothing.
pub fn rms(e: &[f64]) -> f64 {
    (e.iter().map(|x| x * x).sum::<f64>() / e.len() as f64).sqrt()
}

/// The ratio of the rms of two errors on the same samples, with an interval from 400 resamplings of 20 to 40 blocks.
pub fn ratio_of_rms(after: &[f64], before: &[f64], seed: u64) -> Ratio {
    let n = after.len().min(before.len());
    let value = rms(&after[..n]) / rms(&before[..n]);
    let blocks = (n / 25).clamp(1, 40);
    if blocks < 8 || !value.is_finite() {
        return Ratio { value, low: f64::NAN, high: f64::NAN };
    }
    let sums: Vec<(f64, f64)> = (0..blocks)
        .map(|b| {
            let range = b * n / blocks..(b + 1) * n / blocks;
            let sum = |e: &[f64]| e[range.clone()].iter().map(|x| x * x).sum::<f64>();
            (sum(after), sum(before))
        })
        .collect();
    let mut ratios: Vec<f64> = (0..400)
        .map(|i| {
            let mut rng = generator(seed, 0xB00u64 << 40 | i);
            let (a, b) =
                (0..blocks).map(|_| sums[rng.random_range(0..blocks)]).fold((0.0, 0.0), |s, x| (s.0 + x.0, s.1 + x.1));
            (a / b).sqrt()
        })
        .filter(|r| r.is_finite())
        .collect();
    ratios.sort_by(f64::total_cmp);
    let at = |q: f64| quantile(&ratios, q).unwrap_or(f64::NAN);
    Ratio { value, low: at(0.025), high: at(0.975) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_distr::{Distribution, StandardNormal};

    #[test]
    fn the_interval_covers_the_true_ratio() {
        let covered = (0..100)
            .filter(|&seed| {
                let mut rng = generator(seed, 1);
                let mut noise = |scale: f64| -> Vec<f64> {
                    (0..800)
                        .map(|_| {
                            let w: f64 = StandardNormal.sample(&mut rng);
                            scale * w
                        })
                        .collect()
                };
                let r = ratio_of_rms(&noise(0.3), &noise(1.0), seed);
                r.low <= 0.3 && 0.3 <= r.high
            })
            .count();
        assert!((85..=100).contains(&covered), "{covered} of 100");
    }

    #[test]
    fn too_few_samples_have_no_interval() {
        let r = ratio_of_rms(&[1.0; 50], &[2.0; 50], 1);
        assert_eq!(r.value, 0.5);
        assert!(r.low.is_nan());
    }
}
