//! Near-ties decided from the samples: the short list orthogonalised by Householder QR, whose errors grow with the
//! condition and not with its square.

use crate::evidence::Evidence;
use crate::forward::{Factor, NOISE};

/// Which candidate to take.
pub(crate) struct Choice {
    pub column: usize,
    /// Whether rounding could still have changed the choice.
    pub doubtful: bool,
}

/// How far the score of a candidate may be off on account of rounding in the inner products, relative to itself.
fn uncertainty(factor: &Factor, j: usize) -> f64 {
    2.0 * NOISE / factor.cross[j].abs() + NOISE / factor.energy[j]
}

/// The best of `ranked` (best first): by the inner products when they decide, from the samples when they do not.
pub(crate) fn choose_next<E: Evidence + ?Sized>(evidence: &E, factor: &Factor, ranked: &[usize], guard: f64) -> Choice {
    let score = |j: usize| factor.score(j, guard).unwrap_or(0.0);
    let first = ranked[0];
    let lower = score(first) * (1.0 - uncertainty(factor, first));
    let rivals: Vec<usize> =
        ranked.iter().copied().filter(|&j| j == first || score(j) * (1.0 + uncertainty(factor, j)) >= lower).collect();
    if rivals.len() == 1 {
        return Choice { column: first, doubtful: false };
    }
    // In the factor of [chosen, rivals, y] the block beside the chosen columns holds what is left of the rest.
    let k = factor.chosen.len();
    let mut columns = factor.chosen.clone();
    columns.extend(&rivals);
    let w = columns.len() + 1;
    let Some(r) = evidence.factor(&columns) else { return Choice { column: first, doubtful: true } };
    let left = |c: usize| &r[c * w + k..(c + 1) * w];
    let target = left(w - 1);
    let whole: f64 = r[(w - 1) * w..].iter().map(|v| v * v).sum();
    let scores: Vec<f64> = (0..rivals.len())
        .map(|i| {
            let c = left(k + i);
            let energy: f64 = c.iter().map(|v| v * v).sum();
            let all: f64 = r[(k + i) * w..(k + i + 1) * w].iter().map(|v| v * v).sum();
            let cross: f64 = c.iter().zip(target).map(|(a, b)| a * b).sum();
            // QR resolves a column's remainder to rounding of the column itself, not of its square.
            if energy <= all * 1e-26 { 0.0 } else { cross * cross / energy / whole }
        })
        .collect();
    let mut order: Vec<usize> = (0..rivals.len()).collect();
    order.sort_by(|a, b| scores[*b].total_cmp(&scores[*a]).then(rivals[*a].cmp(&rivals[*b])));
    let (best, second) = (scores[order[0]], scores[order[1]]);
    // Two candidates that explain the same to this precision are a tie for any arithmetic in doubles, and a full short
    // list may have left out a third.
    let doubtful = best - second <= 1e-7 * best || rivals.len() == ranked.len() && ranked.len() == 8;
    Choice { column: rivals[order[0]], doubtful }
}
