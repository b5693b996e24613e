//! Equations (8) to (10) of Zhang, Zhu, Gu (2017) as printed: plain matching pursuit on raw columns.
//!
//! The residual r loses the best raw column's own projection, r - (r'phi_j / phi_j'phi_j) phi_j; columns are neither
//! orthogonalised nor are coefficients refitted inside the loop. A column is taken once.

use crate::evidence::Evidence;
use crate::forward::NOISE;
use crate::moments::Moments;

/// The path of the pursuit.
pub(crate) struct Pursuit {
    pub columns: Vec<usize>,
    /// What is left of y'y after each column.
    pub sse: Vec<f64>,
}

pub(crate) fn pursue<E: Evidence + ?Sized>(moments: &mut Moments<'_, E>, forced: &[usize], longest: usize) -> Pursuit {
    let mut cross = moments.cross.clone();
    let mut path = Pursuit { columns: Vec::new(), sse: Vec::new() };
    let mut left = 1.0;
    while path.columns.len() < longest {
        let mut ranked: Vec<usize> =
            (0..cross.len()).filter(|j| cross[*j].abs() > NOISE && !path.columns.contains(j)).collect();
        ranked.sort_by(|a, b| cross[*b].abs().total_cmp(&cross[*a].abs()).then(a.cmp(b)));
        let Some(&next) = forced.get(path.columns.len()).or(ranked.first()) else { break };
        moments.make(next, ranked);
        let gain = cross[next];
        for (c, g) in cross.iter_mut().zip(moments.column(next)) {
            *c -= gain * g;
        }
        left -= gain * gain;
        path.columns.push(next);
        path.sse.push(left);
    }
    path
}
