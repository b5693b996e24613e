//! Free runs over windows, and the derivatives of a free run.
//!
//! A window is a stretch of samples; its first samples are given, from there on the model runs on its own output.
//! The derivative of a free run to theta_k obeys the model's own linearisation,
//! psi_k\[n\] = phi_k\[n\] + sum_l (df/dy\[n-l\]) psi_k\[n-l\]. The same recursion, driven by a candidate's column, tells how much
//! of the free-run residual that candidate would explain.

use std::ops::Range;

use crate::program::Program;
use crate::{Bank, NarxError};

/// A stretch of samples of one recording over which a model runs.
#[derive(Debug, Clone, PartialEq)]
pub struct Window {
    /// Number of the recording.
    pub record: usize,
    /// Its samples; the first ones start the run.
    pub range: Range<usize>,
}

/// How runs are made: what is given at the start, when a run has diverged, what counts as a change of sign.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rules {
    /// Samples given at the start of each window, at least the program's reach.
    pub given: usize,
    /// A run whose output exceeds this size has diverged.
    pub limit: f64,
    /// A difference of the output within this size leaves its sign as it was.
    pub threshold: f64,
}

/// One window's run.
#[derive(Debug, Clone)]
pub(crate) struct Trace {
    /// The output over the window, the given samples first; recorded values after a divergence.
    pub y: Vec<f64>,
    /// The sign of its difference.
    pub sign: Vec<f64>,
    /// The first sample of the recording at which it diverged.
    pub diverged: Option<usize>,
}

/// Runs the program over one window of `bank`.
pub(crate) fn run(
    program: &Program,
    theta: &[f64],
    bank: &Bank,
    window: &Range<usize>,
    rules: Rules,
) -> Result<Trace, NarxError> {
    let inputs = program.inputs(bank)?;
    let mut y = bank.y[window.clone()].to_vec();
    let mut sign = bank.y_sign[window.clone()].to_vec();
    let mut v = vec![0.0; program.factors.len()];
    let mut diverged = None;
    for i in rules.given..y.len() {
        let n = window.start + i;
        program.factor_values(n, i, &y, &sign, &inputs, &mut v);
        let sum = program.sum(theta, &v);
        if !(sum.abs() <= rules.limit) {
            diverged = Some(n);
            break;
        }
        y[i] = sum;
        if i > 0 {
            sign[i] = hysid_dictionary::next_sign(sign[i - 1], sum - y[i - 1], rules.threshold);
        }
    }
    Ok(Trace { y, sign, diverged })
}

/// The runs over several windows and their error.
#[derive(Debug, Clone)]
pub(crate) struct Outcome {
    pub traces: Vec<Trace>,
    /// Sum of squared errors over the samples that were run.
    pub sse: f64,
    /// Number of these samples.
    pub samples: usize,
    /// Record and sample of the first divergence.
    pub diverged: Option<(usize, usize)>,
}

impl Outcome {
    /// Root mean square error; infinite after a divergence.
    pub(crate) fn rmse(&self) -> f64 {
        if self.diverged.is_some() { f64::INFINITY } else { (self.sse / self.samples.max(1) as f64).sqrt() }
    }
}

/// Runs over `windows`; stops at the first divergence.
pub(crate) fn run_all(
    program: &Program,
    theta: &[f64],
    banks: &[Bank],
    windows: &[Window],
    rules: Rules,
) -> Result<Outcome, NarxError> {
    let mut outcome = Outcome { traces: Vec::with_capacity(windows.len()), sse: 0.0, samples: 0, diverged: None };
    for window in windows {
        let bank = bank_of(banks, window.record)?;
        let trace = run(program, theta, bank, &window.range, rules)?;
        if let Some(n) = trace.diverged {
            outcome.diverged = Some((window.record, n));
            return Ok(outcome);
        }
        for (e, y) in bank.y[window.range.clone()].iter().zip(&trace.y).skip(rules.given) {
            outcome.sse += (e - y) * (e - y);
            outcome.samples += 1;
        }
        outcome.traces.push(trace);
    }
    Ok(outcome)
}

pub(crate) fn bank_of(banks: &[Bank], record: usize) -> Result<&Bank, NarxError> {
    banks.get(record).ok_or_else(|| NarxError::BadRecord { record, problem: "there is no such recording".into() })
}

/// Calls `sink` with the sample number and the row psi for each run sample of one window, in order.
///
/// `model` with `theta` is linearised along `along`; `columns` gives what drives the recursion, evaluated along `driven`
/// (the same trace, or the recorded output).
#[expect(clippy::too_many_arguments, reason = "two programs on two traces: a struct would only rename them")]
pub(crate) fn sensitivities(
    model: &Program,
    theta: &[f64],
    along: &Trace,
    columns: &Program,
    driven: &Trace,
    bank: &Bank,
    window: &Range<usize>,
    rules: Rules,
    mut sink: impl FnMut(usize, &[f64]),
) -> Result<(), NarxError> {
    let (model_inputs, column_inputs) = (model.inputs(bank)?, columns.inputs(bank)?);
    let lags = model.output_lags;
    let width = columns.len();
    let mut jacobian = vec![0.0; lags + 2];
    let (mut v, mut w) = (vec![0.0; model.factors.len()], vec![0.0; columns.factors.len()]);
    // The last `lags` rows, as a ring.
    let mut ring = vec![0.0; lags.max(1) * width];
    let mut row = vec![0.0; width];
    // Mostly a model's own columns are asked for, along its own run: the factors' values are the same then.
    let same = std::ptr::eq(model, columns) && std::ptr::eq(along, driven);
    for i in rules.given..window.len() {
        let n = window.start + i;
        columns.factor_values(n, i, &driven.y, &driven.sign, &column_inputs, &mut w);
        for (k, r) in row.iter_mut().enumerate() {
            *r = columns.term(k, &w);
        }
        if lags > 0 {
            if !same {
                model.factor_values(n, i, &along.y, &along.sign, &model_inputs, &mut v);
            }
            jacobian.fill(0.0);
            model.output_jacobian(theta, if same { &w } else { &v }, &mut jacobian);
            for l in 1..=lags.min(i - rules.given) {
                let j = jacobian[l];
                if j != 0.0 {
                    let at = ((i - l) % lags) * width;
                    for (r, p) in row.iter_mut().zip(&ring[at..at + width]) {
                        *r += j * p;
                    }
                }
            }
            let at = (i % lags) * width;
            ring[at..at + width].copy_from_slice(&row);
        }
        sink(n, &row);
    }
    Ok(())
}
