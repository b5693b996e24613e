//! Growth of a model on recordings: the next term, the least needed term, standard errors, all from what each term does to the
//! free run.

use hysid_dictionary::Term;

use crate::normal::Normal;
use crate::program::Program;
use crate::run::{Trace, Window, bank_of, run_all, sensitivities};
use crate::{Fit, NarxError, Trainer};

/// A candidate that would lower the free-run error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gain {
    /// Its number among the candidates.
    pub candidate: usize,
    /// Share of the squared free-run residual that it explains, beside the present terms and those before it.
    pub share: f64,
}

/// On which trace candidates are evaluated when the next term is sought.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Evaluate {
    /// On the recorded output: right while the model is still far from the recording.
    Recorded,
    /// On the model's own free run: free of the recording's noise.
    FreeRun,
}

/// A candidate whose free-run column lies this close to the span of the present ones is passed over.
const COLLINEAR: f64 = 1e-9;

impl Trainer {
    /// The `count` candidates that explain most of the free-run residual, each beside those before it.
    ///
    /// Orthogonal forward regression in which every column, of candidates and of present terms, is what that term does to
    /// the free run. Empty where the run diverges or nothing helps.
    ///
    /// # Errors
    /// Windows of recordings that there are not.
    pub fn next_terms(
        &mut self,
        fit: &Fit,
        candidates: &[Term],
        windows: &[Window],
        count: usize,
        evaluate: Evaluate,
    ) -> Result<Vec<Gain>, NarxError> {
        self.enter(&fit.derived);
        let model = Program::new(&fit.terms);
        let outcome = run_all(&model, &fit.theta, &self.banks, windows, self.rules)?;
        if outcome.diverged.is_some() {
            return Ok(Vec::new());
        }
        let all: Vec<Term> = fit.terms.iter().chain(candidates).cloned().collect();
        let columns = Program::new(&all);
        let (present, width) = (fit.terms.len(), all.len());
        let mut rows: Vec<f64> = Vec::new();
        let mut residual = Vec::new();
        for (window, trace) in windows.iter().zip(&outcome.traces) {
            let bank = bank_of(&self.banks, window.record)?;
            let recorded;
            let driven = match evaluate {
                Evaluate::FreeRun => trace,
                Evaluate::Recorded => {
                    recorded = Trace {
                        y: bank.y[window.range.clone()].to_vec(),
                        sign: bank.y_sign[window.range.clone()].to_vec(),
                        diverged: None,
                    };
                    &recorded
                }
            };
            sensitivities(&model, &fit.theta, trace, &columns, driven, bank, &window.range, self.rules, |n, row| {
                rows.extend_from_slice(row);
                residual.push(bank.y[n] - trace.y[n - window.range.start]);
            })?;
        }
        Ok(forward(&rows, &residual, width, present, count))
    }

    /// What the squared free-run error over the windows would rise by, as a share of it, without each term.
    ///
    /// Exact for a quadratic error: theta_k^2 / \[(J'J)^-1\]_kk. Empty where the run diverges.
    ///
    /// # Errors
    /// Windows of recordings that there are not.
    pub fn need_of_terms(&mut self, fit: &Fit, windows: &[Window]) -> Result<Vec<f64>, NarxError> {
        let Some((normal, _, sse, _)) = self.normal(fit, windows, usize::MAX)? else { return Ok(Vec::new()) };
        let inverse = normal.inverse_diagonal().unwrap_or_else(|| vec![f64::INFINITY; fit.theta.len()]);
        Ok(fit.theta.iter().zip(inverse).map(|(t, v)| t * t / v / sse.max(f64::MIN_POSITIVE)).collect())
    }

    /// Standard errors of the coefficients from the free-run residual over the windows.
    ///
    /// Sandwich form with the gradients of blocks of samples, so that they hold for a residual with memory.
    ///
    /// # Errors
    /// Windows of recordings that there are not.
    pub fn standard_errors(&mut self, fit: &Fit, windows: &[Window]) -> Result<Vec<f64>, NarxError> {
        let samples: usize = windows.iter().map(|w| w.range.len()).sum();
        let block = (samples / 60).max(20);
        let Some((normal, gradients, _, _)) = self.normal(fit, windows, block)? else {
            return Ok(vec![f64::NAN; fit.theta.len()]);
        };
        let variance = normal.sandwich(&gradients).unwrap_or_else(|| vec![f64::NAN; fit.theta.len()]);
        Ok(variance.into_iter().map(f64::sqrt).collect())
    }

    /// J'J, the gradient of each block of samples, the squared error and the number of samples.
    #[expect(clippy::type_complexity, reason = "a private tuple, taken apart at once")]
    fn normal(
        &mut self,
        fit: &Fit,
        windows: &[Window],
        block: usize,
    ) -> Result<Option<(Normal, Vec<Vec<f64>>, f64, usize)>, NarxError> {
        self.enter(&fit.derived);
        let program = Program::new(&fit.terms);
        let outcome = run_all(&program, &fit.theta, &self.banks, windows, self.rules)?;
        if outcome.diverged.is_some() {
            return Ok(None);
        }
        let mut normal = Normal::new(fit.theta.len());
        let mut gradients: Vec<Vec<f64>> = Vec::new();
        let mut done = 0;
        for (window, trace) in windows.iter().zip(&outcome.traces) {
            let bank = bank_of(&self.banks, window.record)?;
            sensitivities(&program, &fit.theta, trace, &program, trace, bank, &window.range, self.rules, |n, row| {
                let e = bank.y[n] - trace.y[n - window.range.start];
                normal.add(row, e);
                if done % block == 0 {
                    gradients.push(vec![0.0; row.len()]);
                }
                done += 1;
                if let Some(g) = gradients.last_mut() {
                    for (g, r) in g.iter_mut().zip(row) {
                        *g += r * e;
                    }
                }
            })?;
        }
        normal.finish();
        Ok(Some((normal, gradients, outcome.sse, outcome.samples)))
    }
}

/// Forward selection on stored rows: the first `present` columns are in, the rest compete for the residual.
fn forward(rows: &[f64], residual: &[f64], width: usize, present: usize, count: usize) -> Vec<Gain> {
    // Inner products of every column with some of them, in one pass over the rows.
    let products = |columns: std::ops::Range<usize>| {
        let mut all = vec![vec![0.0; width]; columns.len()];
        for row in rows.chunks_exact(width) {
            for (g, &r) in all.iter_mut().zip(&row[columns.clone()]) {
                if r != 0.0 {
                    for (g, x) in g.iter_mut().zip(row) {
                        *g += r * x;
                    }
                }
            }
        }
        all
    };
    let mut norm = vec![0.0; width];
    let mut right = vec![0.0; width];
    for (row, e) in rows.chunks_exact(width).zip(residual) {
        for ((s, b), x) in norm.iter_mut().zip(right.iter_mut()).zip(row) {
            *s += x * x;
            *b += x * e;
        }
    }
    let whole = norm.clone();
    let total: f64 = residual.iter().map(|e| e * e).sum();
    // Rows of the triangular factor of the columns taken so far.
    let mut taken: Vec<Vec<f64>> = Vec::new();
    let mut out = vec![false; width];
    let mut take = |j: usize, known: Option<Vec<f64>>, norm: &mut [f64], right: &mut [f64], out: &mut [bool]| {
        out[j] = true;
        if !(norm[j] > COLLINEAR * whole[j]) {
            return;
        }
        let Some(mut row) = known.or_else(|| products(j..j + 1).pop()) else { return };
        for t in &taken {
            let f = t[j];
            for (r, t) in row.iter_mut().zip(t) {
                *r -= f * t;
            }
        }
        let scale = norm[j].sqrt();
        row.iter_mut().for_each(|r| *r /= scale);
        let c = right[j] / scale;
        for ((s, b), r) in norm.iter_mut().zip(right.iter_mut()).zip(&row) {
            *s -= r * r;
            *b -= c * r;
        }
        taken.push(row);
    };
    for (j, known) in products(0..present).into_iter().enumerate() {
        take(j, Some(known), &mut norm, &mut right, &mut out);
    }
    let mut gains = Vec::new();
    for _ in 0..count {
        let mut best: Option<(usize, f64)> = None;
        for j in present..width {
            if out[j] || !(norm[j] > COLLINEAR * whole[j]) {
                continue;
            }
            let gain = right[j] * right[j] / norm[j];
            if gain.is_finite() && best.is_none_or(|(_, g)| gain > g) {
                best = Some((j, gain));
            }
        }
        let Some((j, gain)) = best.filter(|(_, g)| *g > 0.0) else { break };
        gains.push(Gain { candidate: j - present, share: gain / total.max(f64::MIN_POSITIVE) });
        take(j, None, &mut norm, &mut right, &mut out);
    }
    gains
}
