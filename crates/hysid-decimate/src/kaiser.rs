//! Linear-phase low-pass filters by the window method with Kaiser's window.
//!
//! J. F. Kaiser's formulas: for a stop-band attenuation A in dB above 50, beta = 0.1102 (A - 8.7), and (A - 7.95) / (2.285 dw) + 1 taps for
//! a transition of dw radians.

use std::f64::consts::PI;

/// Attenuation of what would be aliased, in dB.
const ATTENUATION_DB: f64 = 60.0;

/// The taps of a low-pass for keeping every `factor`-th sample: flat to 0.8 of the new Nyquist frequency, down by 60 dB from there on. Their
/// number is odd, they are symmetric, and their sum is 1.
pub(crate) fn low_pass(factor: usize) -> Vec<f64> {
    let nyquist = PI / factor as f64;
    let (transition, middle) = (0.2 * nyquist, 0.9 * nyquist);
    let half = ((ATTENUATION_DB - 7.95) / (2.285 * transition) / 2.0).ceil() as i64;
    let beta = 0.1102 * (ATTENUATION_DB - 8.7);
    let mut taps: Vec<f64> = (-half..=half)
        .map(|n| {
            let x = n as f64 / half as f64;
            let window = bessel_i0(beta * (1.0 - x * x).max(0.0).sqrt()) / bessel_i0(beta);
            let ideal = if n == 0 { middle / PI } else { (middle * n as f64).sin() / (PI * n as f64) };
            ideal * window
        })
        .collect();
    let sum: f64 = taps.iter().sum();
    taps.iter_mut().for_each(|t| *t /= sum);
    taps
}

/// The modified Bessel function of the first kind and order 0, by its power series (arguments up to about 20 here).
fn bessel_i0(x: f64) -> f64 {
    let quarter = x * x / 4.0;
    let (mut term, mut sum, mut k) = (1.0, 1.0, 1.0);
    while term > sum * 1e-17 {
        term *= quarter / (k * k);
        sum += term;
        k += 1.0;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bessel_values_of_the_handbook() {
        // Abramowitz and Stegun, table 9.8 (exp(-x) I0(x)).
        for (x, expected) in [(0.0, 1.0), (1.0, 0.465_759_607_7), (5.0, 0.183_540_812_6), (10.0, 0.127_833_337_2)] {
            assert!((bessel_i0(x) * (-x).exp() - expected).abs() < 1e-9, "{x}");
        }
    }

    #[test]
    fn the_filter_passes_and_stops_what_it_says() {
        for factor in [2, 5, 13] {
            let taps = low_pass(factor);
            let half = (taps.len() / 2) as i64;
            let gain = |w: f64| -> f64 {
                taps.iter().enumerate().map(|(i, t)| t * (w * (i as i64 - half) as f64).cos()).sum::<f64>()
            };
            let nyquist = PI / factor as f64;
            for i in 0..=100 {
                let share = f64::from(i) / 100.0;
                assert!((gain(0.8 * nyquist * share) - 1.0).abs() < 2e-3);
                assert!(gain(nyquist + (PI - nyquist) * share).abs() < 2e-3);
            }
        }
    }
}
