//! NARMAX by extended least squares: the process terms together with past one-step residuals.
//!
//! Least squares is biased where the equation's error is not white. With the residuals of the last round as regressors the
//! error's colour is estimated beside the process, and the process terms lose their bias. Reference: Billings, *Nonlinear
//! System Identification* (2013), section 3.6; Ljung, *System Identification* (1999), section 10.4.

use hysid_dictionary::Term;
use hysid_linalg::{Matrix, lstsq};

use crate::model::NoiseTerm;
use crate::program::Program;
use crate::run::{Window, bank_of};
use crate::{Fit, NarxError, Trainer};

/// Rounds of extended least squares, at most.
const ROUNDS: usize = 60;
/// It has settled when no coefficient moves by more than this share of the largest.
const SETTLED: f64 = 1e-6;

/// A process model with its noise model.
#[derive(Debug, Clone, PartialEq)]
pub struct Narmax {
    /// The process terms with their coefficients.
    pub fit: Fit,
    /// The noise terms with theirs.
    pub noise: Vec<NoiseTerm>,
    /// Variance of the one-step residual.
    pub variance: f64,
    /// Whether the rounds settled.
    pub settled: bool,
}

impl Trainer {
    /// Process `terms` and `noise` terms (a term of the signals and the lag of the residual that it multiplies) by extended
    /// least squares over the windows.
    ///
    /// # Errors
    /// Fewer samples than parameters; a residual's lag of 0.
    pub fn extended_least_squares(
        &self,
        terms: &[Term],
        noise: &[(Term, usize)],
        windows: &[Window],
    ) -> Result<Narmax, NarxError> {
        self.extended(None, terms, noise, windows)
    }

    /// The `noise` terms beside a process model that stays as it is: what its one-step residuals say of each other.
    ///
    /// # Errors
    /// Fewer samples than noise terms; a residual's lag of 0.
    pub fn noise_terms(
        &mut self,
        fit: &Fit,
        noise: &[(Term, usize)],
        windows: &[Window],
    ) -> Result<Vec<NoiseTerm>, NarxError> {
        self.enter(&fit.derived);
        Ok(self.extended(Some(fit), &[], noise, windows)?.noise)
    }

    /// Extended least squares of what a `fixed` process model leaves, or of the output.
    fn extended(
        &self,
        fixed: Option<&Fit>,
        terms: &[Term],
        noise: &[(Term, usize)],
        windows: &[Window],
    ) -> Result<Narmax, NarxError> {
        if noise.iter().any(|(_, lag)| *lag == 0) {
            return Err(NarxError::LeastSquares("a residual's lag must be 1 or more".into()));
        }
        let start = self.given();
        let rows: usize = windows.iter().map(|w| w.range.len().saturating_sub(start)).sum();
        let width = terms.len() + noise.len();
        if rows < width {
            return Err(NarxError::TooFewSamples { samples: rows, parameters: width });
        }
        let all: Vec<Term> = terms.iter().cloned().chain(noise.iter().map(|(t, _)| t.clone())).collect();
        let program = Program::new(&all);
        let base = Program::new(fixed.map_or(&[], |f| &f.terms));
        let base_theta = fixed.map_or(&[][..], |f| &f.theta);
        let (mut phi, mut target) = (Matrix::zeros(rows, width), Vec::with_capacity(rows));
        // What multiplies each residual, and how many rows of the same window lie before each row.
        let mut factors = vec![vec![0.0; noise.len()]; rows];
        let mut before = Vec::with_capacity(rows);
        for window in windows {
            let bank = bank_of(self.banks(), window.record)?;
            let (inputs, base_inputs) = (program.inputs(bank)?, base.inputs(bank)?);
            let (mut v, mut w) = (vec![0.0; program.factors.len()], vec![0.0; base.factors.len()]);
            for (i, n) in (window.range.start + start..window.range.end).enumerate() {
                program.factor_values(n, n, &bank.y, &bank.y_sign, &inputs, &mut v);
                let row = target.len();
                for k in 0..terms.len() {
                    phi.set(row, k, program.term(k, &v));
                }
                for (k, f) in factors[row].iter_mut().enumerate() {
                    *f = program.term(terms.len() + k, &v);
                }
                before.push(i);
                base.factor_values(n, n, &bank.y, &bank.y_sign, &base_inputs, &mut w);
                target.push(bank.y[n] - base.sum(base_theta, &w));
            }
        }
        let mut theta = vec![0.0; width];
        let mut residual = vec![0.0; rows];
        let mut settled = false;
        for round in 0..ROUNDS {
            for row in 0..rows {
                for (k, (_, lag)) in noise.iter().enumerate() {
                    let e = if before[row] >= *lag { residual[row - lag] } else { 0.0 };
                    phi.set(row, terms.len() + k, factors[row][k] * e);
                }
            }
            let solution = lstsq(&phi, &target).map_err(|e| NarxError::LeastSquares(e.to_string()))?;
            for row in 0..rows {
                let predicted: f64 = solution.theta.iter().enumerate().map(|(k, t)| t * phi.get(row, k)).sum();
                residual[row] = target[row] - predicted;
            }
            let largest = solution.theta.iter().fold(0.0f64, |m, t| m.max(t.abs()));
            let moved = theta.iter().zip(&solution.theta).fold(0.0f64, |m, (a, b)| m.max((a - b).abs()));
            theta = solution.theta;
            settled = round > 1 && moved <= SETTLED * largest;
            if settled {
                break;
            }
        }
        let variance = residual.iter().map(|e| e * e).sum::<f64>() / (rows - width).max(1) as f64;
        let noise = noise
            .iter()
            .zip(&theta[terms.len()..])
            .map(|((term, lag), theta)| NoiseTerm { term: term.clone(), lag: *lag, theta: *theta })
            .collect();
        theta.truncate(terms.len());
        let fit = Fit { terms: terms.to_vec(), theta, derived: self.derived().to_vec() };
        Ok(Narmax { fit, noise, variance, settled })
    }
}
