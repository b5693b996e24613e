//! Columns beside a simulation's own tangents: their coefficients by least squares.

use hysid_linalg::dot;

use crate::evidence::{Whitener, norm2};
use crate::model::base::Base;

/// Least squares of the residual on these columns beside the simulation's own tangents, with these weights of the whitened rows: the columns'
/// coefficients, and what is left. Columns' coefficients have this precision beforehand, in units of the whitened rows.
pub fn regress(
    base: &Base<'_>,
    columns: &[&[f64]],
    noise: &Whitener,
    weights: Option<&[f64]>,
    precision: f64,
) -> (Vec<f64>, Vec<f64>) {
    let layout = &base.model.data().layout;
    let own = base.fit.jacobian.len();
    let all: Vec<&[f64]> = base.fit.jacobian.iter().map(Vec::as_slice).chain(columns.iter().copied()).collect();
    let weigh = |mut x: Vec<f64>| {
        if let Some(w) = weights {
            x.iter_mut().zip(w).for_each(|(x, w)| *x *= w);
        }
        x
    };
    let white: Vec<Vec<f64>> = all.iter().map(|c| weigh(noise.apply(layout, c))).collect();
    // A parameter without any influence here has a tangent of zeros.
    let size = |c: &Vec<f64>| Some(norm2(c).sqrt()).filter(|n| *n > 0.0).unwrap_or(1.0);
    let norms: Vec<f64> = white.iter().map(size).collect();
    let r = weigh(noise.apply(layout, &base.fit.residual));
    let k = all.len();
    // A little ridge, for tangents that are combinations of others.
    let known = |a: usize| if a < own { 0.0 } else { precision / (norms[a] * norms[a]) };
    let gram = nalgebra::DMatrix::from_fn(k, k, |a, b| {
        dot(&white[a], &white[b]) / (norms[a] * norms[b]) + if a == b { 1e-9 + known(a) } else { 0.0 }
    });
    let rhs = nalgebra::DVector::from_fn(k, |a, _| dot(&white[a], &r) / norms[a]);
    let solution: Vec<f64> = match gram.cholesky() {
        Some(c) => c.solve(&rhs).iter().zip(&norms).map(|(x, n)| x / n).collect(),
        None => vec![0.0; k],
    };
    let mut after = base.fit.residual.clone();
    for (c, x) in all.iter().zip(&solution) {
        after.iter_mut().zip(*c).for_each(|(a, c)| *a -= x * c);
    }
    (solution[own..].to_vec(), after)
}
