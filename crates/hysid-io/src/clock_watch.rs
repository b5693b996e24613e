//! The judgement whether a clock is uniform, for time stamps that arrive block by block.
//!
//! The period comes from the first block, judged as a whole by [`fit_clock`]; from there on each step must be a period, to what the rounding of
//! the stamps and the jitter that [`fit_clock`] allows make of it. One missing row makes a step of two periods, which cannot pass. A slow drift
//! of the rate over the file can.

use crate::clock::{fit_clock, step_tolerance};
use crate::error::InputProblem;

/// A clock under watch.
#[derive(Debug, Clone, Default)]
pub struct ClockWatch {
    period_s: Option<f64>,
    last: f64,
}

impl ClockWatch {
    /// No stamp seen yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// The period in seconds, once the first block is judged.
    pub fn period_s(&self) -> Option<f64> {
        self.period_s
    }

    /// Judges the next stamps, which were written with at most `decimals` decimals.
    ///
    /// # Errors
    /// The index of the stamp at fault in `t`, and what is wrong with it, as [`fit_clock`] tells it.
    pub fn judge(&mut self, t: &[f64], decimals: u32) -> Result<(), (usize, InputProblem)> {
        let Some(period) = self.period_s else {
            self.period_s = Some(fit_clock(t, decimals)?.period_s);
            self.last = t.last().copied().unwrap_or(0.0);
            return Ok(());
        };
        let largest = t.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        let allowed = 2.0 * step_tolerance(period, decimals, largest);
        for (n, &here) in t.iter().enumerate() {
            let step = here - self.last;
            if !((step - period).abs() <= allowed && step > 0.0) {
                let problem = if !here.is_finite() {
                    InputProblem::MissingTime
                } else if step == 0.0 {
                    InputProblem::DuplicateTime(here)
                } else if step < 0.0 {
                    InputProblem::DecreasingTime { before: self.last, here }
                } else {
                    InputProblem::NonUniformClock { here, expected: self.last + period, period }
                };
                return Err((n, problem));
            }
            self.last = here;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Stamps of a clock as a file with so many decimals holds them.
    fn stamps(period: f64, decimals: u32, n: usize) -> Vec<f64> {
        let unit = 10_f64.powi(decimals as i32);
        (0..n).map(|k| (k as f64 * period * unit).round() / unit).collect()
    }

    fn judge(t: &[f64], decimals: u32, block: usize) -> Result<(), (usize, InputProblem)> {
        let mut watch = ClockWatch::new();
        for (b, part) in t.chunks(block).enumerate() {
            watch.judge(part, decimals).map_err(|(n, p)| (b * block + n, p))?;
        }
        Ok(())
    }

    #[test]
    fn a_uniform_clock_passes_and_what_breaks_it_is_told() {
        for (period, decimals) in [(0.001_638_4, 5), (1.0 / 51_200.0, 8), (0.01, 2), (1.0 / 750.0, 5), (0.1, 1)] {
            let good = stamps(period, decimals, 50_000);
            assert_eq!(judge(&good, decimals, 1000), Ok(()));
            let mut missing = good.clone();
            missing.remove(30_001);
            let (n, problem) = judge(&missing, decimals, 1000).unwrap_err();
            assert!(n == 30_001 && matches!(problem, InputProblem::NonUniformClock { .. }), "{n} {problem}");
        }
        let good = stamps(0.5, 1, 5000);
        let with = |n: usize, x: f64| {
            let mut t = good.clone();
            t[n] = x;
            judge(&t, 1, 1000).unwrap_err()
        };
        assert_eq!(with(3000, good[2999]), (3000, InputProblem::DuplicateTime(good[2999])));
        assert_eq!(with(3000, f64::NAN), (3000, InputProblem::MissingTime));
        assert!(matches!(with(3000, 1.0), (3000, InputProblem::DecreasingTime { .. })));
        assert_eq!(judge(&[0.0], 1, 9), Err((0, InputProblem::TooFewSamples { found: 1, needed: 2 })));
    }
}
