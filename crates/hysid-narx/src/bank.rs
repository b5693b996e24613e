//! Recordings made ready for a model: derived inputs and the quantities of all inputs, sample by sample.
//!
//! A [`Bank`] is made once and shared by everything that runs models over the same factors: least squares, free runs,
//! sensitivities, the search.

use std::collections::HashMap;
use std::ops::Range;

use hysid_dictionary::{Quantity, Record, Signal, Signals};

use crate::{Derived, NarxError};

/// One recording with its derived inputs.
#[derive(Debug, Clone)]
pub struct Bank {
    /// The output; `NaN` where it is missing.
    pub(crate) y: Vec<f64>,
    /// The sign of the output's difference, as recorded.
    pub(crate) y_sign: Vec<f64>,
    /// Each quantity of an input, sample by sample; 0 outside the gap-free stretches.
    columns: HashMap<Quantity, Vec<f64>>,
    /// The derived inputs that the columns hold.
    derived: Vec<Derived>,
    /// The gap-free stretches.
    pub(crate) stretches: Vec<Range<usize>>,
}

impl Bank {
    /// The recording `record` (recorded inputs only) with `derived` inputs after its own.
    ///
    /// `signals` names the output, the recorded and the derived inputs; its thresholds decide the signs of differences.
    ///
    /// # Errors
    /// Another number of inputs than `signals` has; unequal lengths.
    pub fn new(record: &Record<'_>, derived: &[Derived], signals: &Signals) -> Result<Self, NarxError> {
        let bad = |problem: String| NarxError::BadRecord { record: 0, problem };
        let recorded = signals.inputs().len().saturating_sub(derived.len());
        if record.inputs.len() != recorded {
            return Err(bad(format!("it has {} inputs, the model {recorded}", record.inputs.len())));
        }
        let length = record.y.len();
        if let Some(u) = record.inputs.iter().find(|u| u.len() != length) {
            return Err(bad(format!("an input has {} samples, the output {length}", u.len())));
        }
        let stretches = record.gap_free();
        let mut bank =
            Self { y: record.y.to_vec(), y_sign: Vec::new(), columns: HashMap::new(), derived: Vec::new(), stretches };
        for (i, u) in record.inputs.iter().enumerate() {
            bank.set_input(i, u, signals);
        }
        bank.set_derived(derived, signals);
        let threshold = signals.output().threshold;
        bank.y_sign = signs(&bank.y, &bank.stretches, threshold);
        Ok(bank)
    }

    /// Brings the derived inputs to these: those that have changed, or whose source has, are computed anew.
    pub(crate) fn set_derived(&mut self, derived: &[Derived], signals: &Signals) {
        let recorded = signals.inputs().len().saturating_sub(derived.len());
        let before = std::mem::replace(&mut self.derived, derived.to_vec());
        let mut changed = vec![false; derived.len()];
        for (i, d) in derived.iter().enumerate() {
            let source = d.source.checked_sub(recorded).is_some_and(|s| changed.get(s).copied().unwrap_or(true));
            changed[i] = source || before.get(i) != Some(d);
            if !changed[i] {
                continue;
            }
            let mut out = vec![0.0; self.y.len()];
            if let Some(source) = self.columns.get(&Quantity::Value(Signal::Input(d.source))) {
                for s in &self.stretches {
                    d.law.respond(&source[s.clone()], &mut out[s.clone()]);
                }
            }
            self.set_input(recorded + i, &out, signals);
        }
    }

    /// Puts the recorded output in, known on these stretches, where the bank was made of the inputs alone.
    pub(crate) fn set_output(&mut self, y: &[f64], known: &[Range<usize>], threshold: f64) {
        self.y = y.to_vec();
        self.y_sign = signs(y, known, threshold);
    }

    fn set_input(&mut self, i: usize, u: &[f64], signals: &Signals) {
        let signal = Signal::Input(i);
        let mut value = vec![0.0; u.len()];
        let mut difference = vec![0.0; u.len()];
        for s in &self.stretches {
            value[s.clone()].copy_from_slice(&u[s.clone()]);
            for n in s.start + 1..s.end {
                difference[n] = u[n] - u[n - 1];
            }
        }
        let threshold = signals.name(signal).map_or(0.0, |n| n.threshold);
        let sign = signs(&value, &self.stretches, threshold);
        self.columns.insert(Quantity::Value(signal), value);
        self.columns.insert(Quantity::Difference(signal), difference);
        self.columns.insert(Quantity::Sign(signal), sign);
    }

    /// A quantity of an input.
    pub(crate) fn column(&self, quantity: Quantity) -> Option<&[f64]> {
        self.columns.get(&quantity).map(Vec::as_slice)
    }

    /// The inputs, recorded and derived, in order; 0 outside the gap-free stretches.
    pub fn inputs(&self) -> Vec<&[f64]> {
        (0..).map_while(|i| self.column(Quantity::Value(Signal::Input(i)))).collect()
    }

    /// The output and all inputs, recorded and derived, over the gap-free stretches, as a design matrix takes them.
    pub fn record(&self) -> Record<'_> {
        Record { y: &self.y, inputs: self.inputs(), stretches: Some(self.stretches.clone()) }
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.y.len()
    }

    /// Whether there is no sample.
    pub fn is_empty(&self) -> bool {
        self.y.is_empty()
    }

    /// The output as recorded.
    pub fn y(&self) -> &[f64] {
        &self.y
    }

    /// The gap-free stretches, in order.
    pub fn stretches(&self) -> &[Range<usize>] {
        &self.stretches
    }
}

/// The mean of each sample and the `l - 1` before it: what a model that moves in steps of `l` samples sees of an input.
///
/// A short pulse between two steps keeps its area that way. At the beginning the mean is over the samples that there are; it is
/// `NaN` where one of them is missing.
pub fn mean_over_step(u: &[f64], l: usize) -> Vec<f64> {
    if l <= 1 {
        return u.to_vec();
    }
    (0..u.len())
        .map(|n| {
            let part = &u[(n + 1).saturating_sub(l)..=n];
            part.iter().sum::<f64>() / part.len() as f64
        })
        .collect()
}

fn signs(x: &[f64], stretches: &[Range<usize>], threshold: f64) -> Vec<f64> {
    let mut out = vec![hysid_dictionary::FIRST_SIGN; x.len()];
    for s in stretches {
        for n in s.start + 1..s.end {
            out[n] = hysid_dictionary::next_sign(out[n - 1], x[n] - x[n - 1], threshold);
        }
    }
    out
}
