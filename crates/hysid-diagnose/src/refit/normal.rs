//! Weighted rows, and the normal equations that a step is taken from.

use hysid_linalg::dot;
use nalgebra::{DMatrix, DVector};

use crate::evidence::{Layout, Whitener, norm2};

/// How rows count: whitened, then multiplied by these weights (0 leaves a row out).
#[derive(Clone, Copy)]
pub struct Weighting<'a> {
    pub layout: &'a Layout,
    pub whitener: &'a Whitener,
    pub weights: Option<&'a [f64]>,
}

impl Weighting<'_> {
    /// A stack, whitened and weighted.
    pub fn apply(&self, stack: &[f64]) -> Vec<f64> {
        let mut w = self.whitener.apply(self.layout, stack);
        if let Some(weights) = self.weights {
            w.iter_mut().zip(weights).for_each(|(r, w)| *r *= w);
        }
        w
    }

    /// Sum of squares; infinite where a residual is no number.
    pub fn cost(&self, residual: &[f64]) -> f64 {
        let c = norm2(&self.apply(residual));
        if c.is_finite() { c } else { f64::INFINITY }
    }
}

/// The normal equations of the free parameters, their columns scaled.
pub struct System {
    gram: DMatrix<f64>,
    rhs: DVector<f64>,
}

impl System {
    /// Of the columns and the gradient at a point.
    pub fn new(columns: &[Vec<f64>], gradient: &[f64], free: &[usize], scale: &[f64]) -> Self {
        let m = free.len();
        let mut gram = DMatrix::zeros(m, m);
        for (a, &i) in free.iter().enumerate() {
            for (b, &j) in free.iter().enumerate().take(a + 1) {
                let g = dot(&columns[i], &columns[j]) / (scale[i] * scale[j]);
                gram[(a, b)] = g;
                gram[(b, a)] = g;
            }
        }
        Self { gram, rhs: DVector::from_iterator(m, free.iter().map(|&i| gradient[i] / scale[i])) }
    }

    /// The step under a damping; `None` where the damped equations are no equations.
    pub fn step(&self, mu: f64) -> Option<Vec<f64>> {
        let mut damped = self.gram.clone();
        for a in 0..self.rhs.len() {
            damped[(a, a)] += mu * self.gram[(a, a)].max(1e-8) + 1e-13;
        }
        Some(damped.cholesky()?.solve(&self.rhs).as_slice().to_vec())
    }

    /// What a change would gain if the predictions were linear.
    pub fn predicted(&self, change: &[f64]) -> f64 {
        let d = DVector::from_column_slice(change);
        2.0 * d.dot(&self.rhs) - (self.gram.clone() * &d).dot(&d)
    }
}
