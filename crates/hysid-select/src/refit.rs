//! The chosen columns factored again from the samples: coefficients, error reduction ratios, exact PRESS for every length
//! of the path, in two passes over the samples and the memory of a tile.
//!
//! With A = Q R the leave-one-out error of sample t is e_t / (1 - h_tt), h_tt the squared norm of row t of Q, and for the
//! first k columns both come from the first k entries of that row.

use std::ops::Range;

use hysid_linalg::lanes::subtract_multiples;
use hysid_linalg::{
    Columns, Gram, Lstsq, Matrix, TallQr, dot, leave_one_out_sum, lstsq, map_blocks, solve_factor, sum_over_blocks,
    take_out,
};

use crate::Criterion;
use crate::criterion::{Facts, value};

/// What inner products in double precision cannot tell from nothing, relative to y'y.
pub(crate) const EXACT: f64 = 1e-14;

/// What the samples say of a path of columns; entry k - 1 is for the first k columns.
#[derive(Debug, Clone)]
pub(crate) struct Refit {
    pub err: Vec<f64>,
    pub sse: Vec<f64>,
    pub press: Vec<f64>,
    /// Sum of squared errors on left-out blocks; NaN where not asked for.
    pub blocks: Vec<f64>,
    pub condition: Vec<f64>,
    /// Columns that these were chosen from.
    candidates: usize,
    /// R of the columns and the target, column-major.
    factor: Vec<f64>,
    /// Whether it comes from the samples, not from inner products.
    pub from_samples: bool,
}

/// What a refit is to find out beside the residuals.
#[derive(Debug, Clone)]
pub(crate) enum Goal {
    /// Leave-one-out errors only.
    Samples,
    /// The errors on left-out blocks of rows too.
    Blocks(Vec<Range<usize>>),
}

impl Goal {
    pub fn of(criterion: &Criterion) -> Self {
        match criterion {
            Criterion::Blocks(blocks) => Self::Blocks(blocks.clone()),
            _ => Self::Samples,
        }
    }
}

impl Refit {
    /// The least-squares solution with the first `k` columns.
    pub fn solution(&self, k: usize) -> Lstsq {
        let (n, w) = (self.err.len(), self.err.len() + 1);
        // The rows of the target's column below k are residual when only k columns are used.
        let mut r = vec![0.0; (k + 1) * (k + 1)];
        for j in 0..k {
            r[j * (k + 1)..j * (k + 1) + k].copy_from_slice(&self.factor[j * w..j * w + k]);
        }
        let target = &self.factor[n * w..];
        r[k * (k + 1)..k * (k + 1) + k].copy_from_slice(&target[..k]);
        r[k * (k + 1) + k] = target[k..].iter().map(|v| v * v).sum::<f64>().sqrt();
        solve_factor(&r, k)
    }

    /// What is known of the first `k` columns.
    pub fn facts(&self, k: usize, samples: usize) -> Facts {
        let (sse, press, blocks) = (self.sse[k - 1], self.press[k - 1], self.blocks[k - 1]);
        Facts { terms: k, samples, candidates: self.candidates, sse, press, blocks }
    }

    /// The criterion for 1, 2, ... columns.
    pub fn values(&self, criterion: &Criterion, samples: usize) -> Vec<f64> {
        (1..=self.sse.len()).map(|k| value(criterion, self.facts(k, samples))).collect()
    }
}

/// Rows that are factored at a time.
const TILE: usize = 256;
/// Blocks that long data are cut into, whatever the number of threads.
const BLOCKS: usize = 16;
/// Work (in flops) below which threads cost more than they bring.
const SERIAL_BELOW: usize = 8_000_000;

/// A leverage this close to 1 leaves nothing to leave out.
const FULL_LEVERAGE: f64 = 1e-10;

/// From the samples, in two passes.
pub(crate) fn from_samples<C: Columns + ?Sized>(
    phi: &C,
    y: &[f64],
    columns: &[usize],
    energy: f64,
    goal: Goal,
) -> Refit {
    let (n, rows) = (columns.len(), phi.rows());
    let r = factor(phi, y, columns);
    let press = sum_over_blocks(rows, n, rows * n * n, |range, sums| {
        // In tiles that stay in the first-level cache with all columns.
        for at in range.clone().step_by(TILE) {
            rotate(phi, y, columns, &r, at..(at + TILE).min(range.end), |k, _, e, free| {
                sums[k] += leave_one_out_sum(e, free, FULL_LEVERAGE);
            });
        }
    });
    let press = press.iter().map(|p| p / energy).collect();
    let blocks = match goal {
        Goal::Samples => vec![f64::NAN; n],
        Goal::Blocks(blocks) => left_out_blocks(phi, y, columns, &r, &blocks).iter().map(|b| b / energy).collect(),
    };
    let (err, sse, condition) = path(&r, n, energy);
    Refit { err, sse, press, blocks, condition, candidates: phi.cols(), factor: r, from_samples: true }
}

/// From inner products alone: the Cholesky factor in place of the QR, and equation (18) with its square in place of the exact
/// leave-one-out sum, SSE / (1 - n/N)^2. The two differ by what leverages differ among samples, of the order of n/N.
pub(crate) fn from_gram(gram: &Gram, columns: &[usize], energy: f64) -> Refit {
    let n = columns.len();
    let r = cholesky(gram, columns);
    let (err, mut sse, condition) = path(&r, n, energy);
    sse.iter_mut().for_each(|s| *s = s.max(EXACT));
    let share = |k: usize| 1.0 - (k + 1) as f64 / gram.rows as f64;
    let press = sse.iter().enumerate().map(|(k, s)| s / share(k).max(FULL_LEVERAGE).powi(2)).collect();
    let (candidates, blocks) = (gram.matrix.cols(), vec![f64::NAN; n]);
    Refit { err, sse, press, blocks, condition, candidates, factor: r, from_samples: false }
}

/// Error reduction ratios, what is left of the target, and the condition, for every length of the path that R factors.
fn path(r: &[f64], n: usize, energy: f64) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    let w = n + 1;
    let norm = |j: usize| (0..=j).map(|i| r[j * w + i].powi(2)).sum::<f64>().sqrt();
    let mut err = Vec::with_capacity(n);
    let mut condition = Vec::with_capacity(n);
    let (mut largest, mut smallest) = (0.0f64, f64::INFINITY);
    for k in 0..n {
        err.push(r[n * w + k].powi(2) / energy);
        let relative = if norm(k) > 0.0 { r[k * w + k] / norm(k) } else { 0.0 };
        largest = largest.max(relative);
        smallest = smallest.min(relative);
        condition.push(if smallest > 0.0 { largest / smallest } else { f64::INFINITY });
    }
    let left = r[n * w + n].powi(2) / energy;
    let mut sse = vec![0.0; n];
    let mut tail = left;
    for k in (0..n).rev() {
        sse[k] = tail;
        tail += err[k];
    }
    (err, sse, condition)
}

/// Rows of Q, and with them the residual and 1 - h of every sample, for the first 1, 2, ... columns.
///
/// `each(k, q, e, free)` sees the first k + 1 columns of Q (column by column), e and 1 - h with k + 1 columns.
fn rotate<C: Columns + ?Sized>(
    phi: &C,
    y: &[f64],
    columns: &[usize],
    r: &[f64],
    range: Range<usize>,
    mut each: impl FnMut(usize, &[f64], &[f64], &[f64]),
) {
    let (n, len) = (columns.len(), range.len());
    let w = n + 1;
    let mut q = vec![0.0; len * n];
    let mut residual = y[range.clone()].to_vec();
    let mut free = vec![1.0; len];
    for k in 0..n {
        let (before, rest) = q.split_at_mut(k * len);
        let qk = &mut rest[..len];
        phi.fill(columns[k], range.clone(), qk);
        subtract_multiples(&r[k * w..k * w + k], before, qk);
        let pivot = r[k * w + k];
        let inverse = if pivot > 0.0 { 1.0 / pivot } else { 0.0 };
        let g = r[n * w + k];
        take_out(inverse, g, qk, &mut residual, &mut free);
        each(k, &q[..(k + 1) * len], &residual, &free);
    }
}

/// The sum of squared errors on left-out blocks, for the first 1, 2, ... columns.
///
/// With Q_b the rows of Q in the block, P = Q_b'Q_b, v = Q_b'e_b and z = (I - P)^-1 v, the errors without the block are
/// e_b + Q_b z, and their sum of squares e'e + 2 v'z + z'P z.
fn left_out_blocks<C: Columns + ?Sized>(
    phi: &C,
    y: &[f64],
    columns: &[usize],
    r: &[f64],
    blocks: &[Range<usize>],
) -> Vec<f64> {
    let n = columns.len();
    let mut total = vec![0.0; n];
    for block in blocks.iter().filter(|b| !b.is_empty()) {
        // For each k: e'e, v (k + 1 entries), and the new row of P (k + 1 entries).
        let place: Vec<usize> = (0..=n).map(|k| k + k * (k + 1)).collect();
        let sums = sum_over_blocks(block.len(), place[n], block.len() * n * n * 2, |range, sums| {
            let (from, len) = (block.start, range.len());
            rotate(phi, y, columns, r, range.start + from..range.end + from, |k, q, e, _| {
                let out = &mut sums[place[k]..place[k + 1]];
                out[0] = dot(e, e);
                for i in 0..=k {
                    let qi = &q[i * len..(i + 1) * len];
                    out[1 + i] = dot(qi, e);
                    out[2 + k + i] = dot(qi, &q[k * len..(k + 1) * len]);
                }
            });
        });
        for k in 0..n {
            let v = &sums[place[k] + 1..place[k] + 2 + k];
            let p = |a: usize, b: usize| sums[place[a.max(b)] + 2 + a.max(b) + a.min(b)];
            let mut left = Matrix::zeros(k + 1, k + 1);
            for a in 0..=k {
                for b in 0..=k {
                    left.set(a, b, f64::from(u8::from(a == b)) - p(a, b));
                }
            }
            // A block without which the columns cannot be told apart has no prediction.
            total[k] += match lstsq(&left, v) {
                Ok(z) if z.dependent.is_empty() => {
                    let z = z.theta;
                    let vz: f64 = v.iter().zip(&z).map(|(a, b)| a * b).sum();
                    let zpz: f64 = (0..=k).map(|a| (0..=k).map(|b| z[a] * p(a, b) * z[b]).sum::<f64>()).sum();
                    sums[place[k]] + 2.0 * vz + zpz
                }
                _ => f64::INFINITY,
            };
        }
    }
    total
}

/// The factor R of `[columns y]`, column-major.
pub(crate) fn factor<C: Columns + ?Sized>(phi: &C, y: &[f64], columns: &[usize]) -> Vec<f64> {
    let (w, rows) = (columns.len() + 1, phi.rows());
    let block = rows.div_ceil(BLOCKS).max(8 * TILE);
    let blocks: Vec<Range<usize>> = (0..rows.div_ceil(block)).map(|b| b * block..((b + 1) * block).min(rows)).collect();
    let one = |range: &Range<usize>| {
        let (mut at, end) = (range.start, range.end);
        let mut qr = TallQr::new(w);
        let mut tile = vec![0.0; TILE.min(end - at) * w];
        while at < end {
            let len = TILE.min(end - at);
            for (c, &j) in columns.iter().enumerate() {
                phi.fill(j, at..at + len, &mut tile[c * len..(c + 1) * len]);
            }
            tile[(w - 1) * len..w * len].copy_from_slice(&y[at..at + len]);
            qr.push(len, &mut tile[..w * len]);
            at += len;
        }
        qr
    };
    let parts = map_blocks(&blocks, 2 * rows * w * w, SERIAL_BELOW, one);
    let mut parts = parts.into_iter();
    let mut whole = parts.next().unwrap_or_else(|| TallQr::new(w));
    for part in parts {
        whole.merge(&part);
    }
    whole.into_factor()
}

/// The factor R of `[columns y]` from their inner products, column-major. A column that is a combination of those before it, as far as
/// inner products can tell, gets the pivot 0.
fn cholesky(gram: &Gram, columns: &[usize]) -> Vec<f64> {
    let (n, w) = (columns.len(), columns.len() + 1);
    let entry = |i: usize, j: usize| match (i == n, j == n) {
        (false, false) => gram.matrix.get(columns[i], columns[j]),
        (false, true) => gram.cross[columns[i]],
        _ => gram.target,
    };
    let mut r = vec![0.0; w * w];
    for j in 0..w {
        for i in 0..j {
            let known: f64 = (0..i).map(|k| r[i * w + k] * r[j * w + k]).sum();
            let pivot = r[i * w + i];
            r[j * w + i] = if pivot > 0.0 { (entry(i, j) - known) / pivot } else { 0.0 };
        }
        let known: f64 = (0..j).map(|k| r[j * w + k] * r[j * w + k]).sum();
        r[j * w + j] = (entry(j, j) - known).max(0.0).sqrt();
    }
    r
}
