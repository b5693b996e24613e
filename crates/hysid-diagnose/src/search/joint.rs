//! Superposed effects: pairs of candidates that explain the residual together.
//!
//! One effect can hide another: alone neither explains enough to lead the list, and a greedy search builds on the wrong first pick. In the
//! evidence space what a pair explains follows from products of columns that are taken once, so all pairs of the forty best candidates are
//! compared before any simulation is run: forward regression in groups with a full second level instead of the greedy one.

use std::ops::Range;

use hysid_linalg::{axpy, dot};
use nalgebra::DMatrix;
use rayon::prelude::*;

use super::assemble::{Part, assemble, complete};
use super::candidate::Candidate;
use crate::budget::Step;
use crate::evidence::{FeatureGroup, norm2, score};
use crate::model::hypothesis::{Hypothesis, Setting, are_one_law};

/// Pairs of the evidence space that are tried by simulation, and those of them that are fitted to the end.
const PAIRS: (usize, usize) = (10, 4);
/// Candidates of which all pairs are compared.
const MOST: usize = 40;
/// Score by which a pair must exceed the better of its members.
const LEAST_GAIN: f64 = 6.0;
/// Square of what a column of unit norm leaves outside others below which it is nearly the same as they are.
const NEARLY_THE_SAME: f64 = 1e-3;
/// Rows whose products are summed at a time.
const ROWS: usize = 256;

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
    /// Its columns among those of all items.
    columns: Range<usize>,
    names: Vec<String>,
    score: f64,
}

/// A hypothesis with pairs of what could be missing around it, each fitted together.
pub fn superposed<'d>(
    setting: &Setting<'d>,
    parent: &Hypothesis<'d>,
    candidates: &[Candidate],
    most: usize,
) -> Vec<Hypothesis<'d>> {
    if setting.budget.omits(Step::Fits) {
        return Vec::new();
    }
    fitted_pairs(setting, parent, candidates, &likeliest_pairs(parent, candidates), most)
}

/// The pairs that explain most around a hypothesis: what needs the columns of the candidates.
pub fn likeliest_pairs(parent: &Hypothesis<'_>, candidates: &[Candidate]) -> Vec<Pair> {
    pairs(candidates, &parent.base.evidence().1, PAIRS.0)
}

/// A hypothesis with each of these pairs, fitted together.
pub fn fitted_pairs<'d>(
    setting: &Setting<'d>,
    parent: &Hypothesis<'d>,
    candidates: &[Candidate],
    likeliest: &[Pair],
    most: usize,
) -> Vec<Hypothesis<'d>> {
    let own = parent.base.values();
    let mut sketched: Vec<Hypothesis<'d>> = likeliest
        .par_iter()
        .filter_map(|pair| {
            if setting.budget.omits(Step::Fits) {
                return None;
            }
            let parts =
                [0, 1].map(|i| Part::of_candidate(&candidates[pair.members[i]], pair.points[i], &pair.amplitudes[i]));
            assemble(setting, parent, &own, &parts, &parent.base.whitener, 5)
        })
        .collect();
    sketched.sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence));
    let rest = sketched.split_off(PAIRS.1.min(sketched.len()).min(most));
    let to_the_end = |h| if setting.budget.omits(Step::Fits) { h } else { complete(setting, h) };
    let mut out: Vec<Hypothesis<'d>> = sketched.into_par_iter().map(to_the_end).collect();
    out.extend(rest);
    out
}

/// The pairs that explain the whitened residual `r` best, best first, each pair of effects once, at most `most`.
fn pairs(candidates: &[Candidate], r: &[f64], most: usize) -> Vec<Pair> {
    let total = norm2(r);
    let items = items(candidates);
    let groups: Vec<&FeatureGroup> = items.iter().map(|i| i.group).collect();
    let products = Products::new(&groups, r);
    let mut found: Vec<(usize, usize, f64)> = (0..items.len())
        .into_par_iter()
        .flat_map_iter(|a| {
            let (items, products) = (&items, &products);
            let own = products.explained(&items[a].columns);
            (a + 1..items.len()).filter(move |&b| items[b].member != items[a].member).filter_map(move |b| {
                let explained = own + products.beyond(&items[a].columns, &items[b].columns).0;
                let count = items[a].columns.len() + items[b].columns.len();
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
        if are_one_law(first, second) {
            continue;
        }
        let alike = out.iter().filter(|p| p.members.map(kind) == members.map(kind)).count();
        if alike >= 2 {
            continue;
        }
        out.push(Pair {
            members,
            points: [items[a].point, items[b].point],
            amplitudes: amplitudes([&items[a], &items[b]], &products, r),
        });
        if out.len() >= most {
            break;
        }
    }
    out
}

/// The points whose columns were kept, of the best forty candidates and of one of each family at each slot. What one effect alone would be like is not
/// what it is beside another: of two that nearly cancel each other the better points may be the wrong ones.
fn items(candidates: &[Candidate]) -> Vec<Item<'_>> {
    let mut seen: Vec<(&str, &str)> = Vec::new();
    let mut items: Vec<Item<'_>> = Vec::new();
    let (mut members, mut columns) = (0, 0);
    for (member, c) in candidates.iter().enumerate() {
        let place = (c.mechanism.family.name(), c.slot.label.as_str());
        if members >= MOST && (seen.contains(&place) || members >= 2 * MOST) {
            continue;
        }
        seen.push(place);
        members += 1;
        for (point, p) in c.points.iter().enumerate() {
            if let Some(group) = p.joint.as_ref().or(p.group.as_ref()) {
                let names = p.amplitudes.iter().map(|a| a.0.clone()).collect();
                let next = columns + group.columns.len();
                items.push(Item { member, point, group, columns: columns..next, names, score: p.score });
                columns = next;
            }
        }
    }
    items
}

/// Products of all columns with each other and with the residual: what any two groups explain follows from these alone.
struct Products {
    gram: DMatrix<f64>,
    right: Vec<f64>,
}

impl Products {
    fn new(groups: &[&FeatureGroup], r: &[f64]) -> Self {
        let columns: Vec<&[f32]> = groups.iter().flat_map(|g| g.columns.iter().map(Vec::as_slice)).collect();
        let right = columns.iter().map(|c| dot(c, r)).collect();
        let mut gram = DMatrix::zeros(columns.len(), columns.len());
        // Some rows at a time: all columns in one matrix would be in memory twice.
        for from in (0..r.len()).step_by(ROWS) {
            let rows = from..(from + ROWS).min(r.len());
            let some = DMatrix::from_fn(rows.len(), columns.len(), |i, j| columns[j][rows.start + i].into());
            gram.gemm_tr(1.0, &some, &some, 1.0);
        }
        Self { gram, right }
    }

    /// Sum of squares of the residual along a group.
    fn explained(&self, group: &Range<usize>) -> f64 {
        self.right[group.clone()].iter().map(|x| x * x).sum()
    }

    /// The sum of squares of the residual along what `second` spans outside `first`, with the coefficients of the columns of `second` where both are
    /// fitted: Cholesky's factor of what the columns leave outside the first group.
    fn beyond(&self, first: &Range<usize>, second: &Range<usize>) -> (f64, Vec<f64>) {
        let n = second.len();
        let left = |x: &dyn Fn(usize) -> f64, j: usize| first.clone().map(|i| x(i) * self.gram[(i, j)]).sum::<f64>();
        let mut factor = DMatrix::<f64>::zeros(n, n);
        let mut along = vec![0.0; n];
        for (j, column) in second.clone().enumerate() {
            for (k, other) in second.clone().enumerate().take(j) {
                if factor[(k, k)] > 0.0 {
                    let product = self.gram[(column, other)] - left(&|i| self.gram[(i, other)], column);
                    let known: f64 = (0..k).map(|l| factor[(j, l)] * factor[(k, l)]).sum();
                    factor[(j, k)] = (product - known) / factor[(k, k)];
                }
            }
            let known: f64 = (0..j).map(|l| factor[(j, l)].powi(2)).sum();
            let pivot = self.gram[(column, column)] - left(&|i| self.gram[(i, column)], column) - known;
            // Nearly the same effect: what is left is rounding and curvature.
            if pivot < NEARLY_THE_SAME {
                continue;
            }
            factor[(j, j)] = pivot.sqrt();
            let known: f64 = (0..j).map(|l| factor[(j, l)] * along[l]).sum();
            along[j] = (self.right[column] - left(&|i| self.right[i], column) - known) / factor[(j, j)];
        }
        let sum = along.iter().map(|x| x * x).sum();
        for j in (0..n).rev().filter(|&j| factor[(j, j)] > 0.0) {
            let known: f64 = (j + 1..n).map(|l| factor[(l, j)] * along[l]).sum();
            along[j] = (along[j] - known) / factor[(j, j)];
        }
        (sum, along)
    }
}

/// Amplitudes of both where they are fitted together.
fn amplitudes(pair: [&Item<'_>; 2], products: &Products, r: &[f64]) -> [Vec<(String, f64)>; 2] {
    let [a, b] = pair;
    let less = |r: &[f64], group: &FeatureGroup, coefficients: &[f64]| -> Vec<f64> {
        let mut left = r.to_vec();
        for (q, c) in group.columns.iter().zip(coefficients) {
            axpy(-c, q, &mut left);
        }
        left
    };
    let without_b = less(r, b.group, &products.beyond(&a.columns, &b.columns).1);
    let of_a: Vec<f64> = a.group.columns.iter().map(|q| dot(q, &without_b)).collect();
    let named =
        |i: &Item<'_>, rest: &[f64]| i.names.iter().cloned().zip(i.group.amplitudes(rest, i.names.len())).collect();
    [named(a, &without_b), named(b, &less(r, a.group, &of_a))]
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
        let products = Products::new(&[&first, &second], &r);
        let found = products.explained(&(0..2)) + products.beyond(&(0..2), &(2..4)).0;
        // Columns are in single precision.
        assert!((found - both.inside(&r)).abs() < 1e-6 * both.inside(&r), "{found} {}", both.inside(&r));
    }

    #[test]
    fn two_effects_that_nearly_cancel_get_their_amplitudes() {
        let (a, b) = (wave(3.0, 300), wave(3.05, 300));
        let r: Vec<f64> = a.iter().zip(&b).map(|(a, b)| 2.0 * a - 1.8 * b).collect();
        let groups = [group(&[a]), group(&[b])];
        let products = Products::new(&[&groups[0], &groups[1]], &r);
        let named = || vec!["w".into()];
        let item =
            |i: usize| Item { member: i, point: 0, group: &groups[i], columns: i..i + 1, names: named(), score: 0.0 };
        let [x, y] = amplitudes([&item(0), &item(1)], &products, &r);
        assert!((x[0].1 - 2.0).abs() < 1e-5 && (y[0].1 + 1.8).abs() < 1e-5, "{x:?} {y:?}");
    }
}
