//! Errors on the rising and on the falling branch of the input, which a model without memory gets wrong in opposite ways.

use hysid_signal::{Segment, Turn, turning_points};

use crate::measure::{Errors, measure_at};

/// Which way the input goes between two turning points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// Towards larger values.
    Rising,
    /// Towards smaller values.
    Falling,
}

/// The branches of `u`: the stretches between turning points (a turn of less than `threshold`, in the unit of `u`, is none) and their directions.
///
/// They cover every sample; a turning point ends the branch that led to it. A signal without a turn is one branch.
pub fn branches(u: &[f64], threshold: f64) -> Vec<(Segment, Direction)> {
    let mut all = Vec::new();
    let mut start = 0;
    let mut next = None;
    for point in turning_points(u, threshold) {
        let (before, after) = match point.turn {
            Turn::Maximum => (Direction::Rising, Direction::Falling),
            Turn::Minimum => (Direction::Falling, Direction::Rising),
        };
        all.push((start..point.index + 1, before));
        start = point.index + 1;
        next = Some(after);
    }
    let mut present = u.iter().copied().filter(|v| v.is_finite());
    let first = present.next().unwrap_or(0.0);
    let overall = if present.next_back().unwrap_or(first) < first { Direction::Falling } else { Direction::Rising };
    if start < u.len() {
        all.push((start..u.len(), next.unwrap_or(overall)));
    }
    all
}

/// Errors by direction of the input.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BranchErrors {
    /// While the input rises.
    pub rising: Errors,
    /// While the input falls.
    pub falling: Errors,
}

/// Compares on each branch of the input `u`; a turn of less than `threshold` (in the unit of `u`) makes no new branch.
pub fn by_branch(u: &[f64], y: &[f64], prediction: &[f64], threshold: f64) -> BranchErrors {
    let all = branches(u, threshold);
    let on = |wanted: Direction| {
        let which = all.iter().filter(move |(_, d)| *d == wanted).flat_map(|(range, _)| range.clone());
        measure_at(y, prediction, which)
    };
    BranchErrors { rising: on(Direction::Rising), falling: on(Direction::Falling) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn branches_cover_all_and_alternate() {
        let x: Vec<f64> = (0..777).map(|n| (0.05 * n as f64).sin() + 0.02 * (7.0 * n as f64).sin()).collect();
        let all = branches(&x, 0.2);
        assert_eq!(all.first().unwrap().0.start, 0);
        assert_eq!(all.last().unwrap().0.end, x.len());
        for pair in all.windows(2) {
            assert_eq!(pair[0].0.end, pair[1].0.start);
            assert_ne!(pair[0].1, pair[1].1);
        }
        assert_eq!(branches(&[2.0, 1.0], 0.0), vec![(0..2, Direction::Falling)]);
        assert!(branches(&[], 0.0).is_empty());
    }

    #[test]
    fn a_line_through_a_loop_errs_in_opposite_ways() {
        let phase = |n: usize| std::f64::consts::TAU * n as f64 / 200.0;
        let u: Vec<f64> = (0..1000).map(|n| phase(n).sin()).collect();
        let y: Vec<f64> = (0..1000).map(|n| (phase(n) - 0.3).sin()).collect();
        let line: Vec<f64> = u.iter().map(|u| u * 0.3_f64.cos()).collect();
        let e = by_branch(&u, &y, &line, 0.1);
        // y - line = -sin(0.3) cos(phase): its mean over a rising half period is -2 sin(0.3) / pi.
        let expected = 2.0 * 0.3_f64.sin() / std::f64::consts::PI;
        assert!((e.rising.bias + expected).abs() < 1e-2 && (e.falling.bias - expected).abs() < 1e-2);
        assert_eq!(e.rising.samples + e.falling.samples, 1000);
    }
}
