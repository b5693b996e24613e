//! Fewer rows for recordings that were sampled far faster than anything in them moves.
//!
//! A position that moves at two hertz and is sampled at a thousand says nothing in most of its samples, and a noise model at that rate judges by
//! frequencies at which nothing happens. Rows are then every `step`-th sample of the output behind a zero-phase low-pass filter. Measured and
//! simulated outputs and their derivatives go through the same linear map, so nothing is approximated: the simulation itself still runs at
//! the recorded rate with the recorded input.

use std::borrow::Cow;

use crate::mechanism::band_but_for;

/// Share of an output's power that may lie above the fastest frequency.
const OUTSIDE: f64 = 0.005;
/// Rows for each period of the fastest frequency.
const ROWS_A_PERIOD: f64 = 24.0;
/// Rows that a data set keeps at least.
const LEAST_ROWS: usize = 2000;

/// How many samples a row stands for, for outputs of this period that together have `samples` samples.
pub fn step<'a>(signals: impl Iterator<Item = &'a [f64]>, period_s: f64, samples: usize) -> usize {
    let highest = signals
        .map(|s| {
            let finite: Vec<f64> = s.iter().copied().filter(|v| v.is_finite()).collect();
            band_but_for(&finite, period_s, OUTSIDE).1
        })
        .fold(0.0, f64::max);
    if highest <= 0.0 {
        return 1;
    }
    let by_band = (1.0 / (period_s * ROWS_A_PERIOD * highest)).floor() as usize;
    by_band.min(samples / LEAST_ROWS).max(1)
}

/// Every `step`-th sample of the filtered series, the first one included; the kernel is cut and scaled at the ends.
pub fn thin(x: &[f64], step: usize) -> Cow<'_, [f64]> {
    if step <= 1 {
        return Cow::Borrowed(x);
    }
    let half = 3 * step;
    let kernel: Vec<f64> = (0..=half)
        .map(|i| {
            // Cut at 0.8 of the new Nyquist frequency, Hann's window.
            let t = 0.8 * i as f64 / step as f64;
            let sinc = if i == 0 { 1.0 } else { (std::f64::consts::PI * t).sin() / (std::f64::consts::PI * t) };
            sinc * 0.5 * (1.0 + (std::f64::consts::PI * i as f64 / (half + 1) as f64).cos())
        })
        .collect();
    let rows = (0..x.len()).step_by(step).map(|n| {
        let (from, to) = (n.saturating_sub(half), (n + half).min(x.len() - 1));
        let (mut sum, mut weight) = (0.0, 0.0);
        for (m, v) in x.iter().enumerate().take(to + 1).skip(from) {
            let k = kernel[m.abs_diff(n)];
            sum += k * v;
            weight += k;
        }
        sum / weight
    });
    Cow::Owned(rows.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sine(cycles_a_sample: f64, n: usize) -> Vec<f64> {
        (0..n).map(|i| (std::f64::consts::TAU * cycles_a_sample * i as f64).sin()).collect()
    }

    #[test]
    fn slow_signals_pass_and_fast_ones_do_not() {
        let slow = thin(&sine(0.002, 2000), 10).into_owned();
        for (n, v) in slow.iter().enumerate().skip(5).take(190) {
            assert!((v - (std::f64::consts::TAU * 0.002 * 10.0 * n as f64).sin()).abs() < 2e-3);
        }
        let fast = thin(&sine(0.23, 2000), 10).into_owned();
        assert!(fast.iter().skip(5).take(190).all(|v| v.abs() < 0.01));
        assert!(thin(&[3.0; 100], 7).iter().all(|v| (v - 3.0).abs() < 1e-12));
    }

    #[test]
    fn only_long_recordings_of_slow_signals_are_thinned() {
        let period = 1e-3;
        assert_eq!(step([sine(0.002, 20_000).as_slice()].into_iter(), period, 20_000), 10);
        assert_eq!(step([sine(0.002, 3000).as_slice()].into_iter(), period, 3000), 1);
        assert_eq!(step([sine(0.1, 20_000).as_slice()].into_iter(), period, 20_000), 1);
    }
}
