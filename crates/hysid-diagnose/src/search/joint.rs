//! Superposed effects: pairs of candidates that explain the residual together.
//!
//! One effect can hide another: alone neither explains enough to lead the list, and a greedy search builds on the wrong first pick. In the
//! evidence space a pair costs two projections, so all pairs of the forty best candidates are compared before any simulation is run: forward
//! regression in groups with a full second level instead of the greedy one.

use rayon::prelude::*;

use super::screen::Candidate;
use crate::evidence::{FeatureGroup, dot, norm2, score};
use crate::model::hypothesis::are_one_sum;

/// Candidates of which all pairs are compared.
const MOST: usize = 40;
/// Score by which a pair must exceed the better of its members.
const LEAST_GAIN: f64 = 6.0;

/// A pair of candidates: places in the list, points of their grids, amplitudes by name.
#[derive(Debug, Clone)]
pub struct Pair {
    /// Places in the list of candidates.
    pub members: [usize; 2],
    /// Points of their shape grids.
    pub points: [usize; 2],
    /// The amplitudes that explain the residual together.
    pub amplitudes: [Vec<(String, f64)>; 2],
}

/// One point of one candidate.
struct Item<'a> {
    member: usize,
    point: usize,
    group: &'a FeatureGroup,
    names: Vec<String>,
    score: f64,
}

/// The pairs that explain the whitened residual `r` best, best first, each pair of effects once, at most `most`.
pub fn pairs(candidates: &[Candidate], r: &[f64], most: usize) -> Vec<Pair> {
    let total = norm2(r);
    let mut seen: Vec<(&str, &str)> = Vec::new();
    let mut items: Vec<Item<'_>> = Vec::new();
    let mut members = 0;
    for (member, c) in candidates.iter().enumerate() {
        // The best forty, and one of each family at each slot.
        let place = (c.mechanism.family.name(), c.slot.label.as_str());
        if members >= MOST && (seen.contains(&place) || members >= 2 * MOST) {
            continue;
        }
        seen.push(place);
        members += 1;
        for (point, p) in c.points.iter().enumerate() {
            if let Some(group) = &p.joint {
                let names = p.amplitudes.iter().map(|a| a.0.clone()).collect();
                items.push(Item { member, point, group, names, score: p.score });
            }
        }
    }
    let mut found: Vec<(usize, usize, f64)> = (0..items.len())
        .into_par_iter()
        .flat_map_iter(|a| {
            let first = items[a].group;
            let own = first.explained(r);
            let left = outside(first, r);
            let items = &items;
            (a + 1..items.len()).filter(move |&b| items[b].member != items[a].member).filter_map(move |b| {
                let explained = own + beyond(first, items[b].group, &left);
                let count = first.columns.len() + items[b].group.columns.len();
                let joint = score(total, explained, r.len(), count);
                (joint > items[a].score.max(items[b].score) + LEAST_GAIN).then_some((a, b, joint))
            })
        })
        .collect();
    found.sort_by(|x, y| y.2.total_cmp(&x.2).then(x.0.cmp(&y.0)).then(x.1.cmp(&y.1)));
    let mut out: Vec<Pair> = Vec::new();
    for (a, b, _) in found {
        let members = [items[a].member, items[b].member];
        if out.iter().any(|p| p.members == members) {
            continue;
        }
        // Siblings of a pair that is there already are left to the swaps.
        let kind = |m: usize| (candidates[m].mechanism.family, candidates[m].slot.label.as_str());
        let [first, second] = members.map(|m| (candidates[m].mechanism, &candidates[m].slot));
        if are_one_sum(first, second) {
            continue;
        }
        let alike = out.iter().filter(|p| p.members.map(kind) == members.map(kind)).count();
        if alike >= 2 {
            continue;
        }
        out.push(Pair {
            members,
            points: [items[a].point, items[b].point],
            amplitudes: amplitudes(&items[a], &items[b], r),
        });
        if out.len() >= most {
            break;
        }
    }
    out
}

/// What is left of `r` outside a group's columns.
fn outside(group: &FeatureGroup, r: &[f64]) -> Vec<f64> {
    let mut left = r.to_vec();
    for g in &group.columns {
        let c = dot(g, &left);
        left.iter_mut().zip(g).for_each(|(l, g)| *l -= c * g);
    }
    left
}

/// Sum of squares of `left` (already outside `first`) along what `second` spans outside `first`.
fn beyond(first: &FeatureGroup, second: &FeatureGroup, left: &[f64]) -> f64 {
    let mut basis: Vec<Vec<f64>> = Vec::new();
    let mut sum = 0.0;
    for column in &second.columns {
        let mut c = column.clone();
        for q in first.columns.iter().chain(&basis) {
            let along = dot(q, &c);
            c.iter_mut().zip(q).for_each(|(c, q)| *c -= along * q);
        }
        let norm = norm2(&c);
        // Nearly the same effect: what is left is rounding and curvature.
        if norm < 1e-3 {
            continue;
        }
        sum += dot(&c, left).powi(2) / norm;
        c.iter_mut().for_each(|x| *x /= norm.sqrt());
        basis.push(c);
    }
    sum
}

/// Amplitudes of both by alternating projections.
fn amplitudes(a: &Item<'_>, b: &Item<'_>, r: &[f64]) -> [Vec<(String, f64)>; 2] {
    let fitted = |g: &FeatureGroup, r: &[f64]| -> Vec<f64> {
        let mut f = vec![0.0; r.len()];
        for q in &g.columns {
            let c = dot(q, r);
            f.iter_mut().zip(q).for_each(|(f, q)| *f += c * q);
        }
        f
    };
    let less = |r: &[f64], f: &[f64]| -> Vec<f64> { r.iter().zip(f).map(|(r, f)| r - f).collect() };
    let mut of_b = vec![0.0; r.len()];
    let mut of_a = of_b.clone();
    for _ in 0..40 {
        of_a = fitted(a.group, &less(r, &of_b));
        of_b = fitted(b.group, &less(r, &of_a));
    }
    let named =
        |i: &Item<'_>, rest: &[f64]| i.names.iter().cloned().zip(i.group.amplitudes(rest, i.names.len())).collect();
    [named(a, &less(r, &of_b)), named(b, &less(r, &of_a))]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evidence::{Layout, NoiseModel, Projector, Series, Whitener};

    fn wave(period: f64, n: usize) -> Vec<f64> {
        (0..n).map(|i| (i as f64 / period).sin()).collect()
    }

    fn group(columns: &[Vec<f64>]) -> FeatureGroup {
        let n = columns[0].len();
        let layout = Layout { series: vec![Series { stretch: 0, output: 0, first: 0, rows: 0..n }], outputs: 1 };
        let whitener = Whitener::of(vec![NoiseModel::white(1.0)]);
        FeatureGroup::new(columns, &layout, &whitener, &Projector::default()).unwrap()
    }

    #[test]
    fn what_two_groups_explain_is_what_a_projector_on_both_explains() {
        let (a, b) = (vec![wave(3.0, 200), wave(5.0, 200)], vec![wave(3.1, 200), wave(17.0, 200)]);
        let r: Vec<f64> = (0..200).map(|i| ((i * i) as f64 * 0.013).cos()).collect();
        let (first, second) = (group(&a), group(&b));
        let both = Projector::new(a.into_iter().chain(b));
        let found = first.explained(&r) + beyond(&first, &second, &outside(&first, &r));
        assert!((found - both.inside(&r)).abs() < 1e-9 * both.inside(&r), "{found} {}", both.inside(&r));
    }

    #[test]
    fn two_effects_that_nearly_cancel_get_their_amplitudes() {
        let (a, b) = (wave(3.0, 300), wave(3.05, 300));
        let r: Vec<f64> = a.iter().zip(&b).map(|(a, b)| 2.0 * a - 1.8 * b).collect();
        let groups = [group(&[a]), group(&[b])];
        let item = |i: usize| Item { member: i, point: 0, group: &groups[i], names: vec!["w".into()], score: 0.0 };
        let [x, y] = amplitudes(&item(0), &item(1), &r);
        assert!((x[0].1 - 2.0).abs() < 0.05 && (y[0].1 + 1.8).abs() < 0.05, "{x:?} {y:?}");
    }
}
