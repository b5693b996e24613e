//! Orthogonal forward regression on inner products: a pivoted Cholesky factorisation that grows a row at a time.
//!
//! With the chosen columns taken out, candidate j has the energy S_j and the inner product c_j with what is left of the
//! target; its error reduction ratio is c_j^2 / S_j. Choosing a column subtracts its row of the factor from both.

use hysid_linalg::Columns;

use crate::criterion::{Facts, choose, value};
use crate::moments::Moments;
use crate::refit::refit;
use crate::{
    Criterion, CurvePoint, Options, Precision, Rejected, RejectedReason, SelectError, Selection, Step, StopReason,
};

/// An inner product of unit vectors below this is rounding.
pub(crate) const NOISE: f64 = 64.0 * f64::EPSILON;

/// The factor so far, and what is left of every candidate.
#[derive(Clone)]
pub(crate) struct Factor {
    pub chosen: Vec<usize>,
    /// Error reduction ratio of each chosen column.
    pub err: Vec<f64>,
    /// Energy of each chosen column when it was chosen.
    pub pivot: Vec<f64>,
    /// Row i of the factor, for all candidates.
    rows: Vec<Vec<f64>>,
    /// Energy left of each candidate.
    pub energy: Vec<f64>,
    /// Inner product left of each candidate with the target.
    pub cross: Vec<f64>,
}

impl Factor {
    pub fn new<C: Columns + ?Sized>(moments: &Moments<'_, C>) -> Self {
        let energy = (0..moments.len()).map(|j| if moments.is_zero(j) { 0.0 } else { 1.0 }).collect();
        let cross = moments.cross.clone();
        Self { chosen: Vec::new(), err: Vec::new(), pivot: Vec::new(), rows: Vec::new(), energy, cross }
    }

    /// The error reduction ratio that candidate `j` would have; `None` if it may not be chosen.
    pub fn score(&self, j: usize, guard: f64) -> Option<f64> {
        let (s, c) = (self.energy[j], self.cross[j]);
        (s > guard && c.abs() > NOISE).then(|| c * c / s)
    }

    /// The candidates with the largest scores, best first, ties by number.
    pub fn best(&self, count: usize, guard: f64) -> Vec<usize> {
        let mut scored: Vec<(f64, usize)> =
            (0..self.energy.len()).filter_map(|j| self.score(j, guard).map(|s| (s, j))).collect();
        let by = |a: &(f64, usize), b: &(f64, usize)| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1));
        if scored.len() > count && count > 0 {
            scored.select_nth_unstable_by(count - 1, by);
            scored.truncate(count);
        }
        scored.sort_by(by);
        scored.into_iter().map(|(_, j)| j).collect()
    }

    /// Takes candidate `j`, given its column of the Gram matrix.
    pub fn add(&mut self, j: usize, gram: &[f64]) {
        let mut row = gram.to_vec();
        for before in &self.rows {
            let a = before[j];
            for (r, b) in row.iter_mut().zip(before) {
                *r -= a * b;
            }
        }
        let pivot = self.energy[j];
        let inverse = 1.0 / pivot.sqrt();
        let g = self.cross[j] * inverse;
        for ((r, s), c) in row.iter_mut().zip(&mut self.energy).zip(&mut self.cross) {
            *r *= inverse;
            *s -= *r * *r;
            *c -= *r * g;
        }
        // A chosen column has nothing left, exactly.
        self.energy[j] = 0.0;
        self.cross[j] = 0.0;
        self.rows.push(row);
        self.chosen.push(j);
        self.err.push(g * g);
        self.pivot.push(pivot);
    }
}

/// How many terms a search must look at.
pub(crate) fn longest(options: &Options, rows: usize, cols: usize) -> usize {
    let wanted = match options.criterion {
        Criterion::Terms(n) => n,
        _ => options.max_terms,
    };
    wanted.min(cols).min(rows.saturating_sub(1).max(1))
}

pub(crate) fn greedy<C: Columns + ?Sized>(phi: &C, y: &[f64], options: &Options) -> Result<Selection, SelectError> {
    let mut moments = Moments::new(phi, y)?;
    let longest = longest(options, phi.rows(), phi.cols());
    let mut factor = Factor::new(&moments);
    let mut rejected: Vec<Rejected> = (0..moments.len())
        .filter(|j| moments.is_zero(*j))
        .map(|column| Rejected { column, at_step: 0, reason: RejectedReason::Zero })
        .collect();
    let mut ran_out = None;
    while factor.chosen.len() < longest {
        let step = factor.chosen.len();
        let ranked = factor.best(8, options.pivot_guard);
        let next = match options.forced.get(step) {
            Some(&j) if factor.energy[j] > options.pivot_guard => j,
            _ => match ranked.first() {
                Some(&j) => j,
                None => {
                    let spare = (0..moments.len()).any(|j| factor.energy[j] > options.pivot_guard);
                    ran_out = Some(if spare { StopReason::ResidualExhausted } else { StopReason::NoCandidateLeft });
                    break;
                }
            },
        };
        moments.make(next, ranked.iter().copied());
        factor.add(next, moments.column(next));
        for column in 0..moments.len() {
            let left = factor.energy[column];
            let known = factor.chosen.contains(&column) || rejected.iter().any(|r| r.column == column);
            if left <= options.pivot_guard && !known {
                let reason = RejectedReason::NearSingular(left.max(0.0));
                rejected.push(Rejected { column, at_step: step + 1, reason });
            }
        }
        if let Criterion::ErrTolerance(rho) = options.criterion {
            if 1.0 - factor.err.iter().sum::<f64>() <= rho {
                break;
            }
        }
    }
    Ok(finish_path(phi, y, options, &moments, &factor, rejected, ran_out))
}

/// Refits the path, chooses its length by the criterion and writes the result.
fn finish_path<C: Columns + ?Sized>(
    phi: &C,
    y: &[f64],
    options: &Options,
    moments: &Moments<'_, C>,
    factor: &Factor,
    rejected: Vec<Rejected>,
    ran_out: Option<StopReason>,
) -> Selection {
    let (samples, energy) = (phi.rows(), moments.target_energy);
    let path = &factor.chosen;
    let whole = refit(phi, y, path, energy);
    let values: Vec<f64> = (0..path.len())
        .map(|k| {
            let facts = Facts { terms: k + 1, samples, sse: whole.sse[k], press: whole.press[k], blocks: f64::NAN };
            value(&options.criterion, facts)
        })
        .collect();
    let size = choose(&options.criterion, &values, &whole.sse);
    let stop = match options.criterion {
        Criterion::Terms(n) if size == n => StopReason::GoalReached,
        Criterion::ErrTolerance(rho) if size > 0 && whole.sse[size - 1] <= rho => StopReason::GoalReached,
        _ if size < path.len() => StopReason::CriterionMinimum,
        _ => ran_out.unwrap_or(StopReason::MaxTerms),
    };
    let terms = path[..size].to_vec();
    let fit = refit(phi, y, &terms, energy).fit;
    let deviation = |k: usize| {
        let (a, b) = (factor.err[k], whole.err[k]);
        if a.max(b) > 0.0 { (a - b).abs() / a.max(b) } else { 0.0 }
    };
    let steps = (0..size)
        .map(|k| Step {
            column: path[k],
            err: whole.err[k],
            criterion: values[k],
            sse: whole.sse[k],
            press: whole.press[k],
            condition: whole.condition[k],
        })
        .collect();
    let curve = (0..path.len())
        .map(|k| CurvePoint {
            columns: path[..=k].to_vec(),
            criterion: values[k],
            sse: whole.sse[k],
            press: whole.press[k],
        })
        .collect();
    Selection {
        theta: fit.theta,
        unscaled_variance: fit.unscaled_variance,
        steps,
        curve,
        stop,
        rejected,
        precision: Precision {
            err_deviation: (0..size).map(deviation).fold(0.0, f64::max),
            smallest_pivot: factor.pivot[..size].iter().copied().fold(1.0, f64::min),
            doubtful_from: (0..size).find(|&k| deviation(k) > 1e-3),
        },
        terms,
        target_energy: energy,
        samples,
    }
}
