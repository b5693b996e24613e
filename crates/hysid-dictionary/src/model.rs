//! A sum of terms with coefficients: one step ahead and free run.

use crate::run::Compiled;
use crate::{Design, Dictionary, DictionaryError, Record, Signals, Term};

/// The polynomial model y\[n\] = sum of theta_i * term_i. Immutable.
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    signals: Signals,
    terms: Vec<Term>,
    theta: Vec<f64>,
    compiled: Compiled,
}

/// A free run.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// The output: the given start, then the model's own; `NaN` from the sample at which it diverged.
    pub y: Vec<f64>,
    /// The first sample whose size exceeded the limit or was not finite.
    pub diverged_at: Option<usize>,
}

impl Model {
    /// The model with these terms and coefficients.
    ///
    /// # Errors
    /// Numbers of terms and coefficients that differ; terms of signals that there are not.
    pub fn new(signals: Signals, terms: Vec<Term>, theta: Vec<f64>) -> Result<Self, DictionaryError> {
        if terms.len() != theta.len() {
            return Err(DictionaryError::CoefficientCount { terms: terms.len(), theta: theta.len() });
        }
        if !terms.is_empty() {
            Dictionary::from_terms(signals.clone(), terms.iter().cloned())?;
        }
        let compiled = Compiled::new(&terms, &theta);
        Ok(Self { signals, terms, theta, compiled })
    }

    /// The signals.
    pub fn signals(&self) -> &Signals {
        &self.signals
    }

    /// The terms.
    pub fn terms(&self) -> &[Term] {
        &self.terms
    }

    /// The coefficients.
    pub fn theta(&self) -> &[f64] {
        &self.theta
    }

    /// The number of samples that the model reaches back.
    pub fn reach(&self) -> usize {
        self.terms.iter().map(Term::reach).max().unwrap_or(0)
    }

    /// The prediction of each sample from the recorded ones before it; `NaN` where a lag is missing.
    ///
    /// # Errors
    /// A record whose inputs are not as many as the model's or not as long as its output.
    pub fn one_step(&self, record: &Record<'_>) -> Result<Vec<f64>, DictionaryError> {
        let mut predicted = vec![f64::NAN; record.y.len()];
        if self.terms.is_empty() {
            predicted.fill(0.0);
            return Ok(predicted);
        }
        // The terms may repeat; `from_terms` would merge them, so the design is made of the distinct ones.
        let dictionary = Dictionary::from_terms(self.signals.clone(), self.terms.iter().cloned())?;
        let design = match Design::new(&dictionary, std::slice::from_ref(record)) {
            Err(DictionaryError::TooShort { .. }) => return Ok(predicted),
            other => other?,
        };
        let rows = hysid_linalg::Columns::rows(&design);
        let mut sum = vec![0.0; rows];
        let mut column = vec![0.0; rows];
        for (term, theta) in self.terms.iter().zip(&self.theta) {
            design.fill_term(term, 0..rows, &mut column);
            for (s, c) in sum.iter_mut().zip(&column) {
                *s += theta * c;
            }
        }
        for ((_, n), s) in design.samples().zip(sum) {
            predicted[n] = s;
        }
        Ok(predicted)
    }

    /// The output that the model makes of the inputs alone, after the samples `start`.
    ///
    /// `start` holds the first samples of the output, at least [`Model::reach`] of them; from there on only the model's
    /// own output is fed back. The run has as many samples as the inputs (for a model without inputs, `length`).
    /// It stops where the output exceeds `limit` in size or is not finite.
    ///
    /// # Errors
    /// Inputs that differ in number from the model's or in length, or a start that is shorter than the reach.
    pub fn free_run(
        &self,
        inputs: &[&[f64]],
        start: &[f64],
        length: usize,
        limit: f64,
    ) -> Result<Run, DictionaryError> {
        let bad = |problem: String| DictionaryError::BadRecord { record: 0, problem };
        if inputs.len() != self.signals.inputs().len() {
            let expected = self.signals.inputs().len();
            return Err(bad(format!("{} inputs are given, the model has {expected}", inputs.len())));
        }
        if let Some(u) = inputs.iter().find(|u| u.len() != length) {
            return Err(bad(format!("an input has {} samples, the run {length}", u.len())));
        }
        let reach = self.reach();
        if start.len() < reach.min(length) {
            return Err(bad(format!("{} samples to start from, the model reaches back {reach}", start.len())));
        }
        let mut y = vec![f64::NAN; length];
        let begin = start.len().min(length);
        y[..begin].copy_from_slice(&start[..begin]);
        Ok(self.compiled.run(&self.signals, inputs, y, begin, limit))
    }
}
