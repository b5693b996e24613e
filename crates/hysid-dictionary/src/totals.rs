//! Distinct products summed up over rows, and the Gram matrix that follows from them.
//!
//! Sums of at most [`RUN`] rows are made from zero and added with compensation (Neumaier, 1974), so that errors do not grow with the number
//! of samples. A product shifted in time has the sum of the product itself but for what enters and leaves at the ends of each range of rows;
//! that is exact in algebra and harmless in arithmetic as long as the ends are small beside the sums ([`Totals::is_sound`]).

use std::ops::Range;
use std::sync::Mutex;

use hysid_linalg::{Gram, Matrix, map_blocks};

use crate::Quantity;
use crate::distinct::{Class, Distinct, Member};
use crate::sums::{Kernel, Work};

/// Rows whose sums are made from zero, at most.
pub(crate) const RUN: usize = 8192;
/// Sums of runs that are held at the same time, about: 8 MB.
const HELD: usize = 1_000_000;
/// Work (in multiply-adds) below which threads cost more than they bring.
const SERIAL_BELOW: usize = 3_000_000;

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

/// S(s) - S(s + 1) of a class.
#[derive(Debug, Clone, Copy, Default)]
struct Edge {
    sum: Sum,
    /// The magnitudes of what was added.
    size: f64,
}

/// The sums of the distinct products of a dictionary over the rows added so far.
#[derive(Debug)]
pub(crate) struct Totals {
    distinct: Distinct,
    kernel: Kernel,
    /// The factors of each class as channel and lag.
    factors: Vec<Vec<(usize, usize)>>,
    sums: Vec<Sum>,
    /// For each class, from the first place on, S(s) - S(s + 1) for its shifts s.
    edges: Vec<Edge>,
    first_edge: Vec<usize>,
    rows: usize,
    /// Buffers that no thread uses at the moment.
    buffers: Mutex<Vec<Work>>,
}

impl Totals {
    /// Nothing added up yet; the channels of what will be added hold `quantities`.
    pub fn new(distinct: Distinct, quantities: &[Quantity]) -> Self {
        let kernel = Kernel::new(&distinct.classes, quantities);
        let channel = |q: &Quantity| quantities.binary_search(q).unwrap_or(0);
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
        Self {
            kernel,
            factors,
            sums: vec![Sum::default(); distinct.classes.len()],
            edges: vec![Edge::default(); edges],
            first_edge,
            distinct,
            rows: 0,
            buffers: Mutex::default(),
        }
    }

    /// The number of distinct sums.
    pub fn len(&self) -> usize {
        self.distinct.classes.len()
    }

    /// Rows added so far.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Adds these rows of the channels, each range with what its lags look back on before it.
    pub fn add(&mut self, channels: &[Vec<f64>], ranges: &[Range<usize>]) {
        let runs = runs(ranges);
        let rows: usize = ranges.iter().map(ExactSizeIterator::len).sum();
        let work = rows * self.kernel.work();
        for runs in runs.chunks((HELD / self.sums.len().max(1)).max(rayon::current_num_threads())) {
            let parts = map_blocks(runs, work, SERIAL_BELOW, |run| self.one_run(channels, run));
            for part in &parts {
                for (sum, p) in self.sums.iter_mut().zip(part) {
                    sum.add(*p);
                }
            }
        }
        for range in ranges {
            for (class, factors) in self.factors.iter().enumerate() {
                let Class { least, most, .. } = self.distinct.classes[class];
                let c = |t: usize| factors.iter().map(|&(channel, lag)| channels[channel][t - lag]).product::<f64>();
                for s in least..most {
                    let edge = &mut self.edges[self.first_edge[class] + s - least];
                    for x in [c(range.end - 1 - s), -c(range.start - 1 - s)] {
                        edge.sum.add(x);
                        edge.size += x.abs();
                    }
                }
            }
        }
        self.rows += rows;
    }

    /// The sums of all classes over one run, in buffers that are kept for the next.
    fn one_run(&self, channels: &[Vec<f64>], run: &[Range<usize>]) -> Vec<f64> {
        let kept = self.buffers.lock().ok().and_then(|mut kept| kept.pop());
        let mut work = kept.unwrap_or_else(|| Work::new(&self.kernel));
        let sums = self.kernel.sums(&mut work, channels, run);
        if let Ok(mut kept) = self.buffers.lock() {
            kept.push(work);
        }
        sums
    }

    /// The Gram matrix, the products with the output and its energy.
    pub fn gram(&self) -> Gram {
        let m = self.distinct.cross.len();
        let shifted: Vec<Vec<f64>> = (0..self.len()).map(|c| self.shifted(c)).collect();
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
        Gram { matrix, cross, target: value(self.distinct.target), rows: self.rows }
    }

    /// Whether no inner product of `gram` has lost digits to the ends of ranges.
    ///
    /// The sum of a class has an error relative to the sum of magnitudes over its own rows. Over the rows of a member these are at most the
    /// product of two norms; where what enters and leaves between the two is no larger than that, the error is at most twice that of a sum
    /// made for the member itself.
    pub fn is_sound(&self, gram: &Gram) -> bool {
        let m = gram.cross.len();
        let norms: Vec<f64> = (0..m).map(|j| gram.matrix.get(j, j).sqrt()).collect();
        let moved: Vec<Vec<f64>> = (0..self.len()).map(|c| self.moved(c)).collect();
        let sound = |member: Member, bound: f64| {
            let class = member.class as usize;
            moved[class][member.shift as usize - self.distinct.classes[class].least] <= bound
        };
        let target = gram.target.sqrt();
        let mut pairs = self.distinct.gram.iter();
        sound(self.distinct.target, gram.target)
            && self.distinct.cross.iter().zip(&norms).all(|(&c, n)| sound(c, n * target))
            && (0..m).all(|j| pairs.by_ref().take(j + 1).zip(&norms).all(|(&pair, n)| sound(pair, n * norms[j])))
    }

    /// The sums of a class at its shifts, from the smallest on.
    fn shifted(&self, class: usize) -> Vec<f64> {
        let Class { factors, base, least, most } = &self.distinct.classes[class];
        if factors.is_empty() {
            return vec![self.rows as f64];
        }
        let edge = |s: usize| self.edges[self.first_edge[class] + s - least].sum;
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

    /// The magnitudes of what enters and leaves between the shift that is summed up and each shift, from the smallest on.
    fn moved(&self, class: usize) -> Vec<f64> {
        let Class { base, least, most, .. } = self.distinct.classes[class];
        let size = |s: usize| self.edges[self.first_edge[class] + s - least].size;
        let mut at = vec![0.0; most - least + 1];
        for s in (least..base).rev() {
            at[s - least] = at[s + 1 - least] + size(s);
        }
        for s in base..most {
            at[s + 1 - least] = at[s - least] + size(s);
        }
        at
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
