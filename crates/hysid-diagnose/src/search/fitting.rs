//! Fitting effects: from a candidate of the screening, or a list of them, to a hypothesis.
//!
//! A few iterations tell who is hopeless; the others are fitted from several starts and to their end.

use rayon::prelude::*;

use super::finer::finer;
use super::finish::finish;
use super::screen::{Candidate, with_added_starts};
use super::starts::{is_in_a_loop, set, starting_values, starts, strength_in_shapes};
use crate::budget::Step;
use crate::model::Values;
use crate::model::base::Base;
use crate::model::hypothesis::{Effect, Hypothesis, Setting};

/// A few iterations from a candidate's best start, the first of `froms`; from the second as well where the law's strength is in its shapes (at the points
/// of the grid it may be far too strong), and from the last two (the user's own parameters and a global calibration) where the fit without the effect is
/// far off.
fn sketch<'d>(
    setting: &Setting<'d>,
    parent: &Hypothesis<'_>,
    candidate: &Candidate,
    froms: &[Values],
) -> Option<Base<'d>> {
    let first = 1 + usize::from(strength_in_shapes(candidate));
    froms
        .iter()
        .enumerate()
        .filter(|(i, _)| *i < first || (*i + 2 >= froms.len() && parent.base.far()))
        .filter_map(|(_, from)| setting.fit(&candidate.refit.simulation, from, Some(&parent.base.whitener), 1, 3))
        .max_by(|a, b| a.log_likelihood.total_cmp(&b.log_likelihood))
}

/// Refits one candidate on top of a hypothesis' simulation.
pub fn refit<'d>(setting: &Setting<'d>, parent: &Hypothesis<'_>, candidate: &Candidate) -> Option<Hypothesis<'d>> {
    refit_from(setting, parent, candidate, starting_values(setting, parent, candidate), None)
}

/// Refits a candidate whose law contains that of `special`, from where that one came to rest.
///
/// What both laws name alike, and their shapes in order, begin at its values; amplitudes that only the wider law has begin at zero.
pub fn refit_wider<'d>(
    setting: &Setting<'d>,
    parent: &Hypothesis<'_>,
    wider: &Candidate,
    special: &Hypothesis<'_>,
) -> Option<Hypothesis<'d>> {
    let values = special.base.values();
    let effect = special.effects.last()?;
    let start = starts(wider).into_iter().next()?;
    let found = |name: &str| values.parameters.get(name).copied();
    let shape = |name: &str| {
        let place = wider.refit.shapes.iter().position(|s| s.name == name)?;
        found(&effect.written.shapes.get(place)?.name)
    };
    let amplitude = |name: &str| wider.refit.amplitudes.iter().any(|a| a.name == name).then_some(0.0);
    let mut from = with_added_starts(&values, &wider.refit, &wider.slot, setting.data.stretches.len());
    for (name, x) in start {
        let x = found(&name).or_else(|| shape(&name)).or_else(|| amplitude(&name)).unwrap_or(x);
        set(&mut from, &wider.refit.simulation, &name, x);
    }
    refit_from(setting, parent, wider, vec![from], None)
}

/// Refits one candidate from these values; `begun` is a fit that has not converged and goes on in the place of the first of them.
fn refit_from<'d>(
    setting: &Setting<'d>,
    parent: &Hypothesis<'_>,
    candidate: &Candidate,
    froms: Vec<Values>,
    begun: Option<Base<'d>>,
) -> Option<Hypothesis<'d>> {
    let document = &candidate.refit.simulation;
    let mut best: Option<Base<'d>> = begun;
    for (i, from) in froms.into_iter().enumerate() {
        if best.is_some() && setting.budget.omits(Step::Fits) {
            break;
        }
        // Another start must come near the best in a few iterations to be followed.
        let brief = if i == 0 || is_in_a_loop(candidate) { setting.iterations } else { 5 };
        let fitted = match &best {
            Some(begun) if i == 0 => setting.further(begun, Some(&parent.base.whitener), 1, brief),
            _ => setting.fit(document, &from, Some(&parent.base.whitener), 1, brief),
        };
        let Some(mut base) = fitted else { continue };
        if i > 0 && best.as_ref().is_none_or(|b| base.log_likelihood > b.log_likelihood - 10.0) {
            let longer = setting.further(&base, Some(&parent.base.whitener), 1, setting.iterations);
            base = longer.unwrap_or(base);
        }
        if best.as_ref().is_none_or(|b| base.log_likelihood > b.log_likelihood) {
            best = Some(base);
        }
    }
    let mut h = hypothesis(setting, parent, candidate, best?);
    finish(setting, &mut h, parent.effects.len());
    Some(finer(setting, parent, &h, parent.effects.len()).unwrap_or(h))
}

/// A fitted candidate as a hypothesis.
fn hypothesis<'d>(
    setting: &Setting<'d>,
    parent: &Hypothesis<'_>,
    candidate: &Candidate,
    base: Base<'d>,
) -> Hypothesis<'d> {
    let mut effects = parent.effects.clone();
    effects.push(Effect {
        mechanism: candidate.mechanism,
        slot: candidate.slot.clone(),
        written: candidate.refit.clone(),
        concealment: candidate.concealment(),
    });
    setting.hypothesis(effects, base)
}

/// Candidates of a list that are fitted to the end.
const MOST_COMPLETE: usize = 8;
/// Log evidence by which a candidate may trail after a few iterations and still be refitted to the end.
pub const HOPELESS: f64 = 40.0;

/// A sketch that fits worse than the simulation without its effect is none of the effect's best: it has not come near a minimum, or it was fitted under a noise
/// that is no longer there (where 1/f noise hid a drift, the mean was free). Where the effect promised more than the threshold it is fitted on, under the noise
/// that it leaves.
fn brought_home<'d>(
    setting: &Setting<'d>,
    parent: &Hypothesis<'_>,
    candidate: &Candidate,
    sketched: Hypothesis<'d>,
    threshold: f64,
) -> Hypothesis<'d> {
    let strayed = sketched.log_evidence < threshold && sketched.base.log_likelihood < parent.base.log_likelihood;
    if !strayed || parent.log_evidence + candidate.score() < threshold || setting.budget.omits(Step::Fits) {
        return sketched;
    }
    let own = Some(&sketched.base.whitener);
    let longer = setting.further(&sketched.base, own, 1, setting.iterations);
    let longer = longer.map(|base| hypothesis(setting, parent, candidate, base));
    longer.filter(|h| h.log_evidence > sketched.log_evidence).unwrap_or(sketched)
}

/// Refits a short list on top of a hypothesis, in parallel, best evidence first.
///
/// A few iterations from the best start tell who is hopeless (but within a loop of the simulation); the others are refitted to the end, from all their
/// starts. The first is always begun, however little time there is.
pub fn refit_all<'d>(setting: &Setting<'d>, parent: &Hypothesis<'d>, list: &[&Candidate]) -> Vec<Hypothesis<'d>> {
    let first: Vec<(Vec<Values>, Option<Hypothesis<'d>>)> = list
        .par_iter()
        .enumerate()
        .map(|(i, c)| {
            if i > 0 && setting.budget.omits(Step::Fits) {
                return (Vec::new(), None);
            }
            let froms = starting_values(setting, parent, c);
            let sketched = sketch(setting, parent, c, &froms).map(|base| hypothesis(setting, parent, c, base));
            (froms, sketched)
        })
        .collect();
    let mut order: Vec<f64> = first.iter().flat_map(|(_, h)| h).map(|h| h.log_evidence).collect();
    order.sort_by(|a, b| b.total_cmp(a));
    let best = order.first().copied().unwrap_or(f64::NEG_INFINITY);
    let fourth = order.get(3).copied().unwrap_or(f64::NEG_INFINITY);
    let last = order.get(MOST_COMPLETE - 1).copied().unwrap_or(f64::NEG_INFINITY);
    let threshold = (best - HOPELESS).min(fourth).max(last);
    let mut out: Vec<Hypothesis<'d>> = list
        .par_iter()
        .zip(first)
        .filter_map(|(c, (froms, sketched))| match sketched.map(|h| brought_home(setting, parent, c, h, threshold)) {
            Some(h) if h.log_evidence < threshold && !is_in_a_loop(c) => Some(h),
            sketched if setting.budget.omits(Step::Fits) => sketched,
            sketched => refit_from(setting, parent, c, froms, sketched.map(|h| h.base)),
        })
        .collect();
    out.sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence));
    out
}
