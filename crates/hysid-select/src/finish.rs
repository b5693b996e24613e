//! From a table of subsets to the result: refit from the samples, choose the size, order the terms, check the arithmetic.

use crate::criterion::choose;
use crate::evidence::Evidence;
use crate::forward::{Factor, NOISE};
use crate::moments::Moments;
use crate::refit::{Goal, Refit};
use crate::search::Table;
use crate::{Criterion, CurvePoint, Options, Precision, Search, Selection, Step, StopReason};

/// Deviation of the search's error reduction ratios from those of the QR, beyond which they count as doubtful.
const DEVIATION: f64 = 1e-3;

pub(crate) fn finish<E: Evidence + ?Sized>(
    options: &Options,
    moments: &mut Moments<'_, E>,
    mut table: Table,
) -> Selection {
    let (evidence, energy) = (moments.evidence, moments.target_energy);
    let samples = evidence.samples();
    let goal = Goal::of(&options.criterion);
    let pursuit = options.search == Search::MatchingPursuit;
    let mut curve: Vec<CurvePoint> = Vec::with_capacity(table.best.len());
    // Subsets that contain each other share one refit: walk from the longest down, chain by chain.
    let mut chains: Vec<(Vec<usize>, Refit)> = Vec::new();
    let mut chain_end = table.best.len();
    let mut reversed: Vec<CurvePoint> = Vec::new();
    while chain_end > 0 {
        let (order, shortest) = chain(&table, chain_end);
        let fit = match table.refit.take_if(|(columns, _)| *columns == order) {
            Some((_, fit)) => fit,
            None => evidence.refit(&order, energy, goal.clone()),
        };
        for k in (shortest..=chain_end).rev() {
            let search_sse = table.best[k - 1].sse.max(0.0);
            let mut facts = fit.facts(k, samples);
            if pursuit
                && !matches!(
                    options.criterion,
                    Criterion::Press(crate::PressForm::Exact) | Criterion::SearchedPress | Criterion::Blocks(_)
                )
            {
                facts.sse = search_sse;
            }
            reversed.push(CurvePoint {
                columns: table.best[k - 1].columns.clone(),
                criterion: crate::criterion::value(&options.criterion, facts),
                sse: fit.sse[k - 1],
                press: fit.press[k - 1],
                search_sse,
            });
        }
        chain_end = shortest - 1;
        chains.push((order, fit));
    }
    curve.extend(reversed.into_iter().rev());

    let values: Vec<f64> = curve.iter().map(|p| p.criterion).collect();
    let sse: Vec<f64> = curve.iter().map(|p| if pursuit { p.search_sse } else { p.sse }).collect();
    let allowed = options.max_terms_allowed().min(values.len());
    let size = choose(&options.criterion, &values[..allowed], &sse[..allowed]).max(options.forced.len().min(allowed));
    let stop = match options.criterion {
        Criterion::Terms(n) if size == n => StopReason::GoalReached,
        Criterion::ErrTolerance(rho) if size > 0 && sse[size - 1] <= rho => StopReason::GoalReached,
        _ if size < values.len() => StopReason::CriterionMinimum,
        _ => table.ran_out.unwrap_or(StopReason::MaxTerms),
    };

    let subset = size.checked_sub(1).map_or(&[][..], |i| &table.best[i].columns);
    let terms = if pursuit { subset.to_vec() } else { in_order(moments, options, subset) };
    let fit = match chains.into_iter().find(|(order, _)| order.starts_with(&terms)) {
        Some((_, fit)) => fit,
        None => evidence.refit(&terms, energy, goal),
    };
    let solution = fit.solution(size);
    let (err_deviation, smallest_pivot, first_bad) = check(moments, &terms, &fit);
    let doubtful_from = match options.search {
        Search::MatchingPursuit => None,
        _ => [table.doubtful_from.filter(|s| *s < size), first_bad].into_iter().flatten().min(),
    };
    let step = |k: usize| Step {
        column: terms[k],
        err: fit.err[k],
        criterion: crate::criterion::value(&options.criterion, fit.facts(k + 1, samples)),
        sse: fit.sse[k],
        press: fit.press[k],
        condition: fit.condition[k],
    };
    Selection {
        steps: (0..terms.len()).map(step).collect(),
        theta: solution.theta,
        unscaled_variance: solution.unscaled_variance,
        terms,
        curve,
        stop,
        rejected: table.rejected,
        precision: Precision { err_deviation, smallest_pivot, doubtful_from },
        target_energy: energy,
        samples,
    }
}

/// An order of the subset of `longest` terms such that its beginnings are the table's subsets down to the returned size.
fn chain(table: &Table, longest: usize) -> (Vec<usize>, usize) {
    let mut set = table.best[longest - 1].columns.clone();
    let mut tail = Vec::new();
    let mut shortest = longest;
    while shortest > 1 {
        let smaller = &table.best[shortest - 2].columns;
        if !smaller.iter().all(|j| set.contains(j)) {
            break;
        }
        let Some(place) = set.iter().position(|j| !smaller.contains(j)) else { break };
        tail.push(set.remove(place));
        shortest -= 1;
    }
    set.extend(tail.into_iter().rev());
    (set, shortest)
}

/// The subset in the order in which forward regression takes it, the forced columns first.
fn in_order<E: Evidence + ?Sized>(moments: &mut Moments<'_, E>, options: &Options, subset: &[usize]) -> Vec<usize> {
    let guard = options.pivot_guard;
    let mut factor = Factor::new(moments);
    while factor.chosen.len() < subset.len() {
        let left = subset.iter().copied().filter(|j| !factor.chosen.contains(j));
        let forced = options.forced.get(factor.chosen.len()).copied().filter(|j| subset.contains(j));
        let score = |j: usize| factor.score(j, guard).unwrap_or(-1.0);
        let best = left.clone().fold(None, |best: Option<usize>, j| match best {
            Some(b) if score(j) < score(b) || score(j) == score(b) && j > b => Some(b),
            _ => Some(j),
        });
        let Some(next) = forced.or(best).filter(|j| factor.energy[*j] > 0.0) else {
            // Nothing more can be told apart: the rest in the order it came.
            let rest: Vec<usize> = left.collect();
            let mut order = factor.chosen;
            order.extend(rest);
            return order;
        };
        moments.make(next, left);
        factor.add(next, moments.column(next));
    }
    factor.chosen
}

/// Compares the error reduction ratios on inner products with those of the QR; without samples to factor, with what rounding may do.
fn check<E: Evidence + ?Sized>(
    moments: &mut Moments<'_, E>,
    terms: &[usize],
    fit: &Refit,
) -> (f64, f64, Option<usize>) {
    let factor = Factor::of(moments, terms, 0.0);
    let (mut worst, mut pivot, mut first_bad) = (0.0f64, 1.0f64, None);
    for k in 0..factor.chosen.len().min(fit.err.len()) {
        let (a, b) = (factor.err(k), fit.err[k]);
        // Below the rounding of inner products the two cannot agree, and need not.
        let deviation = if !fit.from_samples {
            2.0 * NOISE / factor.gain[k].abs() / factor.pivot(k).sqrt() + NOISE / factor.pivot(k)
        } else if a.max(b) > 1e-24 {
            (a - b).abs() / a.max(b)
        } else {
            0.0
        };
        worst = worst.max(deviation);
        pivot = pivot.min(factor.pivot(k));
        if deviation > DEVIATION && first_bad.is_none() {
            first_bad = Some(k);
        }
    }
    (worst, pivot, first_bad)
}
