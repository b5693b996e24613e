//! How many integration steps a sampling period needs: the step-halving check.

use super::Compiled;
use super::drive::Drive;
use super::run::{Run, Start};

/// Most steps in one sampling period that are tried.
pub const MOST_STEPS: usize = 64;

/// The result of a step-halving check.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepCheck {
    /// Steps in each sampling period.
    pub substeps: usize,
    /// Largest over the outputs: rms change of the output on twice as many steps, relative to the output's rms about its
    /// mean. `NaN` where the simulation diverged on every number of steps.
    pub error: f64,
}

impl Compiled {
    /// The smallest number of steps in each period (1, 2, 3, 4, 6, 8, 12, ..., 64) whose response changes by less than
    /// `tolerance` on twice as many, or the most accurate one that was tried.
    ///
    /// Judged on the whole drive: a sweep asks for little before it is fast.
    pub fn check_steps(&self, drive: &Drive, theta: &[f64], start: Start<'_>, tolerance: f64) -> StepCheck {
        if self.simulation.states.is_empty() {
            return StepCheck { substeps: 1, error: 0.0 };
        }
        let outputs = |substeps| self.simulate(&Run::new(drive, theta).from(start).with_substeps(substeps));
        let mut best = StepCheck { substeps: MOST_STEPS, error: f64::NAN };
        let mut known: Vec<(usize, super::Response)> = Vec::new();
        for substeps in [1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64] {
            for wanted in [substeps, 2 * substeps] {
                if !known.iter().any(|(s, _)| *s == wanted) {
                    known.push((wanted, outputs(wanted)));
                }
            }
            let find = |wanted: usize| known.iter().find(|(s, _)| *s == wanted).map(|(_, r)| r);
            let (Some(coarse), Some(fine)) = (find(substeps), find(2 * substeps)) else { continue };
            if coarse.diverged.is_some() || fine.diverged.is_some() {
                continue;
            }
            let pairs = coarse.outputs.iter().zip(&fine.outputs);
            let error = pairs.map(|(a, b)| relative_change(a, b)).fold(0.0, f64::max);
            if best.error.is_nan() || error < best.error {
                best = StepCheck { substeps, error };
            }
            if error < tolerance {
                return StepCheck { substeps, error };
            }
        }
        best
    }
}

fn relative_change(a: &[f64], b: &[f64]) -> f64 {
    let n = b.len() as f64;
    let mean = b.iter().sum::<f64>() / n;
    let spread: f64 = b.iter().map(|y| (y - mean).powi(2)).sum();
    let change: f64 = a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum();
    if change == 0.0 { 0.0 } else { (change / spread.max(f64::MIN_POSITIVE)).sqrt() }
}

impl Drive {
    /// The first `len` samples.
    pub fn shortened(&self, len: usize) -> Drive {
        let len = len.min(self.len);
        let cut = |all: &[Vec<f64>]| all.iter().map(|s| s.get(..len).unwrap_or(s).to_vec()).collect();
        Drive { inputs: cut(&self.inputs), rates: cut(&self.rates), len, ..*self }
    }
}
