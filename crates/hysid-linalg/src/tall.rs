//! The triangular factor of a tall matrix given in tiles of rows (a sequential TSQR): memory is that of one tile.
//!
//! Householder reflections on a tile stacked below the factor so far. The factor's rows are unique up to sign; here its
//! diagonal is not negative.
//!
//! Reference: Demmel, Grigori, Hoemmen, Langou, "Communication-optimal parallel and sequential QR" (2012).

use crate::dot;
use crate::lanes::reflect;

/// The upper triangular factor R of a matrix that arrives in tiles of rows.
#[derive(Debug, Clone)]
pub struct TallQr {
    cols: usize,
    /// R, row by row, `cols` x `cols`.
    r: Vec<f64>,
}

impl TallQr {
    /// An empty factor for matrices with `cols` columns.
    pub fn new(cols: usize) -> Self {
        Self { cols, r: vec![0.0; cols * cols] }
    }

    /// Takes in `rows` further rows; `tile` holds them column by column and is overwritten.
    pub fn push(&mut self, rows: usize, tile: &mut [f64]) {
        let n = self.cols;
        for k in 0..n {
            let (head, tail) = tile.split_at_mut((k + 1) * rows);
            let x = &mut head[k * rows..];
            let below = dot(x, x);
            if below == 0.0 {
                continue;
            }
            let pivot = self.r[k * n + k];
            let norm = (pivot * pivot + below).sqrt();
            // The sign that keeps v0 from cancelling; the diagonal is made non-negative at the end.
            let beta = if pivot > 0.0 { -norm } else { norm };
            let v0 = pivot - beta;
            let scale = -1.0 / (beta * v0);
            reflect(v0, scale, x, &mut self.r[k * n + k + 1..(k + 1) * n], tail);
            self.r[k * n + k] = beta;
        }
    }

    /// Takes in another factor of the same width.
    pub fn merge(&mut self, other: &Self) {
        self.push(self.cols, &mut other.by_columns());
    }

    /// R, column-major, `cols` x `cols`, with a diagonal that is not negative.
    pub fn into_factor(mut self) -> Vec<f64> {
        for (k, row) in self.r.chunks_exact_mut(self.cols.max(1)).enumerate() {
            if row[k] < 0.0 {
                row[k..].iter_mut().for_each(|r| *r = -*r);
            }
        }
        self.by_columns()
    }

    fn by_columns(&self) -> Vec<f64> {
        let n = self.cols;
        (0..n * n).map(|i| self.r[i % n * n + i / n]).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn factor_times_itself_is_the_gram_matrix() {
        let (rows, cols) = (37, 5);
        let a: Vec<f64> = (0..rows * cols).map(|i| ((i * i * 7919 + 13) % 101) as f64 / 50.0 - 1.0).collect();
        for tile in [1, 4, 10, 37] {
            let mut qr = TallQr::new(cols);
            let mut at = 0;
            while at < rows {
                let n = tile.min(rows - at);
                let mut t: Vec<f64> = (0..cols).flat_map(|j| a[j * rows + at..j * rows + at + n].to_vec()).collect();
                qr.push(n, &mut t);
                at += n;
            }
            let r = qr.into_factor();
            for i in 0..cols {
                assert!(r[i * cols + i] >= 0.0);
                for j in 0..cols {
                    let g = dot(&a[i * rows..(i + 1) * rows], &a[j * rows..(j + 1) * rows]);
                    let h: f64 = (0..cols).map(|k| r[i * cols + k] * r[j * cols + k]).sum();
                    assert!((g - h).abs() < 1e-12 * rows as f64, "tile {tile} ({i},{j}): {g} {h}");
                }
            }
        }
    }
}
