//! Simulation-error refinement: the coefficients (and the derived inputs' numbers) that minimise the error of the free run.
//!
//! Least squares on one-step errors is biased when the output carries noise, and small biases accumulate in a free run. Here
//! the residual is that of the free run itself; its derivatives come from the model's linearisation along the run
//! ([`crate::run::sensitivities`]), those to the derived inputs' numbers by differences. Levenberg-Marquardt with
//! equilibrated columns. References: Farina and Piroddi, *Int. J. Control* 83 (2010) 1118; Nocedal and Wright, ch. 10.

use crate::normal::Normal;
use crate::program::Program;
use crate::run::{Outcome, Rules, Window, bank_of, run_all, sensitivities};
use crate::{Bank, Derived, NarxError};
use hysid_dictionary::Signals;

/// What refinement may move.
#[derive(Debug, Clone)]
pub(crate) struct Point {
    pub theta: Vec<f64>,
    pub derived: Vec<Derived>,
}

/// How far refinement goes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Effort {
    /// Largest number of accepted steps.
    pub steps: usize,
    /// It ends when a step lowers the squared error by less than this share.
    pub least_gain: f64,
    /// Whether the derived inputs' numbers move too.
    pub scope: Scope,
}

/// Which numbers move.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Scope {
    /// The coefficients only.
    Coefficients,
    /// The coefficients and the numbers of the derived inputs.
    CoefficientsAndDerived,
}

/// The refined point and its run, which may be a diverged one if even the first was.
#[derive(Debug, Clone)]
pub(crate) struct Refined {
    pub point: Point,
    pub outcome: Outcome,
}

/// Minimises the free-run error of `program` over `windows`, starting from `start`.
///
/// `banks` hold the derived inputs of the returned point when it returns.
pub(crate) fn refine(
    program: &Program,
    start: Point,
    banks: &mut [Bank],
    windows: &[Window],
    rules: Rules,
    signals: &Signals,
    effort: Effort,
) -> Result<Refined, NarxError> {
    let mut at = start;
    let mut outcome = run_all(program, &at.theta, banks, windows, rules)?;
    let mut mse = mean(&outcome);
    let mut lambda = 1e-8;
    let mut steps = 0;
    while mse.is_finite() && mse > 0.0 && steps < effort.steps {
        let normal = normal_equations(program, &at, banks, windows, rules, signals, &outcome, effort.scope)?;
        if !normal.is_finite() {
            break;
        }
        let mut accepted = None;
        for _ in 0..9 {
            let candidate = normal.step(lambda).and_then(|s| moved(&at, &s));
            if let Some(point) = candidate {
                let with_derived = point.derived != at.derived;
                if with_derived {
                    set_all(banks, &point.derived, signals);
                }
                let run = run_all(program, &point.theta, banks, windows, rules)?;
                let m = mean(&run);
                if m < mse {
                    accepted = Some((point, run, m));
                    break;
                }
                if with_derived {
                    set_all(banks, &at.derived, signals);
                }
            }
            lambda = (lambda * 10.0f64).max(1e-8);
        }
        let Some((point, run, m)) = accepted else { break };
        let gain = 1.0 - m / mse;
        (at, outcome, mse) = (point, run, m);
        lambda = (lambda / 10.0).max(1e-13);
        steps += 1;
        if gain < effort.least_gain {
            break;
        }
    }
    Ok(Refined { point: at, outcome })
}

pub(crate) fn mean(outcome: &Outcome) -> f64 {
    let rmse = outcome.rmse();
    rmse * rmse
}

pub(crate) fn set_all(banks: &mut [Bank], derived: &[Derived], signals: &Signals) {
    for bank in banks {
        bank.set_derived(derived, signals);
    }
}

/// The point after a step in theta and, if the step is longer, in the derived inputs' numbers.
fn moved(at: &Point, step: &[f64]) -> Option<Point> {
    let mut rest = step.iter();
    let theta: Vec<f64> = at.theta.iter().zip(rest.by_ref()).map(|(t, s)| t + s).collect();
    let mut derived = at.derived.clone();
    if rest.len() > 0 {
        for d in &mut derived {
            let p: Vec<f64> = d.law.parameters().iter().zip(rest.by_ref()).map(|(p, s)| p + s).collect();
            d.law = d.law.with_parameters(&p)?;
        }
    }
    theta.iter().all(|t| t.is_finite()).then_some(Point { theta, derived })
}

#[expect(clippy::too_many_arguments, reason = "the same eight things that refinement is about")]
fn normal_equations(
    program: &Program,
    at: &Point,
    banks: &mut [Bank],
    windows: &[Window],
    rules: Rules,
    signals: &Signals,
    outcome: &Outcome,
    scope: Scope,
) -> Result<Normal, NarxError> {
    let extra = match scope {
        Scope::Coefficients => Vec::new(),
        Scope::CoefficientsAndDerived => derived_columns(program, at, banks, windows, rules, signals, outcome)?,
    };
    let width = at.theta.len() + extra.len();
    let mut normal = Normal::new(width);
    let mut full = vec![0.0; width];
    for (w, (window, trace)) in windows.iter().zip(&outcome.traces).enumerate() {
        let bank = bank_of(banks, window.record)?;
        sensitivities(program, &at.theta, trace, program, trace, bank, &window.range, rules, |n, row| {
            let i = n - window.range.start;
            full[..row.len()].copy_from_slice(row);
            for (f, column) in full[row.len()..].iter_mut().zip(&extra) {
                *f = column[w][i];
            }
            normal.add(&full, bank.y[n] - trace.y[i]);
        })?;
    }
    normal.finish();
    Ok(normal)
}

/// For each number of the derived inputs, the derivative of each window's run to it, by differences.
fn derived_columns(
    program: &Program,
    at: &Point,
    banks: &mut [Bank],
    windows: &[Window],
    rules: Rules,
    signals: &Signals,
    outcome: &Outcome,
) -> Result<Vec<Vec<Vec<f64>>>, NarxError> {
    let mut columns = Vec::new();
    for d in 0..at.derived.len() {
        let p = at.derived[d].law.parameters();
        for i in 0..p.len() {
            let mut column: Option<Vec<Vec<f64>>> = None;
            for sign in [1.0, -1.0] {
                let h = sign * 1e-6 * p[i].abs().max(1e-3);
                let mut moved = p.clone();
                moved[i] += h;
                let Some(law) = at.derived[d].law.with_parameters(&moved) else { continue };
                let mut derived = at.derived.clone();
                derived[d].law = law;
                set_all(banks, &derived, signals);
                let run = run_all(program, &at.theta, banks, windows, rules)?;
                if run.diverged.is_none() {
                    let slope = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b) / h).collect();
                    column = Some(run.traces.iter().zip(&outcome.traces).map(|(a, b)| slope(&a.y, &b.y)).collect());
                    break;
                }
            }
            columns.push(column.unwrap_or_else(|| outcome.traces.iter().map(|t| vec![0.0; t.y.len()]).collect()));
        }
    }
    set_all(banks, &at.derived, signals);
    Ok(columns)
}
