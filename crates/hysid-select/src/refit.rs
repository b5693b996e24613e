//! The chosen columns factored again from the samples: coefficients, error reduction ratios, exact PRESS for every length
//! of the path, in two passes over the samples and the memory of a tile.
//!
//! With A = Q R the leave-one-out error of sample t is e_t / (1 - h_tt), h_tt the squared norm of row t of Q, and for the
//! first k columns both come from the first k entries of that row.

use hysid_linalg::{Columns, Lstsq, TallQr, solve_factor, sum_over_blocks};

/// What the samples say of a path of columns; entry k - 1 is for the first k columns.
#[derive(Debug, Clone)]
pub(crate) struct Refit {
    pub err: Vec<f64>,
    pub sse: Vec<f64>,
    pub press: Vec<f64>,
    pub condition: Vec<f64>,
    pub fit: Lstsq,
}

/// Rows that are factored at a time.
const TILE: usize = 1024;

/// A leverage this close to 1 leaves nothing to leave out.
const FULL_LEVERAGE: f64 = 1e-10;

pub(crate) fn refit<C: Columns + ?Sized>(phi: &C, y: &[f64], columns: &[usize], energy: f64) -> Refit {
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
        let len = range.len();
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
            let mut sum = 0.0;
            for ((a, e), f) in qk.iter_mut().zip(&mut residual).zip(&mut free) {
                *a *= inverse;
                *e -= *a * g;
                *f -= *a * *a;
                let loo = *e / f.max(FULL_LEVERAGE);
                sum += loo * loo;
            }
            sums[k] = sum;
        }
    });
    let press = press.iter().map(|p| p / energy).collect();
    Refit { err, sse, press, condition, fit: solve_factor(&r, n) }
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
