//! All inner products of the dictionary with a few weights in one pass over the samples, columns made on the fly.
//!
//! The terms form a tree: a term is its prefix (all factors but the last) times its last factor. A prefix is multiplied out once a
//! tile, and every term below it costs one multiply-add a sample and weight; memory traffic is that of the
//! signals. This is the (degree 2) x (lag) form of the cubic dictionary, for any set of terms.

use hysid_linalg::Columns;
use hysid_linalg::lanes::{LANE, Lane, Machine, Step, multiply, pack, total};
use rayon::prelude::*;

use crate::{Design, Factor, Term};

/// Samples in a tile: the factors of a tile stay in the second-level cache, weights and prefix in the first.
const TILE: usize = 256;
/// Lanes in a tile.
const T: usize = TILE / LANE;
/// Shortest block of samples that a thread is given.
const SHORTEST_BLOCK: usize = 8 * TILE;
/// Blocks that long data are cut into, whatever the number of threads.
const BLOCKS: usize = 16;
/// Work (in multiply-adds) below which threads cost more than they bring.
const SERIAL_BELOW: usize = 3_000_000;

/// A prefix and the terms below it.
#[derive(Debug, Clone)]
struct Node {
    /// The variable that makes this prefix of its parent's; `None` at the root.
    variable: Option<usize>,
    /// Number of factors.
    depth: usize,
    /// First lane in the tile of each last factor.
    factors: Vec<u32>,
    /// The terms, as places in `order`, begin here.
    first: usize,
}

/// How a dictionary is evaluated.
#[derive(Debug, Clone)]
pub(crate) struct Plan {
    /// The distinct factors.
    pub variables: Vec<Factor>,
    nodes: Vec<Node>,
    /// The dictionary's column of each place.
    order: Vec<usize>,
    /// The column of the constant.
    constant: Option<usize>,
    depth: usize,
}

impl Plan {
    pub fn new(terms: &[Term]) -> Self {
        let mut variables: Vec<Factor> = terms.iter().flat_map(|t| t.factors().iter().copied()).collect();
        variables.sort();
        variables.dedup();
        let place = |f: &Factor| variables.binary_search(f).unwrap_or(0);
        let constant = terms.iter().position(|t| t.degree() == 0);
        // Sorted by factors, a prefix stands before everything below it.
        let mut sorted: Vec<(Vec<usize>, usize)> = terms
            .iter()
            .enumerate()
            .filter(|(_, t)| t.degree() > 0)
            .map(|(j, t)| (t.factors().iter().map(place).collect(), j))
            .collect();
        let prefix = |f: &[usize]| f[..f.len() - 1].to_vec();
        sorted.sort_by(|a, b| (prefix(&a.0), &a.0).cmp(&(prefix(&b.0), &b.0)));
        let mut nodes: Vec<Node> = Vec::new();
        let mut path: Vec<usize> = Vec::new();
        let mut order = Vec::with_capacity(sorted.len());
        for (factors, column) in &sorted {
            let wanted = prefix(factors);
            if nodes.is_empty() || path != wanted {
                // Prefixes that are no node yet (their own terms were ruled out) become nodes without terms.
                let shared = path.iter().zip(&wanted).take_while(|(a, b)| a == b).count();
                if nodes.is_empty() && !wanted.is_empty() {
                    nodes.push(Node { variable: None, depth: 0, factors: Vec::new(), first: 0 });
                }
                for depth in shared..wanted.len() {
                    let variable = Some(wanted[depth]);
                    nodes.push(Node { variable, depth: depth + 1, factors: Vec::new(), first: order.len() });
                }
                if wanted.is_empty() {
                    nodes.push(Node { variable: None, depth: 0, factors: Vec::new(), first: 0 });
                }
                path = wanted;
            }
            if let (Some(node), Some(&last)) = (nodes.last_mut(), factors.last()) {
                node.factors.push((last * T) as u32);
            }
            order.push(*column);
        }
        let depth = nodes.iter().map(|n| n.depth).max().unwrap_or(0);
        Self { variables, nodes, order, constant, depth }
    }

    /// Adds the products of all terms with `k` weights over one tile to `sums`.
    ///
    /// `tile` holds the variables one after the other. `sums` has k lanes for each place.
    fn accumulate(&self, work: &mut Work, tile: &[Lane], k: usize, machine: Machine) {
        for node in &self.nodes {
            if let (Some(v), true) = (node.variable, node.depth > 1) {
                let (head, tail) = work.products.split_at_mut((node.depth - 1) * T);
                multiply(&head[(node.depth - 2) * T..], &tile[v * T..(v + 1) * T], &mut tail[..T], machine);
            } else if let Some(v) = node.variable {
                work.products[..T].copy_from_slice(&tile[v * T..(v + 1) * T]);
            }
            if node.factors.is_empty() {
                continue;
            }
            let prefix = node.depth.checked_sub(1).map(|d| &work.products[d * T..(d + 1) * T]);
            let (weights, factors) = (&work.weights[..], &node.factors[..]);
            let out = &mut work.sums[node.first * k..(node.first + factors.len()) * k];
            Step { t: T, k, prefix, weights, tile, factors, scratch: &mut work.scratch, out }.run(machine);
        }
    }
}

/// The buffers of one block of samples.
struct Work {
    tile: Vec<Lane>,
    products: Vec<Lane>,
    weights: Vec<Lane>,
    scratch: Vec<Lane>,
    sums: Vec<Lane>,
    plain: Vec<f64>,
}

impl Work {
    fn new(plan: &Plan, k: usize) -> Self {
        let lanes = |n: usize| vec![Lane::default(); n];
        Self {
            tile: lanes(plan.variables.len() * T),
            products: lanes(plan.depth.max(1) * T),
            weights: lanes(k * T),
            scratch: lanes(k * T),
            sums: lanes(plan.order.len() * k),
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

    fn pack_tile(&self, work: &mut Work, at: usize, len: usize) {
        for (v, &f) in self.plan().variables.iter().enumerate() {
            self.fill_factor(f, at..at + len, &mut work.plain[..len], |o, x| *o = x);
            pack(&work.plain[..len], &mut work.tile[v * T..(v + 1) * T]);
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
            let mut at = range.start;
            while at < range.end {
                let len = TILE.min(range.end - at);
                let w = &y[at..at + len];
                target += hysid_linalg::dot(w, w);
                sum += w.iter().sum::<f64>();
                self.pack_tile(&mut work, at, len);
                pack(w, &mut work.weights);
                let tile = std::mem::take(&mut work.tile);
                plan.accumulate(&mut work, &tile, 1, machine);
                multiply(&tile, &tile, &mut squares.tile, machine);
                squares.weights.fill(Lane([1.0; LANE]));
                work.tile = tile;
                let tile = std::mem::take(&mut squares.tile);
                plan.accumulate(&mut squares, &tile, 1, machine);
                squares.tile = tile;
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
                self.pack_tile(&mut work, at, len);
                for (c, &j) in which.iter().enumerate() {
                    self.fill(j, at..at + len, &mut work.plain[..len]);
                    constant[c] += work.plain[..len].iter().sum::<f64>();
                    pack(&work.plain[..len], &mut work.weights[c * T..(c + 1) * T]);
                }
                let tile = std::mem::take(&mut work.tile);
                plan.accumulate(&mut work, &tile, k, machine);
                work.tile = tile;
                at += len;
            }
            let mut out = vec![0.0; m * k];
            for (place, &j) in plan.order.iter().enumerate() {
                for c in 0..k {
                    out[c * m + j] = total(&work.sums[place * k + c]);
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
