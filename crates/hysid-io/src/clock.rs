//! The uniform clock behind a column of time stamps, and the judgement whether there is one.
//!
//! Time stamps in files are rounded (0.00164 for 0.0016384), so a period is never read off two neighbours: it comes from the whole
//! span. Of all periods that the rounding allows, the one with the shortest decimal form, as a period or as a rate, is taken.
//!
//! A stamp may lie off the uniform clock by its rounding (one unit of its last decimal, but never more than a quarter of a period) or
//! by 5 % of the period, whichever is more. One missing row puts some stamp at least half a period off, so it cannot pass.

use crate::error::InputProblem;

/// Share of a period by which a time stamp may lie off the uniform clock.
const JITTER: f64 = 0.05;
/// Largest share of a period that the rounding of the stamps may excuse.
const COARSEST: f64 = 0.25;

/// A uniform clock fitted to time stamps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClockFit {
    /// Time of the first sample, in seconds.
    pub start_s: f64,
    /// Sampling period, in seconds.
    pub period_s: f64,
    /// Largest distance of a time stamp from the fitted clock, in seconds.
    pub largest_deviation_s: f64,
    /// Root mean square of these distances, in seconds.
    pub rms_deviation_s: f64,
}

/// The uniform clock behind the stamps `t`, which were written with `decimals` decimals.
///
/// # Errors
/// The index of the stamp at fault, and what is wrong: fewer than two stamps, a missing one, time that stands still or goes back,
/// a clock that is not uniform.
pub fn fit_clock(t: &[f64], decimals: u32) -> Result<ClockFit, (usize, InputProblem)> {
    let (Some(&first), Some(&last)) = (t.first(), t.last()) else {
        return Err((0, InputProblem::TooFewSamples { found: 0, needed: 2 }));
    };
    if let Some(n) = t.iter().position(|x| !x.is_finite()) {
        return Err((n, InputProblem::MissingTime));
    }
    for (n, pair) in t.windows(2).enumerate() {
        if pair[1] == pair[0] {
            return Err((n + 1, InputProblem::DuplicateTime(pair[1])));
        }
        if pair[1] < pair[0] {
            return Err((n + 1, InputProblem::DecreasingTime { before: pair[0], here: pair[1] }));
        }
    }
    if t.len() < 2 {
        return Err((0, InputProblem::TooFewSamples { found: t.len(), needed: 2 }));
    }
    let steps = (t.len() - 1) as f64;
    let rough = (last - first) / steps;
    let largest = last.abs().max(first.abs());
    let allowed = step_tolerance(rough, decimals, largest);
    let worst = t
        .iter()
        .enumerate()
        .map(|(n, &x)| (n, (x - (first + rough * n as f64)).abs()))
        .fold((0, 0.0), |a, b| if b.1 > a.1 { b } else { a });
    if worst.1 > allowed {
        return Err(uneven(t, rough, allowed));
    }
    // Half a unit of rounding at either end of the span bounds the error of the rough period; least squares lies well inside.
    let slack = (rounding(rough, decimals) + arithmetic(largest)) / steps;
    let period_s = shortest(least_squares_period(t, first), slack);
    let off = |n: usize, x: f64| (x - (first + period_s * n as f64)).abs();
    let (mut largest, mut sum) = (0.0_f64, 0.0);
    for (n, &x) in t.iter().enumerate() {
        largest = largest.max(off(n, x));
        sum += off(n, x).powi(2);
    }
    Ok(ClockFit {
        start_s: first,
        period_s,
        largest_deviation_s: largest,
        rms_deviation_s: (sum / t.len() as f64).sqrt(),
    })
}

/// By how much stamps of this period, number of decimals and largest size may lie off their clock.
pub(crate) fn step_tolerance(period: f64, decimals: u32, largest: f64) -> f64 {
    (JITTER * period).max(rounding(period, decimals)) + arithmetic(largest)
}

/// What the rounding of stamps to this many decimals excuses.
fn rounding(period: f64, decimals: u32) -> f64 {
    10_f64.powi(-(decimals.min(300) as i32)).min(COARSEST * period)
}

/// What arithmetic with stamps of this size excuses.
fn arithmetic(largest: f64) -> f64 {
    4.0 * f64::EPSILON * largest
}

/// Where the clock first leaves the median step, so that the message points at the row at fault and not at the farthest one.
fn uneven(t: &[f64], rough: f64, allowed: f64) -> (usize, InputProblem) {
    let period = hysid_signal::median(t.windows(2).map(|p| p[1] - p[0]).collect());
    let jump = t.windows(2).position(|p| (p[1] - p[0] - period).abs() > 2.0 * allowed.min(0.4 * period));
    let n = match jump {
        Some(k) => k + 1,
        None => t.iter().enumerate().position(|(n, &x)| (x - (t[0] + rough * n as f64)).abs() > allowed).unwrap_or(0),
    };
    let (from, period) = if jump.is_some() { (t[n - 1] - period * (n - 1) as f64, period) } else { (t[0], rough) };
    (n, InputProblem::NonUniformClock { here: t[n], expected: from + period * n as f64, period })
}

fn least_squares_period(t: &[f64], first: f64) -> f64 {
    let middle = (t.len() - 1) as f64 / 2.0;
    let mean = t.iter().map(|x| x - first).sum::<f64>() / t.len() as f64;
    let (mut top, mut bottom) = (0.0, 0.0);
    for (n, x) in t.iter().enumerate() {
        let k = n as f64 - middle;
        top += k * (x - first - mean);
        bottom += k * k;
    }
    top / bottom
}

/// The period within `slack` of `period` with the fewest digits, as a period or as a rate.
fn shortest(period: f64, slack: f64) -> f64 {
    for digits in 0..16 {
        let round = |x: f64| format!("{x:.digits$e}").parse::<f64>().unwrap_or(x);
        let as_period = round(period);
        if (as_period - period).abs() <= slack {
            return as_period;
        }
        let as_rate = 1.0 / round(1.0 / period);
        if (as_rate - period).abs() <= slack {
            return as_rate;
        }
    }
    period
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stamps(period: f64, decimals: u32, n: usize) -> Vec<f64> {
        let unit = 10_f64.powi(decimals as i32);
        (0..n).map(|k| (k as f64 * period * unit).round() / unit).collect()
    }

    #[test]
    fn rounded_stamps_give_their_period_back() {
        let cases = [
            (0.0016384, 5, 65_062),
            (1.0 / 51_200.0, 8, 40_000),
            (0.01, 2, 3_001),
            (0.001, 3, 24_841),
            (1.0 / 750.0, 5, 40_960),
            (0.000156_25, 6, 8_192),
            (0.1, 1, 2),
        ];
        for (period, decimals, n) in cases {
            let fit = fit_clock(&stamps(period, decimals, n), decimals).unwrap();
            assert!((fit.period_s / period - 1.0).abs() < 1e-15, "{period}: {}", fit.period_s);
        }
        let fit = fit_clock(&stamps(1.0 / 60.94, 5, 120), 5).unwrap();
        assert!((fit.period_s * 60.94 - 1.0).abs() < 1e-5);
    }

    #[test]
    fn what_is_no_uniform_clock_is_refused_where_it_breaks() {
        let mut missing_row = stamps(0.01, 2, 2000);
        missing_row.remove(700);
        let mut jitter = stamps(0.01, 4, 100);
        jitter[40] += 0.002;
        let chirp: Vec<f64> = (0..200).map(|k| 0.01 * k as f64 + 2e-5 * (k * k) as f64).collect();
        for (t, decimals, at) in [(missing_row, 2, Some(700)), (jitter, 4, Some(40)), (chirp, 8, None)] {
            let (n, problem) = fit_clock(&t, decimals).unwrap_err();
            assert!(matches!(problem, InputProblem::NonUniformClock { .. }), "{problem}");
            assert!(at.is_none_or(|a| a == n), "{n}");
        }
    }

    #[test]
    fn time_must_run_forward() {
        let e = |t: &[f64]| fit_clock(t, 1).unwrap_err();
        assert_eq!(e(&[0.0, 0.1, 0.1, 0.2]), (2, InputProblem::DuplicateTime(0.1)));
        assert_eq!(e(&[0.0, 0.2, 0.1]), (2, InputProblem::DecreasingTime { before: 0.2, here: 0.1 }));
        assert_eq!(e(&[0.0, f64::NAN]), (1, InputProblem::MissingTime));
        assert_eq!(e(&[0.0]), (0, InputProblem::TooFewSamples { found: 1, needed: 2 }));
        assert_eq!(e(&[]), (0, InputProblem::TooFewSamples { found: 0, needed: 2 }));
    }
}
