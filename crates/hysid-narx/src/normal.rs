//! Damped normal equations with equilibrated columns, for steps of Gauss-Newton kind.

use nalgebra::{DMatrix, DVector};

/// Sums of products of rows with a residual: J'J and J'e.
#[derive(Debug, Clone)]
pub(crate) struct Normal {
    gram: DMatrix<f64>,
    right: DVector<f64>,
}

impl Normal {
    pub(crate) fn new(width: usize) -> Self {
        Self { gram: DMatrix::zeros(width, width), right: DVector::zeros(width) }
    }

    /// Adds a row with its residual.
    pub(crate) fn add(&mut self, row: &[f64], e: f64) {
        let width = row.len();
        let gram = self.gram.as_mut_slice();
        for (j, &r) in row.iter().enumerate() {
            for (g, &s) in gram[j * width..j * width + j + 1].iter_mut().zip(row) {
                *g += r * s;
            }
        }
        for (b, &r) in self.right.iter_mut().zip(row) {
            *b += r * e;
        }
    }

    /// Fills the lower half from the upper.
    pub(crate) fn finish(&mut self) {
        for j in 0..self.gram.ncols() {
            for i in 0..j {
                self.gram[(j, i)] = self.gram[(i, j)];
            }
        }
    }

    pub(crate) fn is_finite(&self) -> bool {
        self.gram.iter().chain(self.right.iter()).all(|v| v.is_finite())
    }

    fn scales(&self) -> DVector<f64> {
        self.gram.diagonal().map(|d| if d > 0.0 { d.sqrt() } else { 1.0 })
    }

    /// The step (D + lambda)^-1 b in equilibrated columns; `None` where the matrix is not positive definite.
    pub(crate) fn step(&self, lambda: f64) -> Option<Vec<f64>> {
        let s = self.scales();
        let mut a = self.gram.clone();
        for j in 0..a.ncols() {
            for i in 0..a.nrows() {
                a[(i, j)] /= s[i] * s[j];
            }
            a[(j, j)] += lambda;
        }
        let b = self.right.component_div(&s);
        let x = a.cholesky()?.solve(&b);
        Some(x.component_div(&s).iter().copied().collect())
    }

    /// Diagonal of (J'J)^-1; `None` where it is singular.
    pub(crate) fn inverse_diagonal(&self) -> Option<Vec<f64>> {
        let s = self.scales();
        let mut a = self.gram.clone();
        for j in 0..a.ncols() {
            for i in 0..a.nrows() {
                a[(i, j)] /= s[i] * s[j];
            }
            a[(j, j)] += 1e-13;
        }
        let inverse = a.cholesky()?.inverse();
        Some(inverse.diagonal().iter().zip(s.iter()).map(|(v, s)| v / (s * s)).collect())
    }

    /// Diagonal of (J'J)^-1 M (J'J)^-1, where M is the sum of g g' over the blocks' gradients `g`.
    ///
    /// With blocks longer than the residual's memory these are variances that hold for a residual that is not white.
    pub(crate) fn sandwich(&self, gradients: &[Vec<f64>]) -> Option<Vec<f64>> {
        let s = self.scales();
        let width = s.len();
        let mut a = self.gram.clone();
        for j in 0..width {
            for i in 0..width {
                a[(i, j)] /= s[i] * s[j];
            }
            a[(j, j)] += 1e-12;
        }
        let factor = a.cholesky()?;
        let mut variance = vec![0.0; width];
        for g in gradients {
            let scaled = DVector::from_iterator(width, g.iter().zip(s.iter()).map(|(g, s)| g / s));
            let x = factor.solve(&scaled);
            for ((v, x), s) in variance.iter_mut().zip(x.iter()).zip(s.iter()) {
                *v += (x / s) * (x / s);
            }
        }
        Some(variance)
    }
}
