//! The Gram matrix of a dictionary from samples that arrive block by block, in memory that does not grow with them.
//!
//! Every distinct product is summed up once (see [`crate::distinct`]). The samples are cut where the window is full and where one is missing,
//! never where a block of the caller ends, and sums are added in order: the result depends neither on the blocks nor on the number of threads.
//! Partial sums of [`RUN`] rows are added with compensation (Neumaier, 1974), so that errors do not grow with the number of samples.

use std::ops::Range;

use hysid_linalg::{Gram, Matrix};
use rayon::prelude::*;

use crate::distinct::{Class, Distinct, Kernel, Member, Work};
use crate::record::{FIRST_SIGN, next_sign};
use crate::{Dictionary, DictionaryError, Quantity, Record, Signal};

/// Rows whose sums are made from zero, at most.
const RUN: usize = 8192;
/// Runs in a full window.
const RUNS: usize = 16;
/// Work (in multiply-adds) below which threads cost more than they bring.
const SERIAL_BELOW: usize = 3_000_000;
/// Candidates beyond this number are refused: their Gram matrix alone would take 32 MB.
const LARGEST: usize = 2000;

/// A sum with the rounding errors of its additions.
#[derive(Debug, Clone, Copy, Default)]
struct Sum {
    value: f64,
    error: f64,
}

impl Sum {
    fn add(&mut self, x: f64) {
        let sum = self.value + x;
        self.error += if self.value.abs() >= x.abs() { (self.value - sum) + x } else { (x - sum) + self.value };
        self.value = sum;
    }

    fn total(self) -> f64 {
        // Where the sum is not finite its error is not a number.
        if self.value.is_finite() { self.value + self.error } else { self.value }
    }
}

/// Adds up the Gram matrix of a dictionary.
///
/// Memory: the window (135 000 samples of each quantity), the distinct products, and 12 bytes for each pair of candidates.
#[derive(Debug)]
pub struct GramSums<'d> {
    dictionary: &'d Dictionary,
    distinct: Distinct,
    kernel: Kernel,
    window: Window,
    /// The factors of each class as channel and lag.
    factors: Vec<Vec<(usize, usize)>>,
    sums: Vec<Sum>,
    /// For each class, from the first place on, S(s) - S(s + 1) for its shifts s.
    edges: Vec<Sum>,
    first_edge: Vec<usize>,
    rows: usize,
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
        let distinct = Distinct::new(dictionary.terms());
        let window = Window::new(dictionary);
        let kernel = Kernel::new(&distinct.classes, &window.quantities);
        let channel = |q: &Quantity| window.quantities.binary_search(q).unwrap_or(0);
        let factors = distinct
            .classes
            .iter()
            .map(|c| c.factors.iter().map(|f| (channel(&f.quantity), f.lag)).collect())
            .collect();
        let mut first_edge = Vec::with_capacity(distinct.classes.len());
        let mut edges = 0;
        for c in &distinct.classes {
            first_edge.push(edges);
            edges += c.most - c.least;
        }
        Ok(Self {
            dictionary,
            kernel,
            window,
            factors,
            sums: vec![Sum::default(); distinct.classes.len()],
            edges: vec![Sum::default(); edges],
            first_edge,
            distinct,
            rows: 0,
            recordings: 0,
        })
    }

    /// The distinct sums that the Gram matrix is made of.
    pub fn distinct_sums(&self) -> usize {
        self.distinct.classes.len()
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
        if self.rows == 0 {
            let (longest, lag) = (self.window.longest, self.window.reach);
            return Err(DictionaryError::TooShort { longest, lag });
        }
        let m = self.dictionary.len();
        let shifted: Vec<Vec<f64>> = (0..self.distinct.classes.len()).map(|c| self.shifted(c)).collect();
        let value = |member: Member| {
            let class = member.class as usize;
            shifted[class][member.shift as usize - self.distinct.classes[class].least]
        };
        let mut matrix = Matrix::zeros(m, m);
        let mut pairs = self.distinct.gram.iter();
        for j in 0..m {
            for (i, &pair) in pairs.by_ref().take(j + 1).enumerate() {
                matrix.set(i, j, value(pair));
                matrix.set(j, i, value(pair));
            }
        }
        let cross = self.distinct.cross.iter().map(|&c| value(c)).collect();
        Ok(Gram { matrix, cross, target: value(self.distinct.target), rows: self.rows })
    }

    /// The sums of a class at its shifts, from the smallest on.
    fn shifted(&self, class: usize) -> Vec<f64> {
        let Class { factors, base, least, most } = &self.distinct.classes[class];
        if factors.is_empty() {
            return vec![self.rows as f64];
        }
        let edge = |s: usize| self.edges[self.first_edge[class] + s - least];
        let moved = |sum: Sum, by: Sum, sign: f64| {
            let mut sum = sum;
            sum.add(sign * by.value);
            sum.add(sign * by.error);
            sum
        };
        let mut at = vec![self.sums[class]; most - least + 1];
        for s in (*least..*base).rev() {
            at[s - least] = moved(at[s + 1 - least], edge(s), 1.0);
        }
        for s in *base..*most {
            at[s + 1 - least] = moved(at[s - least], edge(s), -1.0);
        }
        at.into_iter().map(Sum::total).collect()
    }

    /// Adds up the rows of the window.
    fn flush(&mut self) {
        let (kernel, channels) = (&self.kernel, &self.window.channels);
        let runs = runs(&self.window.rows);
        let rows: usize = self.window.rows.iter().map(ExactSizeIterator::len).sum();
        let parts: Vec<Vec<f64>> = if rows * kernel.work() < SERIAL_BELOW || runs.len() < 2 {
            let mut work = Work::new(kernel);
            runs.iter().map(|run| kernel.sums(&mut work, channels, run)).collect()
        } else {
            runs.par_iter().map_init(|| Work::new(kernel), |work, run| kernel.sums(work, channels, run)).collect()
        };
        for part in &parts {
            for (sum, p) in self.sums.iter_mut().zip(part) {
                sum.add(*p);
            }
        }
        for range in &self.window.rows {
            for (class, factors) in self.factors.iter().enumerate() {
                let Class { least, most, .. } = self.distinct.classes[class];
                let c = |t: usize| factors.iter().map(|&(channel, lag)| channels[channel][t - lag]).product::<f64>();
                for s in least..most {
                    let edge = &mut self.edges[self.first_edge[class] + s - least];
                    edge.add(c(range.end - 1 - s));
                    edge.add(-c(range.start - 1 - s));
                }
            }
        }
        self.rows += rows;
        self.window.clear();
    }
}

/// The rows in runs of at most [`RUN`], short ranges together.
fn runs(rows: &[Range<usize>]) -> Vec<Vec<Range<usize>>> {
    let mut runs: Vec<Vec<Range<usize>>> = Vec::new();
    let mut room = 0;
    for range in rows {
        let mut at = range.start;
        while at < range.end {
            if room == 0 {
                runs.push(Vec::new());
                room = RUN;
            }
            let end = range.end.min(at + room);
            if let Some(run) = runs.last_mut() {
                run.push(at..end);
            }
            room -= end - at;
            at = end;
        }
    }
    runs
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
