//! A tall matrix known by what one can ask of its columns, so that it need not be stored.
//!
//! All sums over rows run over fixed blocks whose partial sums are added in order, so that the result does not depend on
//! the number of threads.

use std::ops::Range;

use rayon::prelude::*;

use crate::{Matrix, dot};

/// What a forward selection needs before its first step.
#[derive(Debug, Clone, PartialEq)]
pub struct Start {
    /// Squared 2-norm of each column.
    pub norms: Vec<f64>,
    /// Inner product of each column with the target.
    pub cross: Vec<f64>,
    /// Squared 2-norm of the target.
    pub target: f64,
}

/// All inner products of the columns of a matrix and a target: what is left of the samples when they are gone.
#[derive(Debug, Clone, PartialEq)]
pub struct Gram {
    /// Phi'Phi, M x M for M columns.
    pub matrix: Matrix,
    /// Inner product of each column with the target.
    pub cross: Vec<f64>,
    /// Squared 2-norm of the target.
    pub target: f64,
    /// Number of rows (samples) that were added up.
    pub rows: usize,
}

/// A matrix Phi with `rows()` samples and `cols()` candidates, of which a caller asks products, never the whole.
///
/// Only [`Columns::fill`] has to be written; the products have plain implementations by tiles of rows, which a structured
/// matrix (a dictionary of monomials) replaces by faster ones.
pub trait Columns: Sync {
    /// Number of rows (samples).
    fn rows(&self) -> usize;

    /// Number of columns (candidates).
    fn cols(&self) -> usize;

    /// Writes the entries `rows` of column `j` into `out`, which has as many places as `rows`.
    fn fill(&self, j: usize, rows: Range<usize>, out: &mut [f64]);

    /// The squared norms of all columns and their inner products with `y` (length `rows()`), in one pass.
    fn start(&self, y: &[f64]) -> Start {
        let (m, rows) = (self.cols(), self.rows());
        let sums = sum_over_blocks(rows, 2 * m + 1, m * rows * 4, |range, sums| {
            let mut tile = vec![0.0; range.len()];
            let w = &y[range.clone()];
            for j in 0..m {
                self.fill(j, range.clone(), &mut tile);
                sums[j] = dot(&tile, &tile);
                sums[m + j] = dot(&tile, w);
            }
            sums[2 * m] = dot(w, w);
        });
        Start { norms: sums[..m].to_vec(), cross: sums[m..2 * m].to_vec(), target: sums[2 * m] }
    }

    /// All inner products with each other and with `y` (length `rows()`) in one pass, where a matrix has a way to them that is cheaper than
    /// [`Columns::start`] and `columns` columns of the Gram matrix, and as exact; `None` otherwise. `usize::MAX` columns ask for the one pass
    /// whatever it costs. Whether it is cheaper is judged by sizes, never by the clock.
    fn gram(&self, y: &[f64], columns: usize) -> Option<Gram> {
        let _ = (y, columns);
        None
    }

    /// The columns `which` of the Gram matrix Phi'Phi, as a `cols()` x `which.len()` matrix, in one pass.
    fn gram_columns(&self, which: &[usize]) -> Matrix {
        let (m, rows, k) = (self.cols(), self.rows(), which.len());
        let sums = sum_over_blocks(rows, m * k, m * k * rows * 2, |range, sums| {
            let n = range.len();
            let mut tile = vec![0.0; n];
            let mut chosen = vec![0.0; n * k];
            for (c, &j) in which.iter().enumerate() {
                self.fill(j, range.clone(), &mut chosen[c * n..(c + 1) * n]);
            }
            for j in 0..m {
                self.fill(j, range.clone(), &mut tile);
                for c in 0..k {
                    sums[c * m + j] = dot(&tile, &chosen[c * n..(c + 1) * n]);
                }
            }
        });
        Matrix::from_column_major(m, k, sums).unwrap_or_else(|| Matrix::zeros(m, k))
    }
}

/// Rows in a tile: two tiles of doubles fit a first-level cache with room to spare.
const TILE: usize = 1024;
/// Fixed number of blocks for long data; more than any sensible number of threads, few enough for their partial sums.
const BLOCKS: usize = 32;
/// Work (in flops) below which threads cost more than they bring.
const SERIAL_BELOW: usize = 4_000_000;

/// `f` of each block, in the order of the blocks; on threads where `work` is at least `worth`.
///
/// A thread takes one block at a time: one that is held up does not keep the others waiting for more than that.
pub fn map_blocks<B: Sync, R: Send>(blocks: &[B], work: usize, worth: usize, f: impl Fn(&B) -> R + Sync) -> Vec<R> {
    if work < worth || blocks.len() < 2 || rayon::current_num_threads() < 2 {
        blocks.iter().map(&f).collect()
    } else {
        blocks.par_iter().with_max_len(1).map(&f).collect()
    }
}

/// The sum over blocks of rows of what `f(rows, partial)` writes into `partial` (length `width`, zero at first).
///
/// `f` is called on tiles of at most 1024 rows. The blocks depend on `rows` only, and their sums are added in order.
/// `work` is the number of flops, from which it is decided whether threads pay.
pub fn sum_over_blocks(
    rows: usize,
    width: usize,
    work: usize,
    f: impl Fn(Range<usize>, &mut [f64]) + Sync,
) -> Vec<f64> {
    let tiles = rows.div_ceil(TILE).max(1);
    let tiles_per_block = tiles.div_ceil(BLOCKS);
    let block = tiles_per_block * TILE;
    let blocks: Vec<Range<usize>> =
        (0..tiles.div_ceil(tiles_per_block)).map(|b| b * block..((b + 1) * block).min(rows)).collect();
    let one = |range: &Range<usize>| {
        let mut sum = vec![0.0; width];
        let mut partial = vec![0.0; width];
        let mut at = range.start;
        while at < range.end {
            let end = (at + TILE).min(range.end);
            partial.fill(0.0);
            f(at..end, &mut partial);
            for (s, p) in sum.iter_mut().zip(&partial) {
                *s += p;
            }
            at = end;
        }
        sum
    };
    let partials = map_blocks(&blocks, work, SERIAL_BELOW, one);
    let mut total = vec![0.0; width];
    for partial in &partials {
        for (t, p) in total.iter_mut().zip(partial) {
            *t += p;
        }
    }
    total
}
