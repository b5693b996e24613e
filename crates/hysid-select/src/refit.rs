//! The chosen columns factored again from the samples: coefficients, error reduction ratios, exact PRESS for every length
//! of the path, in two passes over the samples and the memory of a tile.
//!
//! With A = Q R the leave-one-out error of sample t is e_t / (1 - h_tt), h_tt the squared norm of row t of Q, and for the
//! first k columns both come from the first k entries of that row.

use std::ops::Range;

use hysid_linalg::{Columns, Lstsq, Matrix, TallQr, dot, lstsq, solve_factor, sum_over_blocks};

use crate::Criterion;
use crate::criterion::{Facts, value};

/// What the samples say of a path of columns; entry k - 1 is for the first k columns.
#[derive(Debug, Clone)]
pub(crate) struct Refit {
    pub err: Vec<f64>,
    pub sse: Vec<f64>,
    pub press: Vec<f64>,
    /// Sum of squared errors on left-out blocks; NaN where not asked for.
    pub blocks: Vec<f64>,
    pub condition: Vec<f64>,
    pub solution: Lstsq,
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
    /// What is known of the first `k` columns.
    pub fn facts(&self, k: usize, samples: usize) -> Facts {
        let (sse, press, blocks) = (self.sse[k - 1], self.press[k - 1], self.blocks[k - 1]);
        Facts { terms: k, samples, sse, press, blocks }
    }

    /// The criterion for 1, 2, ... columns.
    pub fn values(&self, criterion: &Criterion, samples: usize) -> Vec<f64> {
        (1..=self.sse.len()).map(|k| value(criterion, self.facts(k, samples))).collect()
    }
}

/// Rows that are factored at a time.
const TILE: usize = 1024;

/// A leverage this close to 1 leaves nothing to leave out.
const FULL_LEVERAGE: f64 = 1e-10;

pub(crate) fn refit<C: Columns + ?Sized>(phi: &C, y: &[f64], columns: &[usize], energy: f64, goal: Goal) -> Refit {
    let (n, rows) = (columns.len(), phi.rows());
    let w = n + 1;
    let r = factor(phi, y, columns);
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
    let press = sum_over_blocks(rows, n, rows * n * n, |range, sums| {
        rotate(phi, y, columns, &r, range, |k, _, e, free| {
            sums[k] = e.iter().zip(free).map(|(e, f)| (e / f.max(FULL_LEVERAGE)).powi(2)).sum();
        });
    });
    let press = press.iter().map(|p| p / energy).collect();
    let blocks = match goal {
        Goal::Samples => vec![f64::NAN; n],
        Goal::Blocks(blocks) => left_out_blocks(phi, y, columns, &r, &blocks).iter().map(|b| b / energy).collect(),
    };
    Refit { err, sse, press, blocks, condition, solution: solve_factor(&r, n) }
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
        for i in 0..k {
            let rik = r[k * w + i];
            for (a, b) in qk.iter_mut().zip(&before[i * len..(i + 1) * len]) {
                *a -= rik * b;
            }
        }
        let pivot = r[k * w + k];
        let inverse = if pivot > 0.0 { 1.0 / pivot } else { 0.0 };
        let g = r[n * w + k];
        for ((a, e), f) in qk.iter_mut().zip(&mut residual).zip(&mut free) {
            *a *= inverse;
            *e -= *a * g;
            *f -= *a * *a;
        }
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
    let mut qr = TallQr::new(w);
    let mut tile = vec![0.0; TILE * w];
    let mut at = 0;
    while at < rows {
        let len = TILE.min(rows - at);
        for (c, &j) in columns.iter().enumerate() {
            phi.fill(j, at..at + len, &mut tile[c * len..(c + 1) * len]);
        }
        tile[(w - 1) * len..w * len].copy_from_slice(&y[at..at + len]);
        qr.push(len, &mut tile[..w * len]);
        at += len;
    }
    qr.into_factor()
}
