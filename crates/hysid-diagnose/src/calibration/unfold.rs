//! The sign that a rectifying sensor lost, restored: where to start a fit behind it.
//!
//! A simulation that is fitted to the size of its output has a minimum wherever some peaks fall on others. The sign can be had without any
//! model: of all signs of the samples those are taken that leave the sum of squared second differences smallest, since a motion is smoother
//! than its size. The overall sign stays open; both are tried.

use hysid_plant::{Expr, Function, Simulation};

use super::global::calibrated_copy;
use crate::data::DataSet;

/// The sign of a sample beside that of its neighbour: the same, or the other.
const SIGNS: [f64; 2] = [1.0, -1.0];

/// Signs for the samples of `sizes`, the first of which is positive, that make the series smoothest: exact, by dynamic programming over whether
/// neighbours differ in sign.
fn unfold(sizes: &[f64]) -> Vec<f64> {
    // Cost of the best signs up to here whose last two agree, and of those whose last two differ; and where they came from.
    let mut cost = [0.0, 0.0];
    let mut came: Vec<[usize; 2]> = Vec::with_capacity(sizes.len());
    for w in sizes.windows(3) {
        let [a, b, c] = [w[0], w[1], w[2]];
        let step = |before: usize, now: usize| (SIGNS[now] * c - 2.0 * b + SIGNS[before] * a).powi(2);
        let from = [0, 1].map(|now| usize::from(cost[1] + step(1, now) < cost[0] + step(0, now)));
        cost = [0, 1].map(|now| cost[from[now]] + step(from[now], now));
        came.push(from);
    }
    let mut flips = Vec::with_capacity(sizes.len());
    let mut last = usize::from(cost[1] < cost[0]);
    flips.push(last);
    for from in came.iter().rev() {
        last = from[last];
        flips.push(last);
    }
    let mut sign = 1.0;
    let mut out: Vec<f64> = sizes.iter().take(1).copied().collect();
    for (flip, size) in flips.iter().rev().zip(sizes.iter().skip(1)) {
        sign *= SIGNS[*flip];
        out.push(sign * size);
    }
    out
}

/// The original simulation calibrated on the longest stretch with the signs restored of the output of which `rectified` shows the size only;
/// `None` where there is no such output, or it has gaps.
pub fn calibrated_unfolded(original: &Simulation, rectified: &Simulation, data: &DataSet) -> Option<Simulation> {
    let folded = |s: &Simulation, i: usize| matches!(s.outputs[i].expression, Expr::Call(Function::Abs, _));
    let output = (0..rectified.outputs.len()).find(|&i| folded(rectified, i) && !folded(original, i))?;
    let stretch = &data.stretches[data.longest()?];
    let sizes = stretch.outputs.get(output)?;
    if sizes.len() < 3 || sizes.iter().any(|v| !v.is_finite()) {
        return None;
    }
    let restored = unfold(sizes);
    let best = SIGNS
        .into_iter()
        .filter_map(|sign| {
            let mut outputs = stretch.outputs.clone();
            outputs[output] = restored.iter().map(|v| sign * v).collect();
            calibrated_copy(original, &DataSet::of_drive(stretch.drive.clone(), outputs, data.period_s), 1)
        })
        .min_by(|a, b| a.1.total_cmp(&b.1))?;
    Some(best.0)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn the_signs_of_a_smooth_motion_come_back() {
        let motion: Vec<f64> =
            (0..600).map(|i| i as f64 * 0.05).map(|t| 1.5 + (2.0 * (1.7 * t).sin() - (0.6 * t).cos())).collect();
        let sizes: Vec<f64> = motion.iter().map(|v| v.abs()).collect();
        let found = unfold(&sizes);
        let sign = motion[0].signum();
        assert!(found.iter().zip(&motion).all(|(f, m)| (f - sign * m).abs() < 1e-12));
    }

    proptest! {
        /// No choice of signs is smoother: every one of a short series is tried.
        #[test]
        fn no_signs_are_smoother(sizes in prop::collection::vec(0.0_f64..3.0, 1..11)) {
            let roughness = |x: &[f64]| x.windows(3).map(|w| (w[2] - 2.0 * w[1] + w[0]).powi(2)).sum::<f64>();
            let least = (0..1_usize << (sizes.len() - 1))
                .map(|bits| {
                    let signed = |i: usize, v: f64| if i > 0 && bits >> (i - 1) & 1 == 1 { -v } else { v };
                    roughness(&sizes.iter().enumerate().map(|(i, v)| signed(i, *v)).collect::<Vec<_>>())
                })
                .fold(f64::INFINITY, f64::min);
            prop_assert!((roughness(&unfold(&sizes)) - least).abs() < 1e-9);
        }
    }
}
