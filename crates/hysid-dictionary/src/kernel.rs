//! All inner products of the dictionary with a few weights in one pass over the samples, columns made on the fly.
//!
//! A term is a head (all factors but the last two) times a tail (its last one or two factors). Tails that differ by a shift in
//! time only are one series, multiplied out once a tile; a head is multiplied into each weight once; then every term costs one multiply-add for each weight
//! and sample, as a matrix product of weighted heads with tails. Memory traffic is that of the signals. Heads whose tails end
//! alike (all of a full polynomial dictionary) are taken together, so that the product has enough rows even for one weight.

use std::collections::BTreeMap;

use hysid_linalg::lanes::{LANE, Lane, Machine, Row, Step, flat, flat_mut, multiply, pack, total};
use hysid_linalg::{Columns, map_blocks, multiply_by, product};

use crate::design::Stretch;
use crate::{Design, Factor, Quantity, Term};

/// Samples in a tile: the factors of a tile stay in the second-level cache, weights and prefix in the first.
const TILE: usize = 256;
/// Lanes in a tile.
const T: usize = TILE / LANE;
/// Rows that the matrix product is given at least, where there are so many.
const GROUP: usize = 8;
/// Shortest block of samples that a thread is given.
const SHORTEST_BLOCK: usize = 8 * TILE;
/// Blocks that long data are cut into, whatever the number of threads.
const BLOCKS: usize = 16;
/// Work (in multiply-adds) below which threads cost more than they bring.
const SERIAL_BELOW: usize = 3_000_000;

/// A head and the terms that it makes.
#[derive(Debug, Clone)]
struct Node {
    /// Where in the tile the factors begin whose product it is.
    head: Vec<usize>,
    /// Where in the tile each tail begins.
    tails: Vec<u32>,
    /// The first of its terms, as a place in `order`; one place for each tail.
    first: usize,
}

/// One quantity over a tile and the lags before it.
#[derive(Debug, Clone)]
struct Series {
    quantity: Quantity,
    /// The largest lag: the series begins so many samples before the tile.
    most: usize,
    /// Where it begins in the tile's buffer.
    at: usize,
}

/// The product of two series at a fixed difference of lags.
#[derive(Debug, Clone)]
struct Product {
    /// Where the factors begin in the tile's buffer.
    factors: (usize, usize),
    /// Where it begins, and its length.
    at: usize,
    len: usize,
}

/// How a dictionary is evaluated.
#[derive(Debug, Clone)]
pub(crate) struct Plan {
    series: Vec<Series>,
    products: Vec<Product>,
    /// Length of the tile's buffer.
    len: usize,
    nodes: Vec<Node>,
    /// The dictionary's column of each place.
    order: Vec<usize>,
    /// The column of the constant.
    constant: Option<usize>,
}

/// Two quantities and by how much the second lags behind the first.
type Class = (Quantity, Quantity, isize);

fn class_of(a: Factor, b: Factor) -> Class {
    (a.quantity, b.quantity, b.lag as isize - a.lag as isize)
}

impl Plan {
    pub fn new(terms: &[Term]) -> Self {
        let mut factors: Vec<Factor> = terms.iter().flat_map(|t| t.factors().iter().copied()).collect();
        factors.sort();
        factors.dedup();
        let mut len = 0;
        let mut series: Vec<Series> = Vec::new();
        let mut quantities: Vec<Quantity> = factors.iter().map(|f| f.quantity).collect();
        quantities.dedup();
        for quantity in quantities {
            let most = factors.iter().filter(|f| f.quantity == quantity).map(|f| f.lag).max().unwrap_or(0);
            series.push(Series { quantity, most, at: len });
            // Series that begin at a cache line are written faster.
            len += (most + TILE).next_multiple_of(LANE);
        }
        let place = |f: Factor| series.iter().find(|s| s.quantity == f.quantity).map_or(0, |s| s.at + s.most - f.lag);
        // Each class of tails, with the smallest and largest lag of its first factor.
        let mut classes: BTreeMap<Class, (usize, usize)> = BTreeMap::new();
        // (head, tail, column), in order of head and tail.
        let mut split: Vec<(&[Factor], &[Factor], usize)> = Vec::new();
        for (j, term) in terms.iter().enumerate().filter(|(_, t)| t.degree() > 0) {
            let (head, tail) = term.factors().split_at(term.degree().saturating_sub(2));
            if let [a, b] = *tail {
                let range = classes.entry(class_of(a, b)).or_insert((a.lag, a.lag));
                *range = (range.0.min(a.lag), range.1.max(a.lag));
            }
            split.push((head, tail, j));
        }
        split.sort();
        let mut products = Vec::with_capacity(classes.len());
        let mut begins: BTreeMap<Class, usize> = BTreeMap::new();
        for (&class, &(least, most)) in &classes {
            let first = Factor { quantity: class.0, lag: most };
            let second = Factor { quantity: class.1, lag: most.saturating_add_signed(class.2) };
            let own = TILE + most - least;
            products.push(Product { factors: (place(first), place(second)), at: len, len: own });
            begins.insert(class, len + most);
            len += own.next_multiple_of(LANE);
        }
        let begin = |tail: &[Factor]| match *tail {
            [a, b] => begins.get(&class_of(a, b)).map_or(0, |at| at - a.lag),
            _ => place(tail[0]),
        };
        let mut nodes: Vec<Node> = Vec::new();
        let mut order = Vec::with_capacity(split.len());
        let mut before: Option<&[Factor]> = None;
        for (own_head, tail, column) in split {
            if before != Some(own_head) {
                let head = own_head.iter().map(|&f| place(f)).collect();
                nodes.push(Node { head, tails: Vec::new(), first: order.len() });
                before = Some(own_head);
            }
            if let Some(node) = nodes.last_mut() {
                node.tails.push(begin(tail) as u32);
            }
            order.push(column);
        }
        let constant = terms.iter().position(|t| t.degree() == 0);
        Self { series, products, len, nodes, order, constant }
    }

    /// Adds the products of all terms with `k` weights over one tile to `work.sums`.
    fn accumulate(&self, work: &mut Work, k: usize, machine: Machine) {
        let together = (GROUP / k).max(1);
        let places = self.order.len();
        let Work { tile, weights, heads, sums, rows, shared, .. } = work;
        let tile = flat(tile);
        for (group, shared) in self.nodes.chunks(together).zip(&*shared) {
            for (g, node) in group.iter().enumerate() {
                for c in 0..k {
                    let to = &mut heads[(g * k + c) * T..(g * k + c + 1) * T];
                    let weight = &weights[c * T..(c + 1) * T];
                    match node.head[..] {
                        [] => to.copy_from_slice(weight),
                        [at, ..] => multiply(weight, &tile[at..at + TILE], to, machine),
                    }
                    for &at in node.head.iter().skip(1) {
                        multiply_by(&tile[at..at + TILE], flat_mut(to));
                    }
                }
            }
            // `len` tails, from the one `end` before the last on, of these nodes, the first of which is number `from` of the group.
            let mut step = |from: usize, nodes: &[Node], end: usize, len: usize| {
                if len == 0 {
                    return;
                }
                rows.clear();
                for (g, node) in nodes.iter().enumerate() {
                    let to = node.first + node.tails.len() - end;
                    rows.extend((0..k).map(|c| Row { from: ((from + g) * k + c) * T, to: c * places + to }));
                }
                let first = &nodes[0].tails;
                let columns = &first[first.len() - end..first.len() - end + len];
                Step { t: T, rows, left: heads, columns, right: tile, out: sums }.run(machine);
            };
            for (g, node) in group.iter().enumerate() {
                let next = shared.get(g + 1).copied().unwrap_or(0);
                // A node's own tails, and those that all nodes up to it end with but the next does not.
                step(g, &group[g..=g], node.tails.len(), node.tails.len() - shared[g]);
                step(0, &group[..=g], shared[g], shared[g] - next);
            }
        }
    }
}

/// How many tails the first, the first two, ... heads of the group all end with.
fn shared_tails(group: &[Node]) -> Vec<usize> {
    let first = &group[0].tails;
    let ends_alike = |node: &Node| node.tails.iter().rev().zip(first.iter().rev()).take_while(|(a, b)| a == b).count();
    let smallest = |least: &mut usize, node: &Node| {
        *least = ends_alike(node).min(*least);
        Some(*least)
    };
    group.iter().scan(usize::MAX, smallest).collect()
}

/// The buffers of one block of samples.
struct Work {
    /// The series, and the products that tails of two factors are.
    tile: Vec<Lane>,
    weights: Vec<Lane>,
    heads: Vec<Lane>,
    /// `sums[c * places + place]`.
    sums: Vec<Lane>,
    rows: Vec<Row>,
    /// For each group of heads, how many tails the first, the first two, ... of them end with.
    shared: Vec<Vec<usize>>,
    plain: Vec<f64>,
}

impl Work {
    fn new(plan: &Plan, k: usize) -> Self {
        let lanes = |n: usize| vec![Lane::default(); n];
        Self {
            tile: lanes(plan.len / LANE),
            weights: lanes(k * T),
            heads: lanes(k * (GROUP / k).max(1) * T),
            sums: lanes(plan.order.len() * k),
            rows: Vec::new(),
            shared: plan.nodes.chunks((GROUP / k).max(1)).map(shared_tails).collect(),
            plain: vec![0.0; TILE],
        }
    }
}

impl Design<'_> {
    /// Runs `f` on fixed blocks of rows, on threads when the work is worth it; results in the order of the blocks.
    fn over_blocks<R: Send>(&self, work: usize, f: impl Fn(std::ops::Range<usize>) -> R + Sync + Send) -> Vec<R> {
        let rows = self.rows();
        let block = rows.div_ceil(BLOCKS).max(SHORTEST_BLOCK).div_ceil(TILE) * TILE;
        let blocks: Vec<_> = (0..rows.div_ceil(block)).map(|b| b * block..((b + 1) * block).min(rows)).collect();
        map_blocks(&blocks, work, SERIAL_BELOW, |range| f(range.clone()))
    }

    /// Calls `f(at, len)` for the tiles of a range of rows; a tile lies within one stretch.
    fn over_tiles(&self, rows: std::ops::Range<usize>, mut f: impl FnMut(&Stretch, usize, usize)) {
        let stretches = self.stretches();
        let mut which = stretches.partition_point(|s| s.row + s.len <= rows.start);
        let mut at = rows.start;
        while let Some(stretch) = stretches.get(which).filter(|_| at < rows.end) {
            let end = rows.end.min(stretch.row + stretch.len);
            while at < end {
                let len = TILE.min(end - at);
                f(stretch, at, len);
                at += len;
            }
            which += 1;
        }
    }

    /// Fills the tile's buffer for `len` rows from `at` on; places beyond them hold zeros or products with zeros.
    fn fill_tile(&self, tile: &mut [f64], stretch: &Stretch, at: usize, len: usize) {
        let plan = self.plan();
        let first = stretch.first + (at - stretch.row);
        for s in &plan.series {
            let out = &mut tile[s.at..s.at + s.most + TILE];
            let from = self.samples_of(stretch.record, s.quantity);
            out[..s.most + len].copy_from_slice(&from[first - s.most..first + len]);
            out[s.most + len..].fill(0.0);
        }
        let after_series = plan.products.first().map_or(tile.len(), |p| p.at);
        let (series, rest) = tile.split_at_mut(after_series);
        for p in &plan.products {
            let (a, b) = (&series[p.factors.0..], &series[p.factors.1..]);
            product(a, b, &mut rest[p.at - after_series..p.at - after_series + p.len]);
        }
    }

    /// Norms of all columns and their products with `y`.
    pub(crate) fn fused_start(&self, y: &[f64]) -> hysid_linalg::Start {
        let (plan, m) = (self.plan(), self.cols());
        let machine = Machine::detect();
        let partials = self.over_blocks(2 * m * self.rows(), |range| {
            let mut work = Work::new(plan, 1);
            let mut squares = Work::new(plan, 1);
            let mut target = 0.0;
            // The squared norm of the constant is the number of rows; its product with y is the sum of y.
            let (mut sum, count) = (0.0, range.len() as f64);
            self.over_tiles(range, |stretch, at, len| {
                let w = &y[at..at + len];
                target += hysid_linalg::dot(w, w);
                sum += w.iter().sum::<f64>();
                self.fill_tile(flat_mut(&mut work.tile), stretch, at, len);
                pack(w, &mut work.weights);
                plan.accumulate(&mut work, 1, machine);
                product(flat(&work.tile), flat(&work.tile), flat_mut(&mut squares.tile));
                work.plain[..len].fill(1.0);
                pack(&work.plain[..len], &mut squares.weights);
                plan.accumulate(&mut squares, 1, machine);
            });
            let mut out = vec![0.0; 2 * m + 1];
            for (place, &j) in plan.order.iter().enumerate() {
                out[j] = total(&squares.sums[place]);
                out[m + j] = total(&work.sums[place]);
            }
            if let Some(j) = plan.constant {
                (out[j], out[m + j]) = (count, sum);
            }
            out[2 * m] = target;
            out
        });
        let sums = add_up(partials);
        hysid_linalg::Start { norms: sums[..m].to_vec(), cross: sums[m..2 * m].to_vec(), target: sums[2 * m] }
    }

    /// The columns `which` of the Gram matrix.
    pub(crate) fn fused_gram_columns(&self, which: &[usize]) -> Vec<f64> {
        let (plan, m, k) = (self.plan(), self.cols(), which.len());
        let machine = Machine::detect();
        let partials = self.over_blocks(m * k * self.rows(), |range| {
            let mut work = Work::new(plan, k);
            let mut constant = vec![0.0; k];
            self.over_tiles(range, |stretch, at, len| {
                self.fill_tile(flat_mut(&mut work.tile), stretch, at, len);
                for (weights, &j) in work.weights.chunks_exact_mut(T).zip(which) {
                    let weights = flat_mut(weights);
                    self.fill(j, at..at + len, &mut weights[..len]);
                    weights[len..].fill(0.0);
                }
                if plan.constant.is_some() {
                    add_sums(flat(&work.weights), len, &mut constant);
                }
                plan.accumulate(&mut work, k, machine);
            });
            let mut out = vec![0.0; m * k];
            for (place, &j) in plan.order.iter().enumerate() {
                for c in 0..k {
                    out[c * m + j] = total(&work.sums[c * plan.order.len() + place]);
                }
            }
            if let Some(j) = plan.constant {
                for c in 0..k {
                    out[c * m + j] = constant[c];
                }
            }
            out
        });
        add_up(partials)
    }
}

/// Adds to each of `sums` the sum of the first `len` samples of its tile, sample by sample; four tiles take turns, so that no addition waits
/// for the one before.
fn add_sums(tiles: &[f64], len: usize, sums: &mut [f64]) {
    for (tiles, sums) in tiles.chunks(4 * TILE).zip(sums.chunks_mut(4)) {
        let tile = |c: usize| &tiles[c * TILE..c * TILE + len];
        match sums {
            [a, b, c, d] => {
                let own = sums_of([tile(0), tile(1), tile(2), tile(3)]);
                [a, b, c, d].into_iter().zip(own).for_each(|(sum, own)| *sum += own);
            }
            few => few.iter_mut().enumerate().for_each(|(c, sum)| *sum += sums_of([tile(c)])[0]),
        }
    }
}

#[allow(clippy::needless_range_loop, reason = "several tiles at the same place")]
fn sums_of<const C: usize>(tiles: [&[f64]; C]) -> [f64; C] {
    let len = tiles.iter().map(|t| t.len()).min().unwrap_or(0);
    let tiles = tiles.map(|t| &t[..len]);
    let mut sums = [0.0; C];
    for n in 0..len {
        for c in 0..C {
            sums[c] += tiles[c][n];
        }
    }
    sums
}

/// The sum of the partial results, in order.
fn add_up(partials: Vec<Vec<f64>>) -> Vec<f64> {
    let mut partials = partials.into_iter();
    let mut sum = partials.next().unwrap_or_default();
    for partial in partials {
        for (s, p) in sum.iter_mut().zip(&partial) {
            *s += p;
        }
    }
    sum
}
