//! Estimation of a model on recordings: least squares, refinement, errors of its runs.

use hysid_dictionary::{Record, Signals, Term};
use hysid_linalg::{Matrix, TallQr, lstsq};

use crate::program::Program;
use crate::refine::{self, Point, refine};
use crate::run::{Rules, Window, bank_of, run, run_all};
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

/// Recordings and everything that estimation on them needs.
#[derive(Debug, Clone)]
pub struct Trainer {
    signals: Signals,
    pub(crate) banks: Vec<Bank>,
    derived: Vec<Derived>,
    pub(crate) rules: Rules,
}

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
}

fn at_record(error: NarxError, record: usize) -> NarxError {
    match error {
        NarxError::BadRecord { problem, .. } => NarxError::BadRecord { record, problem },
        other => other,
    }
}
