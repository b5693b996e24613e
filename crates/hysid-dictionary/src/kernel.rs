//! All inner products of the dictionary with a few weights in one pass over the samples, columns made on the fly.
//!
//! A term is a head (all factors but the last two) times a tail (its last one or two factors). The distinct tails are multiplied
//! out once a tile; a head is multiplied into each weight once; then every term costs one multiply-add for each weight
//! and sample, as a matrix product of weighted heads with tails. Memory traffic is that of the signals. Heads whose tails end
//! alike (all of a full polynomial dictionary) are taken together, so that the product has enough rows even for one weight.

use hysid_linalg::Columns;
use hysid_linalg::lanes::{LANE, Lane, Machine, Row, Step, multiply, pack, total};
use rayon::prelude::*;

use crate::{Design, Factor, Term};

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
    /// The variables whose product it is.
    head: Vec<usize>,
    /// First lane in the tile of each tail.
    tails: Vec<u32>,
    /// The first of its terms, as a place in `order`; one place for each tail.
    first: usize,
}

/// How a dictionary is evaluated.
#[derive(Debug, Clone)]
pub(crate) struct Plan {
    /// The distinct factors.
    pub variables: Vec<Factor>,
    /// The tails of two factors, as pairs of variables; in the tile they follow the variables.
    pairs: Vec<(usize, usize)>,
    nodes: Vec<Node>,
    /// The dictionary's column of each place.
    order: Vec<usize>,
    /// The column of the constant.
    constant: Option<usize>,
}

impl Plan {
    pub fn new(terms: &[Term]) -> Self {
        let mut variables: Vec<Factor> = terms.iter().flat_map(|t| t.factors().iter().copied()).collect();
        variables.sort();
        variables.dedup();
        let place = |f: &Factor| variables.binary_search(f).unwrap_or(0);
        let constant = terms.iter().position(|t| t.degree() == 0);
        // (head, tail, column), in order of head and tail.
        let mut split: Vec<(Vec<usize>, Vec<usize>, usize)> = terms
            .iter()
            .enumerate()
            .filter(|(_, t)| t.degree() > 0)
            .map(|(j, t)| {
                let mut head: Vec<usize> = t.factors().iter().map(place).collect();
                let tail = head.split_off(head.len().saturating_sub(2));
                (head, tail, j)
            })
            .collect();
        split.sort();
        let mut pairs: Vec<(usize, usize)> =
            split.iter().filter_map(|(_, tail, _)| (tail.len() == 2).then(|| (tail[0], tail[1]))).collect();
        pairs.sort_unstable();
        pairs.dedup();
        let lane = |tail: &[usize]| match *tail {
            [a, b] => (variables.len() + pairs.binary_search(&(a, b)).unwrap_or(0)) * T,
            _ => tail[0] * T,
        };
        let mut nodes: Vec<Node> = Vec::new();
        let mut order = Vec::with_capacity(split.len());
        for (head, tail, column) in &split {
            if nodes.last().is_none_or(|n| n.head != *head) {
                nodes.push(Node { head: head.clone(), tails: Vec::new(), first: order.len() });
            }
            if let Some(node) = nodes.last_mut() {
                node.tails.push(lane(tail) as u32);
            }
            order.push(*column);
        }
        Self { variables, pairs, nodes, order, constant }
    }

    /// Fills in the tails of two factors.
    fn multiply_pairs(&self, tile: &mut [Lane], machine: Machine) {
        let (single, double) = tile.split_at_mut(self.variables.len() * T);
        for (&(a, b), out) in self.pairs.iter().zip(double.chunks_exact_mut(T)) {
            multiply(&single[a * T..(a + 1) * T], &single[b * T..(b + 1) * T], out, machine);
        }
    }

    /// Adds the products of all terms with `k` weights over one tile to `work.sums`.
    fn accumulate(&self, work: &mut Work, k: usize, machine: Machine) {
        let together = (GROUP / k).max(1);
        let places = self.order.len();
        let Work { tile, weights, heads, sums, rows, common, .. } = work;
        for (group, &common) in self.nodes.chunks(together).zip(&*common) {
            for (g, node) in group.iter().enumerate() {
                for c in 0..k {
                    let to = &mut heads[(g * k + c) * T..(g * k + c + 1) * T];
                    let weight = &weights[c * T..(c + 1) * T];
                    match node.head[..] {
                        [] => to.copy_from_slice(weight),
                        [v, ..] => multiply(weight, &tile[v * T..(v + 1) * T], to, machine),
                    }
                    for &v in node.head.iter().skip(1) {
                        multiply_into(to, &tile[v * T..(v + 1) * T]);
                    }
                }
            }
            let first = &group[0];
            for (g, node) in group.iter().enumerate() {
                let own = node.tails.len() - common;
                rows.clear();
                rows.extend((0..k).map(|c| Row { from: (g * k + c) * T, to: c * places + node.first }));
                Step { t: T, rows, left: heads, columns: &node.tails[..own], right: tile, out: sums }.run(machine);
            }
            rows.clear();
            for (g, node) in group.iter().enumerate() {
                let to = node.first + node.tails.len() - common;
                rows.extend((0..k).map(|c| Row { from: (g * k + c) * T, to: c * places + to }));
            }
            let columns = &first.tails[first.tails.len() - common..];
            Step { t: T, rows, left: heads, columns, right: tile, out: sums }.run(machine);
        }
    }
}

/// How many tails all heads of the group end with.
fn common_tails(group: &[Node]) -> usize {
    let Some(shortest) = group.iter().min_by_key(|n| n.tails.len()) else { return 0 };
    let ends = |n: usize| group.iter().all(|node| node.tails.ends_with(&shortest.tails[shortest.tails.len() - n..]));
    (0..=shortest.tails.len()).rev().find(|&n| ends(n)).unwrap_or(0)
}

fn multiply_into(to: &mut [Lane], by: &[Lane]) {
    for (a, b) in to.iter_mut().zip(by) {
        for e in 0..LANE {
            a.0[e] *= b.0[e];
        }
    }
}

/// The buffers of one block of samples.
struct Work {
    /// The variables and the tails of two factors.
    tile: Vec<Lane>,
    weights: Vec<Lane>,
    heads: Vec<Lane>,
    /// `sums[c * places + place]`.
    sums: Vec<Lane>,
    rows: Vec<Row>,
    /// For each group of heads, how many tails all of them end with; what comes before is each head's own.
    common: Vec<usize>,
    plain: Vec<f64>,
}

impl Work {
    fn new(plan: &Plan, k: usize) -> Self {
        let lanes = |n: usize| vec![Lane::default(); n];
        Self {
            tile: lanes((plan.variables.len() + plan.pairs.len()) * T),
            weights: lanes(k * T),
            heads: lanes(k * (GROUP / k).max(1) * T),
            sums: lanes(plan.order.len() * k),
            rows: Vec::new(),
            common: plan.nodes.chunks((GROUP / k).max(1)).map(common_tails).collect(),
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
        if work < SERIAL_BELOW || blocks.len() < 2 || rayon::current_num_threads() < 2 {
            blocks.into_iter().map(f).collect()
        } else {
            blocks.into_par_iter().map(f).collect()
        }
    }

    fn pack_tile(&self, work: &mut Work, at: usize, len: usize, machine: Machine) {
        for (v, &f) in self.plan().variables.iter().enumerate() {
            self.fill_factor(f, at..at + len, &mut work.plain[..len], |o, x| *o = x);
            pack(&work.plain[..len], &mut work.tile[v * T..(v + 1) * T]);
        }
        self.plan().multiply_pairs(&mut work.tile, machine);
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
            let mut at = range.start;
            while at < range.end {
                let len = TILE.min(range.end - at);
                let w = &y[at..at + len];
                target += hysid_linalg::dot(w, w);
                sum += w.iter().sum::<f64>();
                self.pack_tile(&mut work, at, len, machine);
                pack(w, &mut work.weights);
                plan.accumulate(&mut work, 1, machine);
                multiply(&work.tile, &work.tile, &mut squares.tile, machine);
                squares.weights.fill(Lane([1.0; LANE]));
                plan.accumulate(&mut squares, 1, machine);
                at += len;
            }
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
            let mut at = range.start;
            while at < range.end {
                let len = TILE.min(range.end - at);
                self.pack_tile(&mut work, at, len, machine);
                for (c, &j) in which.iter().enumerate() {
                    self.fill(j, at..at + len, &mut work.plain[..len]);
                    constant[c] += work.plain[..len].iter().sum::<f64>();
                    pack(&work.plain[..len], &mut work.weights[c * T..(c + 1) * T]);
                }
                plan.accumulate(&mut work, k, machine);
                at += len;
            }
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
