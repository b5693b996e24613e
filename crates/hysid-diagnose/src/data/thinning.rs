//! Fewer rows for recordings that were sampled far faster than anything in them moves.
//!
//! A position that moves at two hertz and is sampled at a thousand says nothing in most of its samples, and a noise model at that rate judges by
//! frequencies at which nothing happens. Rows are then means over `step` samples of the output. Measured and simulated outputs and their
//! derivatives go through the same linear map, so nothing is approximated: the simulation itself still runs at the recorded rate with the
//! recorded input.
//!
//! Means of samples that follow each other share none: white noise of a sensor stays white. A sharper filter would give it a colour, which costs
//! a noise model several coefficients and leaves noise that passes through the plant, beside a sensor that is white, without a model.

use std::borrow::Cow;

use super::runs;
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

/// Most samples of a segment of the spectra by which feedback is seen, the least number of segments, and the mean coherence beyond which it is.
const SEGMENT: usize = 512;
const SEGMENTS: usize = 8;
const COHERENT: f64 = 0.5;
/// Share of an output's power that must lie above the frequencies that rows resolve: less is what the spectrum's window lets through of the motion.
const NOISE: f64 = 1e-7;

/// Whether input and output move together above the frequencies that rows of `step` samples resolve.
///
/// A controller behind the recorded input answers the noise of the sensor: of two samples in one row the input at the first says what the noise
/// of both was. Rows would know the noise beforehand, and any fast path from the input to the output would predict it. Where nothing is coherent, as in
/// an open loop whose output is noise up there, nothing is lost by means.
pub fn together(u: &[f64], y: &[f64], step: usize) -> bool {
    let present = u.iter().zip(y).map(|(u, y)| u.is_finite() && y.is_finite());
    let Some(longest) = runs(present).into_iter().max_by_key(|r| r.len()) else { return false };
    let segment = SEGMENT.min(longest.len() / SEGMENTS);
    let Ok(spectrum) = hysid_signal::cross_spectrum(&u[longest.clone()], &y[longest], 1.0, segment) else {
        return false;
    };
    let above = spectrum.frequency_hz.partition_point(|f| *f <= 0.5 / step as f64);
    let power = |lines: &[f64]| lines.iter().sum::<f64>();
    let coherence = &spectrum.coherence()[above..];
    power(&spectrum.yy[above..]) > NOISE * power(&spectrum.yy) && power(coherence) > COHERENT * coherence.len() as f64
}

/// Means of the series over `step` samples about every `step`-th, the first one included; at the ends over those that there are.
pub fn thin(x: &[f64], step: usize) -> Cow<'_, [f64]> {
    if step <= 1 {
        return Cow::Borrowed(x);
    }
    let before = step / 2;
    let rows = (0..x.len()).step_by(step).map(|n| {
        let part = &x[n.saturating_sub(before)..(n + step - before).min(x.len())];
        part.iter().sum::<f64>() / part.len() as f64
    });
    Cow::Owned(rows.collect())
}

/// The last sample of a row of `step` samples, from the one in whose place the row stands.
pub fn end_of_row(step: usize) -> usize {
    step.saturating_sub(step / 2 + 1)
}

#[cfg(test)]
mod tests {
    use super::super::DataSet;
    use super::super::samples::{recording, simulation};
    use super::*;

    fn sine(cycles_a_sample: f64, n: usize) -> Vec<f64> {
        (0..n).map(|i| (std::f64::consts::TAU * cycles_a_sample * i as f64).sin()).collect()
    }

    #[test]
    fn slow_signals_pass_and_fast_ones_hardly_do() {
        for (cycles, at_least, at_most) in [(0.002, 0.999, 1.0), (0.23, 0.0, 0.15)] {
            let omega = std::f64::consts::TAU * cycles;
            // Ten samples have their middle half a sample before the one in whose place they stand.
            let passed = (5.0 * omega).sin() / (10.0 * (0.5 * omega).sin());
            assert!((at_least..at_most).contains(&passed.abs()), "{cycles}: {passed}");
            for (n, v) in thin(&sine(cycles, 2000), 10).iter().enumerate().skip(1) {
                let expected = passed * (omega * (10.0 * n as f64 - 0.5)).sin();
                assert!((v - expected).abs() < 1e-9, "{n}: {v} {expected}");
            }
        }
        assert!(thin(&[3.0; 100], 7).iter().all(|v| (v - 3.0).abs() < 1e-12));
    }

    #[test]
    fn a_controller_that_answers_the_noise_is_seen_and_an_open_loop_is_not() {
        let n = 4000;
        let noise = hysid_signal::white_noise(n, 1e-4, 3).unwrap();
        let reference = sine(0.003, n);
        // A servo axis: the torque answers what the sensor says, or the reference alone.
        let axis = |feedback: f64| {
            let (mut q, mut w) = (0.0, 0.0);
            let mut columns = (Vec::new(), Vec::new());
            for (r, e) in reference.iter().zip(&noise) {
                let seen = q + e;
                let u = 0.2 * (r - feedback * seen);
                columns.0.push(u);
                columns.1.push(seen);
                w += 0.02 * u - 0.05 * w;
                q += w;
            }
            columns
        };
        for (feedback, expected) in [(1.0, true), (0.0, false)] {
            let (u, y) = axis(feedback);
            assert_eq!(together(&u, &y, 2), expected, "{feedback}");
            let mut cut = y.clone();
            cut[1000..1100].fill(f64::NAN);
            assert_eq!(together(&u, &cut, 4), expected, "{feedback}, with a gap");
        }
    }

    #[test]
    fn each_sample_counts_in_one_row_so_that_white_noise_stays_white() {
        for (step, n) in [(2, 41), (3, 40), (10, 101)] {
            let count = thin(&vec![0.0; n], step).len();
            assert_eq!(count, n.div_ceil(step));
            let rows_of = |sample: usize| {
                let mut x = vec![0.0; n];
                x[sample] = 1.0;
                thin(&x, step).iter().enumerate().filter(|(_, v)| **v != 0.0).map(|(row, _)| row).collect::<Vec<_>>()
            };
            let last = (count - 1) * step;
            assert!((0..=last).all(|sample| rows_of(sample) == [(sample + step / 2) / step]), "{step}");
        }
    }

    #[test]
    fn what_lies_between_many_gaps_is_not_thinned_away() {
        let n = 20_000;
        let set = |missing: &dyn Fn(usize) -> bool| {
            let mut y = sine(0.002, n);
            (0..n).filter(|i| missing(*i)).for_each(|i| y[i] = f64::NAN);
            let mut simulation = simulation();
            simulation.time.clock = hysid_plant::ClockSource::Period(1e-3);
            DataSet::new(&simulation, &[recording(sine(0.002, n), y)], 1).unwrap()
        };
        assert_eq!(set(&|_| false).own_step(), 10);
        let cut = set(&|i| i % 60 == 59);
        assert!((2..=8).contains(&cut.own_step()), "{}", cut.own_step());
        assert!(cut.thinned().rows() * cut.own_step() > 9 * n / 10);
        // Fifteen samples make eight rows of two, and no series of fewer.
        assert_eq!(set(&|i| i % 16 == 15).own_step(), 2);
    }

    #[test]
    fn only_long_recordings_of_slow_signals_are_thinned() {
        let period = 1e-3;
        assert_eq!(step([sine(0.002, 20_000).as_slice()].into_iter(), period, 20_000), 10);
        assert_eq!(step([sine(0.002, 3000).as_slice()].into_iter(), period, 3000), 1);
        assert_eq!(step([sine(0.1, 20_000).as_slice()].into_iter(), period, 20_000), 1);
    }
}
