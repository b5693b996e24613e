//! The kernel that sums up distinct products over tiles of samples.
//!
//! A product is a head times a tail, the tail being its factors of largest lag, half of the degree. Tails with the same heads are the
//! columns, those heads the rows of a matrix product over each tile of samples: a tail has all heads that end before it begins, so that few
//! of these products have few rows.

use std::collections::{BTreeMap, HashMap};

use hysid_linalg::lanes::{LANE, Lane, Machine, Row, Step, flat_mut, multiply, pack, total};
use hysid_linalg::product;

use crate::distinct::Class;
use crate::{Factor, Quantity};

/// Samples in a tile: heads and tails of a tile stay in the second-level cache.
const TILE: usize = 256;
const T: usize = TILE / LANE;

/// One quantity or product of quantities over a tile and the lags before it.
#[derive(Debug)]
struct Series {
    /// The channel, or where in the tile's buffer the two factors begin.
    source: Source,
    /// The largest and smallest shift: the series begins that many samples before the tile.
    most: usize,
    least: usize,
    /// Where it begins in the tile's buffer.
    at: usize,
}

#[derive(Debug)]
enum Source {
    Channel(usize),
    Product(usize, usize),
}

impl Series {
    fn len(&self) -> usize {
        TILE + self.most - self.least
    }
}

/// Tails that have the same heads.
#[derive(Debug)]
struct Group {
    rows: Vec<Row>,
    /// Where in the tile's buffer each tail begins.
    columns: Vec<u32>,
}

/// Heads in a piece; a rest of less than half as many goes to the piece before.
const PIECE: usize = 8;

impl Group {
    fn pieces(&self) -> usize {
        ((self.rows.len() + PIECE / 2) / PIECE).max(1)
    }

    fn piece(&self, number: usize) -> &[Row] {
        let end = if number + 1 == self.pieces() { self.rows.len() } else { (number + 1) * PIECE };
        &self.rows[number * PIECE..end]
    }
}

/// How the classes are summed up over tiles.
#[derive(Debug)]
pub(crate) struct Kernel {
    series: Vec<Series>,
    /// Length of the tile's buffer.
    len: usize,
    /// Each head but the first, which is empty, as an earlier head times the samples that begin in the tile's buffer.
    heads: Vec<(usize, usize)>,
    groups: Vec<Group>,
    /// The class of each sum.
    order: Vec<u32>,
    classes: usize,
    machine: Machine,
}

impl Kernel {
    /// The kernel for these classes of products of `quantities`.
    pub fn new(classes: &[Class], quantities: &[Quantity]) -> Self {
        let half = classes.iter().map(|c| c.factors.len()).max().unwrap_or(0).div_ceil(2).max(1);
        // Series by descending degree, so that what a series is made of is asked for before it is made itself.
        let mut needed = Needed::new();
        let parts: Vec<(Vec<Factor>, Vec<Factor>)> = classes
            .iter()
            .map(|c| {
                let all: Vec<Factor> = c.factors.iter().map(|f| Factor { lag: f.lag + c.base, ..*f }).collect();
                let (head, tail) = all.split_at(all.len().saturating_sub(half));
                (head.to_vec(), tail.to_vec())
            })
            .collect();
        for (head, tail) in parts.iter().filter(|(_, tail)| !tail.is_empty()) {
            need(&mut needed, tail, (0, 0));
            head.iter().for_each(|f| need(&mut needed, &[*f], (0, 0)));
        }
        for degree in (2..=half).rev() {
            let of_degree: Vec<_> =
                needed.range((degree, Vec::new())..(degree + 1, Vec::new())).map(|(k, r)| (k.1.clone(), *r)).collect();
            for (factors, range) in of_degree {
                if let Some((last, before)) = factors.split_last() {
                    need(&mut needed, before, range);
                    need(&mut needed, &[*last], range);
                }
            }
        }
        let mut series: Vec<Series> = Vec::with_capacity(needed.len());
        let mut index: HashMap<Vec<Factor>, usize> = HashMap::new();
        let mut len = 0;
        for ((_, factors), (least, most)) in needed {
            let place = |factors: &[Factor], shift: usize| place(&series, &index, factors, shift);
            let source = match factors.split_last() {
                Some((last, before)) if !before.is_empty() => {
                    Source::Product(place(before, most), place(std::slice::from_ref(last), most))
                }
                _ => Source::Channel(
                    factors.first().and_then(|f| quantities.binary_search(&f.quantity).ok()).unwrap_or(0),
                ),
            };
            index.insert(factors, series.len());
            series.push(Series { source, most, least, at: len });
            // Series that begin at a cache line are written and multiplied faster.
            len += (TILE + most - least).next_multiple_of(LANE);
        }
        // Heads by their factor of largest lag, then the one before it, ...; each with its tails. So a head comes after the one that it is
        // made of, and those that end before a tail begins come before the others: tails that begin later have the same heads and more.
        let key = |head: &[Factor]| head.iter().rev().map(|f| (f.lag, f.quantity)).collect::<Head>();
        let mut by_head: BTreeMap<Head, Vec<(u32, u32)>> = BTreeMap::new();
        for (class, (head, tail)) in parts.iter().enumerate().filter(|(_, (_, tail))| !tail.is_empty()) {
            let head = key(head);
            for n in 1..=head.len() {
                by_head.entry(head[n..].to_vec()).or_default();
            }
            let tail = place(&series, &index, tail, 0) as u32;
            by_head.entry(head).or_default().push((tail, class as u32));
        }
        by_head.entry(Vec::new()).or_default();
        let numbers: HashMap<Head, usize> = by_head.keys().enumerate().map(|(n, head)| (head.clone(), n)).collect();
        let mut heads = Vec::with_capacity(by_head.len());
        // The heads of each tail, and the tails that have the same heads.
        let mut by_tail: BTreeMap<u32, Vec<(usize, u32)>> = BTreeMap::new();
        for (n, (head, tails)) in by_head.into_iter().enumerate() {
            if let Some((&(lag, quantity), before)) = head.split_first() {
                let factor = place(&series, &index, &[Factor { quantity, lag }], 0);
                heads.push((numbers.get(before).copied().unwrap_or(0), factor));
            }
            for (tail, class) in tails {
                by_tail.entry(tail).or_default().push((n, class));
            }
        }
        let mut shared: BTreeMap<Vec<usize>, Vec<(u32, Vec<u32>)>> = BTreeMap::new();
        for (tail, members) in by_tail {
            let (rows, own): (Vec<usize>, Vec<u32>) = members.into_iter().unzip();
            shared.entry(rows).or_default().push((tail, own));
        }
        let mut order = Vec::with_capacity(classes.len());
        let mut groups = Vec::with_capacity(shared.len());
        for (members, tails) in shared {
            let mut rows = Vec::with_capacity(members.len());
            for (r, head) in members.into_iter().enumerate() {
                rows.push(Row { from: head * T, to: order.len() });
                order.extend(tails.iter().map(|(_, own)| own[r]));
            }
            groups.push(Group { rows, columns: tails.iter().map(|(tail, _)| *tail).collect() });
        }
        Self { series, len, heads, groups, order, classes: classes.len(), machine: Machine::detect() }
    }

    /// Multiply-adds for each sample.
    pub fn work(&self) -> usize {
        self.order.len() + self.series.len() + self.heads.len()
    }

    /// The sums of all classes over these ranges of rows, in the order of the classes; `channels` hold the quantities.
    pub fn sums(&self, work: &mut Work, channels: &[Vec<f64>], rows: &[std::ops::Range<usize>]) -> Vec<f64> {
        work.sums.fill(Lane::default());
        for range in rows {
            let mut at = range.start;
            while at < range.end {
                let len = TILE.min(range.end - at);
                self.tile(work, channels, at, len);
                at += len;
            }
        }
        let mut sums = vec![0.0; self.classes];
        for (lane, &class) in work.sums.iter().zip(&self.order) {
            sums[class as usize] = total(lane);
        }
        sums
    }

    /// Adds the `len` rows from `at` on.
    fn tile(&self, work: &mut Work, channels: &[Vec<f64>], at: usize, len: usize) {
        let Work { tile, heads, sums } = work;
        let tile = flat_mut(tile);
        for s in &self.series {
            let (made, rest) = tile.split_at_mut(s.at);
            let out = &mut rest[..s.len()];
            match s.source {
                Source::Channel(c) => {
                    let filled = s.most - s.least + len;
                    out[..filled].copy_from_slice(&channels[c][at - s.most..at - s.least + len]);
                    out[filled..].fill(0.0);
                }
                Source::Product(a, b) => product(&made[a..], &made[b..], out),
            }
        }
        // The empty head is 1 on the rows and 0 beyond them, and so every head is 0 beyond them.
        pack(&[1.0; TILE][..len], &mut heads[..T]);
        for (n, &(before, factor)) in self.heads.iter().enumerate() {
            let (made, rest) = heads.split_at_mut((n + 1) * T);
            multiply(&made[before * T..(before + 1) * T], &tile[factor..factor + TILE], &mut rest[..T], self.machine);
        }
        // A few heads at a time with the tails of all groups: they stay in the first-level cache meanwhile.
        let most = self.groups.iter().map(Group::pieces).max().unwrap_or(0);
        for piece in 0..most {
            for group in self.groups.iter().filter(|g| piece < g.pieces()) {
                let (rows, columns) = (group.piece(piece), &group.columns[..]);
                Step { t: T, rows, left: heads, columns, right: tile, out: sums }.run(self.machine);
            }
        }
    }
}

/// The factors of a head as lag and quantity, the largest lag first.
type Head = Vec<(usize, Quantity)>;

/// Series by degree and factors, the first of lag 0, with the smallest and largest shift.
type Needed = BTreeMap<(usize, Vec<Factor>), (usize, usize)>;

/// The factors without the lag of the first, and that lag.
fn without_shift(factors: &[Factor]) -> (Vec<Factor>, usize) {
    let first = factors.first().map_or(0, |f| f.lag);
    (factors.iter().map(|f| Factor { lag: f.lag - first, ..*f }).collect(), first)
}

/// Asks for the product of these factors at these further shifts.
fn need(needed: &mut Needed, factors: &[Factor], (least, most): (usize, usize)) {
    let (own, first) = without_shift(factors);
    let range = needed.entry((factors.len(), own)).or_insert((least + first, most + first));
    *range = (range.0.min(least + first), range.1.max(most + first));
}

/// Where in the tile's buffer the product of these factors, shifted further, begins.
fn place(series: &[Series], index: &HashMap<Vec<Factor>, usize>, factors: &[Factor], shift: usize) -> usize {
    let (own, first) = without_shift(factors);
    index.get(&own).and_then(|&i| series.get(i)).map_or(0, |s| s.at + s.most - first - shift)
}

/// The buffers of one thread.
#[derive(Debug)]
pub(crate) struct Work {
    tile: Vec<Lane>,
    heads: Vec<Lane>,
    sums: Vec<Lane>,
}

impl Work {
    pub fn new(kernel: &Kernel) -> Self {
        Self {
            tile: vec![Lane::default(); kernel.len / LANE],
            heads: vec![Lane::default(); (kernel.heads.len() + 1) * T],
            sums: vec![Lane::default(); kernel.order.len()],
        }
    }
}
