//! The design matrix: a dictionary on recordings, one row for each sample with all its lags, never stored.

use std::ops::Range;

use hysid_linalg::{Columns, Gram, Matrix, Start, multiply_by};
use rayon::prelude::*;

use crate::kernel::Plan;
use crate::record::{FIRST_SIGN, differences, next_sign};
use crate::{Dictionary, DictionaryError, Factor, Quantity, Record, Signal, Term};

/// Samples from which quantities are copied on threads.
const LONG: usize = 200_000;

/// One stretch of rows: the samples `first..first + len` of one record.
#[derive(Debug, Clone)]
pub(crate) struct Stretch {
    /// Number of the first row.
    pub row: usize,
    /// Record that the samples are of.
    pub record: usize,
    /// First sample.
    pub first: usize,
    /// Number of rows.
    pub len: usize,
}

/// A dictionary on recordings. Rows are in the order of records and time; columns are the dictionary's terms.
#[derive(Debug, Clone)]
pub struct Design<'d> {
    dictionary: &'d Dictionary,
    /// The quantities that terms use, sorted.
    quantities: Vec<Quantity>,
    /// For each record, each of the quantities, sample by sample.
    channels: Vec<Vec<Vec<f64>>>,
    stretches: Vec<Stretch>,
    rows: usize,
    records: usize,
    plan: Plan,
}

impl<'d> Design<'d> {
    /// The design matrix of `dictionary` on `records`.
    ///
    /// A row is a sample whose output is known and whose lags (up to the dictionary's reach) lie in the same gap-free
    /// stretch.
    ///
    /// # Errors
    /// A record whose inputs are not as many as the dictionary's or not as long as its output; no row at all.
    pub fn new(dictionary: &'d Dictionary, records: &[Record<'_>]) -> Result<Self, DictionaryError> {
        let expected = dictionary.signals().inputs().len();
        let mut quantities: Vec<Quantity> =
            dictionary.terms().iter().flat_map(|t| t.factors().iter().map(|f| f.quantity)).collect();
        quantities.push(Quantity::Value(Signal::Output));
        quantities.sort();
        quantities.dedup();
        let reach = dictionary.reach();
        let (mut channels, mut stretches, mut rows, mut longest) = (Vec::new(), Vec::new(), 0, 0);
        for (r, record) in records.iter().enumerate() {
            let bad = |problem: String| DictionaryError::BadRecord { record: r, problem };
            if record.inputs.len() != expected {
                return Err(bad(format!("it has {} inputs, the dictionary {expected}", record.inputs.len())));
            }
            if let Some(u) = record.inputs.iter().find(|u| u.len() != record.y.len()) {
                return Err(bad(format!("an input has {} samples, the output {}", u.len(), record.y.len())));
            }
            let whole = record.gap_free();
            for range in &whole {
                longest = longest.max(range.len());
                if range.len() > reach {
                    let len = range.len() - reach;
                    stretches.push(Stretch { row: rows, record: r, first: range.start + reach, len });
                    rows += len;
                }
            }
            let of = |&q: &Quantity| channel(dictionary, record, &whole, q);
            channels.push(match record.y.len() < LONG {
                true => quantities.iter().map(of).collect(),
                false => quantities.par_iter().map(of).collect(),
            });
        }
        if rows == 0 {
            return Err(DictionaryError::TooShort { longest, lag: reach });
        }
        Ok(Self {
            dictionary,
            quantities,
            channels,
            stretches,
            rows,
            records: records.len(),
            plan: Plan::new(dictionary.terms()),
        })
    }

    /// The dictionary.
    pub fn dictionary(&self) -> &'d Dictionary {
        self.dictionary
    }

    /// The target: the output at each row.
    pub fn target(&self) -> Vec<f64> {
        let mut y = vec![0.0; self.rows];
        self.fill_factor(Factor::value(Signal::Output, 0), 0..self.rows, &mut y, <[f64]>::copy_from_slice);
        y
    }

    /// Record and sample of each row.
    pub fn samples(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.stretches.iter().flat_map(|s| (s.first..s.first + s.len).map(move |n| (s.record, n)))
    }

    /// The rows of each record, in the order of the records; a record without rows has an empty range.
    pub fn rows_of_records(&self) -> Vec<Range<usize>> {
        let mut rows = Vec::with_capacity(self.records);
        let mut at = 0;
        for r in 0..self.records {
            let len: usize = self.stretches.iter().filter(|s| s.record == r).map(|s| s.len).sum();
            rows.push(at..at + len);
            at += len;
        }
        rows
    }

    /// The whole column of a term, which need not be in the dictionary but may only use its quantities and reach.
    pub(crate) fn fill_term(&self, term: &Term, rows: Range<usize>, out: &mut [f64]) {
        let mut factors = term.factors().iter();
        match factors.next() {
            None => out.fill(1.0),
            Some(&first) => self.fill_factor(first, rows.clone(), out, <[f64]>::copy_from_slice),
        }
        for &f in factors {
            self.fill_factor(f, rows.clone(), out, |out, x| multiply_by(x, out));
        }
    }

    pub(crate) fn stretches(&self) -> &[Stretch] {
        &self.stretches
    }

    /// A quantity that a term uses, all samples of a record.
    pub(crate) fn samples_of(&self, record: usize, quantity: Quantity) -> &[f64] {
        &self.channels[record][self.quantities.binary_search(&quantity).unwrap_or(0)]
    }

    pub(crate) fn quantities(&self) -> &[Quantity] {
        &self.quantities
    }

    /// For each record, each of the quantities.
    pub(crate) fn channels(&self) -> &[Vec<Vec<f64>>] {
        &self.channels
    }

    pub(crate) fn plan(&self) -> &Plan {
        &self.plan
    }

    pub(crate) fn fill_factor(
        &self,
        factor: Factor,
        rows: Range<usize>,
        out: &mut [f64],
        join: impl Fn(&mut [f64], &[f64]),
    ) {
        let quantity = self.quantities.binary_search(&factor.quantity).unwrap_or(0);
        let mut at = self.stretches.partition_point(|s| s.row + s.len <= rows.start);
        let mut done = rows.start;
        while done < rows.end && at < self.stretches.len() {
            let s = &self.stretches[at];
            let end = rows.end.min(s.row + s.len);
            let from = s.first + (done - s.row) - factor.lag;
            let source = &self.channels[s.record][quantity][from..from + (end - done)];
            join(&mut out[done - rows.start..end - rows.start], source);
            done = end;
            at += 1;
        }
    }
}

/// One quantity of a record, sample by sample; 0 outside the gap-free stretches.
fn channel(dictionary: &Dictionary, record: &Record<'_>, whole: &[Range<usize>], quantity: Quantity) -> Vec<f64> {
    let signal = quantity.signal();
    let x: &[f64] = match signal {
        Signal::Output => record.y,
        Signal::Input(i) => record.inputs[i],
    };
    let mut out = vec![0.0; x.len()];
    for range in whole {
        let (from, to) = (&x[range.clone()], &mut out[range.clone()]);
        match quantity {
            Quantity::Value(_) => to.copy_from_slice(from),
            Quantity::Difference(_) => differences(from, to),
            Quantity::Sign(_) => {
                differences(from, to);
                let threshold = dictionary.signals().name(signal).map_or(0.0, |n| n.threshold);
                let mut sign = FIRST_SIGN;
                for o in to {
                    sign = next_sign(sign, *o, threshold);
                    *o = sign;
                }
            }
        }
    }
    out
}

impl Columns for Design<'_> {
    fn rows(&self) -> usize {
        self.rows
    }

    fn cols(&self) -> usize {
        self.dictionary.len()
    }

    fn fill(&self, j: usize, rows: Range<usize>, out: &mut [f64]) {
        self.fill_term(&self.dictionary.terms()[j], rows, out);
    }

    fn start(&self, y: &[f64]) -> Start {
        self.fused_start(y)
    }

    fn gram_columns(&self, which: &[usize]) -> Matrix {
        let (m, k) = (self.cols(), which.len());
        Matrix::from_column_major(m, k, self.fused_gram_columns(which)).unwrap_or_else(|| Matrix::zeros(m, k))
    }

    fn gram(&self, y: &[f64], columns: usize) -> Option<Gram> {
        self.whole_gram(y, columns)
    }
}
