//! The searches: greedy, restarts, beam, and the local search over subsets of every size that is the default.
//!
//! All of them fill a [`Table`]: for each number of terms the best subset seen and what it leaves unexplained.

use crate::criterion::choose;
use crate::evidence::Evidence;
use crate::forward::Factor;
use crate::moments::Moments;
use crate::options::longest;
use crate::pursuit::Pursuit;
use crate::refit::{EXACT, Goal, Refit};
use crate::rescore::{Choice, choose_next};
use crate::{Criterion, Options, Rejected, RejectedReason, Search, StopReason};

/// A subset must leave less than this part of the old one's residual to count as better; below [`EXACT`] nothing is better.
const BETTER: f64 = 1.0 - 1e-9;

/// The best subset for each number of terms (place k - 1 for k terms).
#[derive(Default)]
pub(crate) struct Table {
    pub best: Vec<Entry>,
    pub rejected: Vec<Rejected>,
    /// Why the greedy path could not go on, when it could not.
    pub ran_out: Option<StopReason>,
    /// The first greedy step whose choice rounding could have changed.
    pub doubtful_from: Option<usize>,
    /// The last refit of the greedy path.
    pub refit: Option<(Vec<usize>, Refit)>,
}

/// One subset.
#[derive(Clone)]
pub(crate) struct Entry {
    pub columns: Vec<usize>,
    /// What it leaves of y'y, in the arithmetic of the search.
    pub sse: f64,
    /// Whether its neighbours were looked at.
    seen: bool,
}

impl Table {
    /// The path of a matching pursuit.
    pub fn of_pursuit(path: Pursuit, longest: usize) -> Self {
        let entry = |k: usize| Entry { columns: path.columns[..=k].to_vec(), sse: path.sse[k], seen: true };
        let ran_out = (path.columns.len() < longest).then_some(StopReason::ResidualExhausted);
        Self { best: (0..path.columns.len()).map(entry).collect(), ran_out, ..Self::default() }
    }

    /// Keeps the subset if it is better than the one of its size; returns whether it was kept.
    fn offer(&mut self, columns: &[usize], sse: f64) -> bool {
        let entry = Entry { columns: columns.to_vec(), sse, seen: false };
        let size = columns.len();
        if size == self.best.len() + 1 {
            self.best.push(entry);
            return true;
        }
        match size.checked_sub(1).and_then(|i| self.best.get_mut(i)) {
            Some(old) if sse.max(EXACT) < old.sse.max(EXACT) * BETTER => {
                *old = entry;
                true
            }
            _ => false,
        }
    }

    fn offer_path(&mut self, factor: &Factor) {
        let mut sse = 1.0;
        for k in 0..factor.chosen.len() {
            sse -= factor.err(k);
            self.offer(&factor.chosen[..=k], sse);
        }
    }
}

/// Fills the table as the options say.
pub(crate) fn search<E: Evidence + ?Sized>(moments: &mut Moments<'_, E>, options: &Options) -> Table {
    let mut table = Table::default();
    let (samples, candidates) = (moments.evidence.samples(), moments.evidence.candidates());
    let longest = longest(options, samples, candidates);
    let overshoot = match options.search {
        Search::Floating => longest.saturating_add(options.patience).min(candidates).min(samples.max(2) - 1),
        _ => longest,
    };
    let greedy = grow(moments, options, Factor::new(moments), overshoot, Some(&mut table));
    table.offer_path(&greedy);
    let reached = greedy.chosen.len();
    match options.search {
        Search::MatchingPursuit | Search::Greedy => {}
        Search::Iterative { starts } => {
            for first in Factor::new(moments).best(starts, options.pivot_guard) {
                let mut factor = Factor::of(moments, &options.forced, options.pivot_guard);
                if factor.energy[first] > options.pivot_guard {
                    moments.make(first, []);
                    factor.add(first, moments.column(first));
                }
                let path = grow(moments, options, factor, reached, None);
                table.offer_path(&path);
            }
        }
        Search::Beam { width } => {
            beam(moments, options, width, reached, &mut table);
            settle(moments, options, &mut table);
        }
        Search::Floating => settle(moments, options, &mut table),
    }
    table
}

/// Forward regression from `factor` on, to at most `longest` terms.
///
/// With a table to report to it is the main path: rejections and doubts are written down, near-ties are decided from the
/// samples, and it ends early when the criterion has not improved for `patience` terms.
fn grow<E: Evidence + ?Sized>(
    moments: &mut Moments<'_, E>,
    options: &Options,
    mut factor: Factor,
    longest: usize,
    mut report: Option<&mut Table>,
) -> Factor {
    let mut next_look = (options.patience + 4).max(4);
    while factor.chosen.len() < longest {
        let step = factor.chosen.len();
        let ranked = factor.best(8, options.pivot_guard);
        let next = match options.forced.get(step) {
            Some(&j) if factor.energy[j] > options.pivot_guard => j,
            _ => match ranked.first() {
                Some(&best) => match report.as_deref_mut() {
                    Some(table) => {
                        let Choice { column, doubtful } =
                            choose_next(moments.evidence, &factor, &ranked, options.pivot_guard);
                        if doubtful && table.doubtful_from.is_none() {
                            table.doubtful_from = Some(step);
                        }
                        column
                    }
                    None => best,
                },
                None => {
                    if let Some(table) = report.as_deref_mut() {
                        let spare = factor.energy.iter().any(|s| *s > options.pivot_guard);
                        table.ran_out =
                            Some(if spare { StopReason::ResidualExhausted } else { StopReason::NoCandidateLeft });
                    }
                    break;
                }
            },
        };
        if step + 1 == longest && report.is_some() && options.search == Search::Greedy {
            // Nothing is chosen after the last term: what it shares with the other candidates is not asked for.
            moments.make_among(next, &factor.chosen);
            factor.add(next, moments.column(next));
            break;
        }
        moments.make(next, ranked.iter().copied());
        factor.add(next, moments.column(next));
        let Some(table) = report.as_deref_mut() else { continue };
        note_rejected(table, moments, &factor, options.pivot_guard);
        if let Criterion::ErrTolerance(rho) = options.criterion
            && factor.sse() <= rho
            && factor.chosen.len() >= options.forced.len()
        {
            break;
        }
        if factor.chosen.len() == next_look && options.criterion.has_minimum() {
            // A look costs a refit of the whole path: the further it has come, the rarer.
            next_look += (next_look / 2).max(4);
            let path = moments.evidence.refit(&factor.chosen, moments.target_energy, Goal::of(&options.criterion));
            let values = path.values(&options.criterion, moments.evidence.samples());
            let best = choose(&options.criterion, &values, &path.sse);
            table.refit = Some((factor.chosen.clone(), path));
            if best + options.patience <= factor.chosen.len() {
                break;
            }
        }
    }
    factor
}

/// Writes down candidates that the guard shuts out from here on.
fn note_rejected<E: Evidence + ?Sized>(table: &mut Table, moments: &Moments<'_, E>, factor: &Factor, guard: f64) {
    let step = factor.chosen.len();
    for column in 0..moments.len() {
        let left = factor.energy[column];
        if left > guard || factor.chosen.contains(&column) || table.rejected.iter().any(|r| r.column == column) {
            continue;
        }
        let zero = moments.is_zero(column);
        let reason = if zero { RejectedReason::Zero } else { RejectedReason::NearSingular(left.max(0.0)) };
        table.rejected.push(Rejected { column, at_step: if zero { 0 } else { step }, reason });
    }
}

/// The `width` best subsets of each size, each made from one of the `width` best of the size below.
fn beam<E: Evidence + ?Sized>(
    moments: &mut Moments<'_, E>,
    options: &Options,
    width: usize,
    longest: usize,
    table: &mut Table,
) {
    let mut states = vec![Factor::of(moments, &options.forced, options.pivot_guard)];
    for _ in states[0].chosen.len()..longest {
        let mut next: Vec<(f64, Vec<usize>, usize, usize)> = Vec::new();
        for (at, state) in states.iter().enumerate() {
            for j in state.best(width, options.pivot_guard) {
                let mut set = state.chosen.clone();
                set.push(j);
                set.sort_unstable();
                let sse = state.sse() - state.score(j, options.pivot_guard).unwrap_or(0.0);
                next.push((sse, set, at, j));
            }
        }
        next.sort_by(|a, b| a.0.total_cmp(&b.0).then_with(|| a.1.cmp(&b.1)));
        let mut sets: Vec<Vec<usize>> = Vec::new();
        let mut grown = Vec::new();
        for (_, set, at, j) in next {
            if grown.len() == width || sets.contains(&set) {
                continue;
            }
            sets.push(set);
            let mut state = states[at].clone();
            moments.make(j, state.best(8, options.pivot_guard));
            state.add(j, moments.column(j));
            table.offer(&state.chosen, state.sse());
            grown.push(state);
        }
        if grown.is_empty() {
            return;
        }
        states = grown;
    }
}

/// Local search over all sizes at once, until no subset can be bettered by one move.
///
/// The moves on the best subset of k terms: exchange one term for another (again and again while that helps); take the
/// best further term, for k + 1; give back the term that is missed least, for k - 1. Each accepted move leaves less of the
/// target than before, so it ends.
fn settle<E: Evidence + ?Sized>(moments: &mut Moments<'_, E>, options: &Options, table: &mut Table) {
    let guard = options.pivot_guard;
    let fixed = options.forced.len();
    // From the longest down: what the greedy path took too early is given back on the way.
    while let Some(at) = (0..table.best.len()).rev().find(|&i| !table.best[i].seen) {
        table.best[at].seen = true;
        let mut factor = Factor::of(moments, &table.best[at].columns, guard);
        if factor.chosen.len() != at + 1 {
            continue;
        }
        exchange(moments, &mut factor, fixed, guard);
        table.offer(&factor.chosen, factor.sse());
        table.best[at].seen = true;
        if at + 1 < table.best.len()
            && let Some(&j) = factor.best(1, guard).first()
        {
            let mut columns = factor.chosen.clone();
            columns.push(j);
            table.offer(&columns, factor.sse() - factor.score(j, guard).unwrap_or(0.0));
        }
        if at > fixed.max(1) - 1 && at > 0 {
            let members = factor.members();
            let least = (fixed..=at).min_by(|a, b| members[*a].worth.total_cmp(&members[*b].worth));
            if let Some(place) = least {
                let mut columns = factor.chosen.clone();
                columns.remove(place);
                table.offer(&columns, factor.sse() + members[place].worth);
            }
        }
    }
}

/// Exchanges one term for another while that leaves less of the target.
fn exchange<E: Evidence + ?Sized>(moments: &mut Moments<'_, E>, factor: &mut Factor, fixed: usize, guard: f64) {
    loop {
        let sse = factor.sse();
        if sse <= EXACT {
            return;
        }
        let mut best: Option<(usize, usize, f64)> = None;
        for (place, member) in factor.members().iter().enumerate().skip(fixed) {
            if let Some((j, explains)) = factor.best_replacement(place, member, guard) {
                let new = sse + member.worth - explains;
                if new.max(EXACT) < best.map_or(sse * BETTER, |b| b.2) {
                    best = Some((place, j, new.max(EXACT)));
                }
            }
        }
        let Some((place, j, _)) = best else { return };
        factor.remove(place);
        if factor.energy[j] <= guard {
            return;
        }
        moments.make(j, factor.best(8, guard));
        factor.add(j, moments.column(j));
    }
}
