//! The Gram matrix of a dictionary from samples that arrive block by block, in memory that does not grow with them.
//!
//! Every distinct product is summed up once (see [`crate::distinct`]). The samples are cut where the window is full and where one is missing,
//! never where a block of the caller ends, and sums are added in order: the result depends neither on the blocks nor on the number of threads.

use std::ops::Range;

use hysid_linalg::Gram;

use crate::distinct::Distinct;
use crate::record::{FIRST_SIGN, next_sign};
use crate::totals::{RUN, Totals};
use crate::{Dictionary, DictionaryError, Quantity, Record, Signal};

/// Runs in a full window.
const RUNS: usize = 16;
/// Candidates beyond this number are refused: their Gram matrix alone would take 32 MB.
const LARGEST: usize = 2000;

/// Adds up the Gram matrix of a dictionary.
///
/// Memory: the window (135 000 samples of each quantity), the distinct products, and 12 bytes for each pair of candidates.
#[derive(Debug)]
pub struct GramSums<'d> {
    dictionary: &'d Dictionary,
    totals: Totals,
    window: Window,
    recordings: usize,
}

impl<'d> GramSums<'d> {
    /// Nothing added up yet.
    ///
    /// # Errors
    /// More than 2000 candidates.
    pub fn new(dictionary: &'d Dictionary) -> Result<Self, DictionaryError> {
        if dictionary.len() > LARGEST {
            return Err(DictionaryError::TooLarge { limit: LARGEST });
        }
        let window = Window::new(dictionary);
        let distinct = Distinct::within(dictionary.terms(), usize::MAX);
        let distinct = distinct.ok_or(DictionaryError::TooLarge { limit: LARGEST })?;
        let totals = Totals::new(distinct, &window.quantities);
        Ok(Self { dictionary, totals, window, recordings: 0 })
    }

    /// The distinct sums that the Gram matrix is made of.
    pub fn distinct_sums(&self) -> usize {
        self.totals.len()
    }

    /// Adds the next samples of the recording. `stretches` of the record are not looked at; a missing sample is `NaN`.
    ///
    /// # Errors
    /// Inputs that are not as many as the dictionary's or not as long as the output.
    pub fn push(&mut self, samples: &Record<'_>) -> Result<(), DictionaryError> {
        let expected = self.dictionary.signals().inputs().len();
        let bad = |problem: String| DictionaryError::BadRecord { record: self.recordings, problem };
        if samples.inputs.len() != expected {
            return Err(bad(format!("it has {} inputs, the dictionary {expected}", samples.inputs.len())));
        }
        if let Some(u) = samples.inputs.iter().find(|u| u.len() != samples.y.len()) {
            return Err(bad(format!("an input has {} samples, the output {}", u.len(), samples.y.len())));
        }
        let whole = Record { y: samples.y, inputs: samples.inputs.clone(), stretches: None };
        let mut done = 0;
        for stretch in whole.gap_free() {
            if stretch.start > done {
                self.window.end_stretch();
            }
            let mut at = stretch.start;
            while at < stretch.end {
                if self.window.room() == 0 {
                    self.flush();
                }
                let end = stretch.end.min(at + self.window.room());
                self.window.extend(samples, at..end);
                at = end;
            }
            done = stretch.end;
        }
        if done < samples.y.len() {
            self.window.end_stretch();
        }
        Ok(())
    }

    /// Ends the recording: what is pushed next has no past.
    pub fn end_recording(&mut self) {
        self.window.end_stretch();
        self.recordings += 1;
    }

    /// The Gram matrix, the products with the output and its energy.
    ///
    /// # Errors
    /// No row at all.
    pub fn finish(mut self) -> Result<Gram, DictionaryError> {
        self.flush();
        if self.totals.rows() == 0 {
            let (longest, lag) = (self.window.longest, self.window.reach);
            return Err(DictionaryError::TooShort { longest, lag });
        }
        Ok(self.totals.gram())
    }

    /// Adds up the rows of the window.
    fn flush(&mut self) {
        self.totals.add(&self.window.channels, &self.window.rows);
        self.window.clear();
    }
}

/// The samples at hand: the quantities that terms use, and the rows among them that are not yet added up.
#[derive(Debug)]
struct Window {
    reach: usize,
    quantities: Vec<Quantity>,
    /// The threshold of each quantity's signal.
    thresholds: Vec<f64>,
    channels: Vec<Vec<f64>>,
    rows: Vec<Range<usize>>,
    /// Samples of the stretch so far.
    age: usize,
    longest: usize,
    /// For each quantity, the sample before and the sign so far.
    before: Vec<(f64, f64)>,
}

impl Window {
    fn new(dictionary: &Dictionary) -> Self {
        let mut quantities: Vec<Quantity> =
            dictionary.terms().iter().flat_map(|t| t.factors().iter().map(|f| f.quantity)).collect();
        quantities.push(Quantity::Value(Signal::Output));
        quantities.sort();
        quantities.dedup();
        let threshold = |q: &Quantity| dictionary.signals().name(q.signal()).map_or(0.0, |n| n.threshold);
        Self {
            reach: dictionary.reach(),
            thresholds: quantities.iter().map(threshold).collect(),
            channels: vec![Vec::new(); quantities.len()],
            before: vec![(0.0, FIRST_SIGN); quantities.len()],
            quantities,
            rows: Vec::new(),
            age: 0,
            longest: 0,
        }
    }

    fn len(&self) -> usize {
        self.channels.first().map_or(0, Vec::len)
    }

    /// How many samples fit.
    fn room(&self) -> usize {
        (self.reach + RUNS * RUN).saturating_sub(self.len())
    }

    fn end_stretch(&mut self) {
        self.age = 0;
    }

    /// Adds samples that continue the stretch.
    fn extend(&mut self, samples: &Record<'_>, range: Range<usize>) {
        if range.is_empty() {
            return;
        }
        let (begin, len) = (self.len(), range.len());
        for ((channel, quantity), (before, threshold)) in
            self.channels.iter_mut().zip(&self.quantities).zip(self.before.iter_mut().zip(&self.thresholds))
        {
            let x = match quantity.signal() {
                Signal::Output => &samples.y[range.clone()],
                Signal::Input(i) => &samples.inputs[i][range.clone()],
            };
            if let Quantity::Value(_) = quantity {
                channel.extend_from_slice(x);
                continue;
            }
            if self.age == 0 {
                *before = (x[0], FIRST_SIGN);
            }
            for &x in x {
                let difference = x - before.0;
                *before = (x, next_sign(before.1, difference, *threshold));
                channel.push(if quantity.is_sign() { before.1 } else { difference });
            }
        }
        let first = begin + self.reach.saturating_sub(self.age);
        let end = begin + len;
        if first < end {
            match self.rows.last_mut() {
                Some(last) if last.end == first && self.age > self.reach => last.end = end,
                _ => self.rows.push(first..end),
            }
        }
        self.age += len;
        self.longest = self.longest.max(self.age);
    }

    /// Forgets all but what the stretch's next rows look back on.
    fn clear(&mut self) {
        let keep = self.reach.min(self.age);
        for channel in &mut self.channels {
            channel.drain(..channel.len() - keep);
        }
        self.rows.clear();
    }
}
