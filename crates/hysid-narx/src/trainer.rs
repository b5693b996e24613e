//! Estimation and growth of a model on recordings: least squares, refinement, the next term, the least needed term.

use hysid_dictionary::{Record, Signals, Term};
use hysid_linalg::{Matrix, TallQr, lstsq};

use crate::normal::Normal;
use crate::program::Program;
use crate::refine::{self, Point, refine};
use crate::run::{Rules, Trace, Window, bank_of, run, run_all, sensitivities};
use crate::{Bank, Derived, NarxError};

/// Terms with coefficients and the derived inputs that they may use.
#[derive(Debug, Clone, PartialEq)]
pub struct Fit {
    /// The terms.
    pub terms: Vec<Term>,
    /// Their coefficients.
    pub theta: Vec<f64>,
    /// The derived inputs, all of the trainer's.
    pub derived: Vec<Derived>,
}

/// What refinement may move.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Refine {
    /// The coefficients.
    Coefficients,
    /// The coefficients and the numbers of the derived inputs.
    CoefficientsAndDerived,
}

/// The error of free runs over windows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RunError {
    /// Root mean square; infinite where a run diverged.
    pub rmse: f64,
    /// Record and sample at which the first run diverged.
    pub diverged: Option<(usize, usize)>,
}

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

/// Recordings and everything that estimation on them needs.
#[derive(Debug, Clone)]
pub struct Trainer {
    signals: Signals,
    banks: Vec<Bank>,
    derived: Vec<Derived>,
    rules: Rules,
}

/// A candidate whose free-run column lies this close to the span of the present ones is passed over.
const COLLINEAR: f64 = 1e-9;

impl Trainer {
    /// A trainer on these recordings.
    ///
    /// `signals` names the output, the recorded inputs and the derived ones. Every window's first `given` samples start the
    /// run: at least the largest reach that will be tried. A run whose output exceeds `limit` has diverged.
    ///
    /// # Errors
    /// Records that do not fit the signals; derived inputs that are not possible.
    pub fn new(
        signals: Signals,
        derived: Vec<Derived>,
        records: &[Record<'_>],
        given: usize,
        limit: f64,
    ) -> Result<Self, NarxError> {
        let recorded = signals.inputs().len().saturating_sub(derived.len());
        for (i, d) in derived.iter().enumerate() {
            d.check(recorded + i)?;
        }
        let banks = records
            .iter()
            .enumerate()
            .map(|(i, r)| Bank::new(r, &derived, &signals).map_err(|e| at_record(e, i)))
            .collect::<Result<Vec<_>, _>>()?;
        let threshold = signals.output().threshold;
        Ok(Self { signals, banks, derived, rules: Rules { given: given.max(1), limit, threshold } })
    }

    /// The signals.
    pub fn signals(&self) -> &Signals {
        &self.signals
    }

    /// The recordings.
    pub fn banks(&self) -> &[Bank] {
        &self.banks
    }

    /// The derived inputs as they stand.
    pub fn derived(&self) -> &[Derived] {
        &self.derived
    }

    /// Number of samples that start each run.
    pub fn given(&self) -> usize {
        self.rules.given
    }

    /// One window for each gap-free stretch that is longer than the start.
    pub fn whole_windows(&self) -> Vec<Window> {
        let mut windows = Vec::new();
        for (record, bank) in self.banks.iter().enumerate() {
            for s in bank.stretches().iter().filter(|s| s.len() > self.rules.given) {
                windows.push(Window { record, range: s.clone() });
            }
        }
        windows
    }

    /// Brings the derived inputs to these.
    pub fn enter(&mut self, derived: &[Derived]) {
        if self.derived != derived {
            refine::set_all(&mut self.banks, derived, &self.signals);
            self.derived = derived.to_vec();
        }
    }

    /// Least squares of the one-step error over the windows, by QR.
    ///
    /// # Errors
    /// Fewer samples than terms.
    pub fn least_squares(&self, terms: &[Term], windows: &[Window]) -> Result<Fit, NarxError> {
        let samples: usize = windows.iter().map(|w| w.range.len().saturating_sub(self.rules.given)).sum();
        if samples < terms.len() {
            return Err(NarxError::TooFewSamples { samples, parameters: terms.len() });
        }
        let program = Program::new(terms);
        let mut phi = Matrix::zeros(samples, terms.len());
        let mut target = Vec::with_capacity(samples);
        for window in windows {
            let bank = bank_of(&self.banks, window.record)?;
            let inputs = program.inputs(bank)?;
            let mut v = vec![0.0; program.factors.len()];
            for n in window.range.start + self.rules.given..window.range.end {
                program.factor_values(n, n, &bank.y, &bank.y_sign, &inputs, &mut v);
                for k in 0..terms.len() {
                    phi.set(target.len(), k, program.term(k, &v));
                }
                target.push(bank.y[n]);
            }
        }
        let solution = lstsq(&phi, &target).map_err(|e| NarxError::LeastSquares(e.to_string()))?;
        Ok(Fit { terms: terms.to_vec(), theta: solution.theta, derived: self.derived.clone() })
    }

    /// The error reduction ratio of each term, in this order, one step ahead over the windows.
    ///
    /// The share of the output's sum of squares that the term's part orthogonal to those before it explains.
    ///
    /// # Errors
    /// Windows of recordings that there are not.
    pub fn error_reduction(&self, terms: &[Term], windows: &[Window]) -> Result<Vec<f64>, NarxError> {
        const TILE: usize = 1024;
        let program = Program::new(terms);
        let width = terms.len() + 1;
        let mut qr = TallQr::new(width);
        let mut energy = 0.0;
        for window in windows {
            let bank = bank_of(&self.banks, window.record)?;
            let inputs = program.inputs(bank)?;
            let mut v = vec![0.0; program.factors.len()];
            let first = window.range.start + self.rules.given;
            let mut from = first;
            while from < window.range.end {
                let rows = TILE.min(window.range.end - from);
                let mut tile = vec![0.0; rows * width];
                for (i, n) in (from..from + rows).enumerate() {
                    program.factor_values(n, n, &bank.y, &bank.y_sign, &inputs, &mut v);
                    for k in 0..terms.len() {
                        tile[k * rows + i] = program.term(k, &v);
                    }
                    tile[(width - 1) * rows + i] = bank.y[n];
                    energy += bank.y[n] * bank.y[n];
                }
                qr.push(rows, &mut tile);
                from += rows;
            }
        }
        let r = qr.into_factor();
        let last = &r[(width - 1) * width..];
        Ok(last[..terms.len()].iter().map(|q| q * q / energy.max(f64::MIN_POSITIVE)).collect())
    }

    /// The free-run error of `fit` over the windows.
    ///
    /// # Errors
    /// Windows of recordings that there are not.
    pub fn error(&mut self, fit: &Fit, windows: &[Window]) -> Result<RunError, NarxError> {
        self.enter(&fit.derived);
        let outcome = run_all(&Program::new(&fit.terms), &fit.theta, &self.banks, windows, self.rules)?;
        Ok(RunError { rmse: outcome.rmse(), diverged: outcome.diverged })
    }

    /// The residual of each window's free run, sample by sample; `NaN` where the run is given or has diverged.
    ///
    /// # Errors
    /// Windows of recordings that there are not.
    pub fn residuals(&mut self, fit: &Fit, windows: &[Window]) -> Result<Vec<Vec<f64>>, NarxError> {
        self.enter(&fit.derived);
        let program = Program::new(&fit.terms);
        windows
            .iter()
            .map(|w| {
                let bank = bank_of(&self.banks, w.record)?;
                let trace = run(&program, &fit.theta, bank, &w.range, self.rules)?;
                let end = trace.diverged.unwrap_or(w.range.end);
                let known = w.range.start + self.rules.given..end;
                let residual = |(n, p): (usize, &f64)| if known.contains(&n) { bank.y[n] - p } else { f64::NAN };
                Ok(w.range.clone().zip(&trace.y).map(residual).collect())
            })
            .collect()
    }

    /// The largest distance of each window's free run from `centre`; infinite where it diverged.
    ///
    /// # Errors
    /// Windows of recordings that there are not.
    pub fn peaks(&mut self, fit: &Fit, windows: &[Window], centre: f64) -> Result<Vec<f64>, NarxError> {
        self.enter(&fit.derived);
        let program = Program::new(&fit.terms);
        windows
            .iter()
            .map(|w| {
                let trace = run(&program, &fit.theta, bank_of(&self.banks, w.record)?, &w.range, self.rules)?;
                let largest = trace.y.iter().fold(0.0f64, |m, y| m.max((y - centre).abs()));
                Ok(if trace.diverged.is_some() { f64::INFINITY } else { largest })
            })
            .collect()
    }

    /// The error of each window's free run at its last sample; infinite where it diverged.
    ///
    /// # Errors
    /// Windows of recordings that there are not.
    pub fn last_errors(&mut self, fit: &Fit, windows: &[Window]) -> Result<Vec<f64>, NarxError> {
        self.enter(&fit.derived);
        let program = Program::new(&fit.terms);
        let mut errors = Vec::with_capacity(windows.len());
        for w in windows {
            let bank = bank_of(&self.banks, w.record)?;
            let trace = run(&program, &fit.theta, bank, &w.range, self.rules)?;
            if let (Some(p), Some(y)) = (trace.y.last(), bank.y[w.range.clone()].last()) {
                errors.push(if trace.diverged.is_some() { f64::INFINITY } else { p - y });
            }
        }
        Ok(errors)
    }

    /// The fit after at most `steps` steps of simulation-error refinement over the windows, and its free-run error.
    ///
    /// Where the first run diverges, the fit comes back as it was, with an infinite error.
    ///
    /// # Errors
    /// Windows of recordings that there are not.
    pub fn refine(
        &mut self,
        fit: Fit,
        windows: &[Window],
        steps: usize,
        what: Refine,
    ) -> Result<(Fit, RunError), NarxError> {
        self.enter(&fit.derived);
        let scope = match what {
            Refine::Coefficients => refine::Scope::Coefficients,
            Refine::CoefficientsAndDerived => refine::Scope::CoefficientsAndDerived,
        };
        let effort = refine::Effort { steps, least_gain: 1e-4, scope };
        let program = Program::new(&fit.terms);
        let start = Point { theta: fit.theta, derived: fit.derived };
        let done = refine(&program, start, &mut self.banks, windows, self.rules, &self.signals, effort)?;
        self.derived.clone_from(&done.point.derived);
        let error = RunError { rmse: done.outcome.rmse(), diverged: done.outcome.diverged };
        Ok((Fit { terms: fit.terms, theta: done.point.theta, derived: done.point.derived }, error))
    }

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

fn at_record(error: NarxError, record: usize) -> NarxError {
    match error {
        NarxError::BadRecord { problem, .. } => NarxError::BadRecord { record, problem },
        other => other,
    }
}

/// Forward selection on stored rows: the first `present` columns are in, the rest compete for the residual.
fn forward(rows: &[f64], residual: &[f64], width: usize, present: usize, count: usize) -> Vec<Gain> {
    // Inner products of every column with column j.
    let products = |j: usize| {
        let mut g = vec![0.0; width];
        for row in rows.chunks_exact(width) {
            let r = row[j];
            if r != 0.0 {
                for (g, x) in g.iter_mut().zip(row) {
                    *g += r * x;
                }
            }
        }
        g
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
    let mut take = |j: usize, norm: &mut [f64], right: &mut [f64], out: &mut [bool]| {
        out[j] = true;
        if !(norm[j] > COLLINEAR * whole[j]) {
            return;
        }
        let mut row = products(j);
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
    for j in 0..present {
        take(j, &mut norm, &mut right, &mut out);
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
        take(j, &mut norm, &mut right, &mut out);
    }
    gains
}
