//! What a selection may ask of its data: inner products, and what the samples themselves say where they are at hand.

use hysid_linalg::{Columns, Gram, Matrix, Start};

use crate::refit::{Goal, Refit, factor, from_gram, from_samples};

/// The data of a selection.
pub(crate) trait Evidence {
    /// Number of samples.
    fn samples(&self) -> usize;
    /// Number of columns to choose from.
    fn candidates(&self) -> usize;
    /// Norms of the columns, their products with the target, its energy.
    fn start(&self) -> Start;
    /// These columns of the Gram matrix.
    fn gram_columns(&self, which: &[usize]) -> Matrix;
    /// The factor R of `[columns y]` from the samples, column-major; `None` where there are no samples to go back to.
    fn factor(&self, columns: &[usize]) -> Option<Vec<f64>>;
    /// Errors, coefficients and criteria of a path of columns.
    fn refit(&self, columns: &[usize], energy: f64, goal: Goal) -> Refit;
}

/// A matrix and a target, sample by sample.
pub(crate) struct Samples<'a, C: ?Sized> {
    phi: &'a C,
    y: &'a [f64],
    /// All inner products, where the search will want so many of them that one pass for all is cheaper.
    gram: Option<Gram>,
}

impl<'a, C: Columns + ?Sized> Samples<'a, C> {
    /// For a search that will ask for about so many columns of the Gram matrix.
    pub fn new(phi: &'a C, y: &'a [f64], columns: usize) -> Self {
        Self { phi, y, gram: phi.gram(y, columns) }
    }
}

impl<C: Columns + ?Sized> Evidence for Samples<'_, C> {
    fn samples(&self) -> usize {
        self.phi.rows()
    }

    fn candidates(&self) -> usize {
        self.phi.cols()
    }

    fn start(&self) -> Start {
        self.gram.as_ref().map_or_else(|| self.phi.start(self.y), Evidence::start)
    }

    fn gram_columns(&self, which: &[usize]) -> Matrix {
        self.gram.as_ref().map_or_else(|| self.phi.gram_columns(which), |gram| gram.gram_columns(which))
    }

    fn factor(&self, columns: &[usize]) -> Option<Vec<f64>> {
        Some(factor(self.phi, self.y, columns))
    }

    fn refit(&self, columns: &[usize], energy: f64, goal: Goal) -> Refit {
        from_samples(self.phi, self.y, columns, energy, goal)
    }
}

impl Evidence for Gram {
    fn samples(&self) -> usize {
        self.rows
    }

    fn candidates(&self) -> usize {
        self.matrix.cols()
    }

    fn start(&self) -> Start {
        let norms = (0..self.matrix.cols()).map(|j| self.matrix.get(j, j)).collect();
        Start { norms, cross: self.cross.clone(), target: self.target }
    }

    fn gram_columns(&self, which: &[usize]) -> Matrix {
        let mut columns = Matrix::zeros(self.matrix.rows(), which.len());
        for (c, &j) in which.iter().enumerate() {
            columns.col_mut(c).copy_from_slice(self.matrix.col(j));
        }
        columns
    }

    fn factor(&self, _columns: &[usize]) -> Option<Vec<f64>> {
        None
    }

    fn refit(&self, columns: &[usize], energy: f64, _goal: Goal) -> Refit {
        from_gram(self, columns, energy)
    }
}
