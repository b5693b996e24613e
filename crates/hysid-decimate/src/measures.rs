//! The two measures of the paper, equations (19) and (21), and the share of a signal that a reduction would alias.
//!
//! Both compare a sample with the middle of the straight line between two others:
//!
//! * MRD looks at three neighbours of the *reduced* signal: the mean over k of |(y(k) + y(k+2))/2 - y(k+1)| / |y(k+1)|. Small means that neighbours are
//!   alike, so that the signal is oversampled. The sum in equation (19) has no absolute value and runs one sample too far; with the absolute value and k up to
//!   N/L - 2 it gives the paper's Table 1 to the printed digit, all 14 values (`cargo xtask reproduce`).
//! * MRE looks at two samples of the *original* signal that are L apart: the largest over k of |(y(k) + y(k+L))/2 - m| / |m|, where m is the
//!   sample half way (for odd L the mean of the two there). Large means that the shape between the samples kept is lost.
//!
//! Both divide by y. The robust forms put sums in numerator and denominator and measure y from its mean: they do not
//! change when a constant is added, and no single sample near 0 decides. For a smooth signal the robust MRD is four times the robust MRE.

use std::f64::consts::PI;

use hysid_signal::fourier;

use crate::decimator::Decimator;

/// A measure as printed in the paper and in a form that survives y = 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ratio {
    /// As printed (with the absolute value); infinite where y is 0 somewhere it divides.
    pub as_printed: f64,
    /// The sum of the numerators over the sum of |y - mean|; `NaN` for a constant signal or where there is nothing to sum.
    pub robust: f64,
}

/// Numerators |line - sample| and the samples they belong to.
fn ratio(pairs: &[(f64, f64)], as_printed: impl Fn(&mut dyn Iterator<Item = f64>) -> f64) -> Ratio {
    let mean = pairs.iter().map(|p| p.1).sum::<f64>() / pairs.len() as f64;
    let top: f64 = pairs.iter().map(|p| p.0).sum();
    let bottom: f64 = pairs.iter().map(|p| (p.1 - mean).abs()).sum();
    // 0/0 is a stretch at rest in 0: neighbours there are alike.
    let relative = |p: &(f64, f64)| if p.0 == 0.0 { 0.0 } else { p.0 / p.1.abs() };
    Ratio {
        as_printed: as_printed(&mut pairs.iter().map(relative)),
        robust: if bottom > 0.0 { top / bottom } else { f64::NAN },
    }
}

/// MRD, equation (19), of a reduced signal given as its stretches between gaps.
///
/// `as_printed` is `NaN` where no stretch has three samples.
pub fn mean_relative_difference(reduced: &[&[f64]]) -> Ratio {
    let pairs: Vec<(f64, f64)> =
        reduced.iter().flat_map(|y| y.windows(3)).map(|w| ((0.5 * (w[0] + w[2]) - w[1]).abs(), w[1])).collect();
    ratio(&pairs, |r| r.sum::<f64>() / pairs.len() as f64)
}

/// MRE, equation (21), of the original signal, given as its stretches between gaps, for this factor.
///
/// `as_printed` is `NaN` where no stretch is longer than the factor. A factor of 1 has nothing between its samples: 0.
pub fn interpolation_error(y: &[&[f64]], factor: usize) -> Ratio {
    let (low, high) = (factor / 2, factor.div_ceil(2));
    let pairs: Vec<(f64, f64)> = y
        .iter()
        .flat_map(|y| y.windows(factor + 1))
        .map(|w| {
            let middle = 0.5 * (w[low] + w[high]);
            ((0.5 * (w[0] + w[factor]) - middle).abs(), middle)
        })
        .collect();
    ratio(&pairs, |r| r.fold(f64::NAN, f64::max))
}

/// The share of the variance of `x` (a stretch without a gap) that lies above the new Nyquist frequency after the decimator's filter and is therefore
/// aliased, from 0 to 1; Hann window. 0 for a constant or for fewer than 8 samples.
pub fn aliased_share(x: &[f64], factor: usize, decimator: Decimator) -> f64 {
    if x.len() < 8 || factor <= 1 {
        return 0.0;
    }
    let mean = x.iter().sum::<f64>() / x.len() as f64;
    let step = 2.0 * PI / x.len() as f64;
    let windowed: Vec<f64> =
        x.iter().enumerate().map(|(n, v)| (v - mean) * (0.5 - 0.5 * (step * (n as f64 + 0.5)).cos())).collect();
    let gain = decimator.power_gain(factor);
    let (mut above, mut all) = (0.0, 0.0);
    for (k, (re, im)) in fourier(&windowed).into_iter().enumerate().skip(1) {
        let (power, w) = (re * re + im * im, step * k as f64);
        all += power;
        if w > PI / factor as f64 {
            above += power * gain(w);
        }
    }
    if all > 0.0 { above / all } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The paper's Preisach loop: 202 points, see `docs/reproduction.md`.
    fn loop_of_the_paper() -> Vec<f64> {
        let up = (0..=100).map(|m| f64::from(m * (m - 1)) / 39600.0);
        let down = (0..=100).map(|n| 0.25 - f64::from(n * (n - 1)) / 39600.0);
        up.chain(down).collect()
    }

    #[test]
    fn table_1_of_the_paper() {
        let printed = [
            0.0129, 0.0155, 0.0192, 0.0233, 0.0276, 0.0324, 0.0372, 0.0425, 0.0480, 0.0534, 0.0589, 0.0631, 0.0711,
            0.0745,
        ];
        let y = loop_of_the_paper();
        for (factor, expected) in (2..).zip(printed) {
            let reduced = Decimator::Plain.apply(&y, factor, crate::Phase::Lth).unwrap();
            let found = mean_relative_difference(&[&reduced]).as_printed;
            assert!((found - expected).abs() <= 0.5e-4, "L = {factor}: {found} {expected}");
        }
    }

    #[test]
    fn the_interpolation_error_in_closed_form() {
        // On y = M (M - 1), M = 9 .. 9 + L, see docs/reproduction.md: L^2 / ((17+L)^2 - 1), or (L^2 - 1) / (17+L)^2 for odd L.
        for l in 2_i32..16 {
            let y: Vec<f64> = (9..=9 + l).map(|m| f64::from(m * (m - 1))).collect();
            let odd = f64::from(l % 2);
            let expected = (f64::from(l * l) - odd) / (f64::from((17 + l) * (17 + l)) - 1.0 + odd);
            assert!((interpolation_error(&[&y], l as usize).as_printed - expected).abs() < 1e-14);
        }
        assert_eq!(interpolation_error(&[&loop_of_the_paper()], 2).as_printed, f64::INFINITY, "y = 0 divides");
    }

    #[test]
    fn the_robust_forms_ignore_a_constant_and_stand_four_to_one() {
        let wave = |offset: f64| (0..6000).map(|n| (0.01 * n as f64).sin() + offset).collect::<Vec<f64>>();
        let measures = |y: &[f64]| {
            let reduced = Decimator::Plain.apply(y, 20, crate::Phase::First).unwrap();
            (mean_relative_difference(&[&reduced]).robust, interpolation_error(&[y], 20).robust)
        };
        let (d, e) = measures(&wave(0.0));
        let (d7, e7) = measures(&wave(7.0));
        assert!((d - (1.0 - 0.2_f64.cos())).abs() < 1e-3 && (e - (1.0 - 0.1_f64.cos())).abs() < 1e-3);
        assert!((d - d7).abs() < 1e-6 && (e - e7).abs() < 1e-6);
        assert!((d / e - 4.0).abs() < 0.05);
        assert!(mean_relative_difference(&[&[1.0; 9]]).robust.is_nan());
        assert!(mean_relative_difference(&[&[1.0, 2.0]]).as_printed.is_nan());
    }

    #[test]
    fn what_is_aliased_is_what_lies_above() {
        let x: Vec<f64> = (0..5000).map(|n| 2.0 * (0.1 * n as f64).sin() + (1.0 * n as f64).sin()).collect();
        assert!((aliased_share(&x, 5, Decimator::Plain) - 0.2).abs() < 1e-3);
        assert!(aliased_share(&x, 2, Decimator::Plain) < 1e-6);
        assert!(aliased_share(&x, 5, Decimator::Chebyshev) < 1e-4);
        assert!(aliased_share(&x, 5, Decimator::Kaiser) < 1e-5);
        assert_eq!(aliased_share(&[3.0; 100], 4, Decimator::Plain), 0.0);
    }
}
