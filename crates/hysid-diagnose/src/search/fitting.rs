//! Fitting effects: from a candidate of the screening, or a list of them, to a hypothesis.
//!
//! A few iterations tell who is hopeless; the others are fitted from several starts. Shapes that least squares cannot move (a time, a period,
//! a knee) are searched line by line with the other unknowns refitted.

use hysid_plant::Simulation;
use rayon::prelude::*;

use super::budget::Step;
use super::finer::finer;
use super::hypothesis::{Effect, Hypothesis, Setting};
use super::screen::{Candidate, with_added_starts};
use crate::calibration::global::calibrated_copy;
use crate::calibration::unfold::calibrated_unfolded;
use crate::model::Values;
use crate::model::base::Base;

/// Points of a shape grid that a refit starts from.
const MOST_POINTS: usize = 3;

/// Starts of a refit: the best points of the grid that are no neighbours of each other, and the gentlest.
pub fn starts(candidate: &Candidate) -> Vec<Vec<(String, f64)>> {
    let named = |point: &crate::search::screen::Point| -> Vec<(String, f64)> {
        let mut values = point.shapes.clone();
        for (name, amplitude) in &point.amplitudes {
            values.push((name.clone(), *amplitude));
        }
        values
    };
    let mut out: Vec<Vec<(String, f64)>> = Vec::new();
    let Some(best) = candidate.points.first() else { return out };
    out.push(named(best));
    let far = |a: &[(String, f64)], b: &[(String, f64)]| {
        a.iter().zip(b).any(|((_, x), (_, y))| (x - y).abs() > 0.6 * x.abs().max(y.abs()))
    };
    let mut apart = vec![best];
    for p in &candidate.points[1..] {
        if apart.len() < MOST_POINTS && apart.iter().all(|q| far(&p.shapes, &q.shapes)) {
            apart.push(p);
            out.push(named(p));
        }
    }
    if let [_, .., last] = candidate.refit.amplitudes.as_slice() {
        // Beside another the last amplitude may have the wrong sign at zero, where friction that sticks is nothing like its derivative.
        let mut turned = named(best);
        turned.iter_mut().filter(|(name, _)| *name == last.name).for_each(|(_, value)| *value = -*value);
        out.push(turned);
    }
    if candidate.refit.amplitudes.is_empty() && !candidate.refit.neutral.is_empty() {
        // Only shapes: the effect's strength is in them, and the point's weight says how strong.
        let weight = best.amplitudes.first().map_or(1.0, |a| a.1.clamp(0.05, 1.0));
        let neutral = |name: &str| candidate.refit.neutral.iter().find(|(n, _)| n == name).map_or(0.0, |(_, v)| *v);
        out.push(best.shapes.iter().map(|(n, v)| (n.clone(), neutral(n) + weight.sqrt() * (v - neutral(n)))).collect());
    }
    out
}

/// A few iterations from a candidate's best start, the first of `froms`; from the last two as well (the user's own parameters and a global
/// calibration) where the fit without the effect is far off.
fn sketch<'d>(
    setting: &Setting<'d>,
    parent: &Hypothesis<'_>,
    candidate: &Candidate,
    froms: &[Values],
) -> Option<Base<'d>> {
    froms
        .iter()
        .enumerate()
        .filter(|(i, _)| *i == 0 || (*i + 2 >= froms.len() && parent.base.far()))
        .filter_map(|(_, from)| setting.fit(&candidate.refit.simulation, from, Some(&parent.base.whitener), 1, 3))
        .max_by(|a, b| a.log_likelihood.total_cmp(&b.log_likelihood))
}

/// Sets a start value of a parameter that the document has, within its bounds.
pub fn set(values: &mut Values, document: &Simulation, name: &str, x: f64) {
    if let Some(p) = document.parameter(name) {
        values.parameters.insert(name.to_owned(), x.clamp(p.lower(), p.upper()));
    }
}

/// The parent's values with each of the candidate's starts; the last one has the simulation's parameters as the user gave them where the
/// parent has no effect yet, and the one before it comes from a global calibration where the parent is far off and the law has no amplitude.
fn starting_values(setting: &Setting<'_>, parent: &Hypothesis<'_>, candidate: &Candidate) -> Vec<Values> {
    let document = &candidate.refit.simulation;
    let values =
        with_added_starts(&parent.base.values(), &candidate.refit, &candidate.slot, setting.data.stretches.len());
    let with = |values: &Values, start: Vec<(String, f64)>| {
        let mut from = values.clone();
        start.iter().for_each(|(name, x)| set(&mut from, document, name, *x));
        from
    };
    let starts = starts(candidate);
    let mut out: Vec<Values> = starts.iter().map(|s| with(&values, s.clone())).collect();
    if parent.effects.is_empty()
        && let Some(best) = starts.into_iter().next()
    {
        let mut own = values.clone();
        for p in setting.original.parameters.iter().filter(|p| !p.fixed) {
            own.parameters.insert(p.name.clone(), p.value);
        }
        let own = with(&own, best);
        // A law with amplitudes begins beside the simulation as it is; one without them is there or not, and may stand far from it.
        if candidate.refit.amplitudes.is_empty() && parent.base.far() && !setting.budget.omits(Step::Fits) {
            let mut document = document.clone();
            for p in &mut document.parameters {
                p.value = own.parameters.get(&p.name).copied().unwrap_or(p.value);
            }
            let restored = calibrated_unfolded(&setting.original, &document, setting.data);
            if let Some(found) = restored.or_else(|| calibrated_copy(&document, setting.data, 1).map(|c| c.0)) {
                let mut global = own.clone();
                global.parameters.extend(found.parameters.iter().map(|p| (p.name.clone(), p.value)));
                out.push(global);
            }
        }
        out.push(own);
    }
    out
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
        let brief = if i == 0 { setting.iterations } else { 5 };
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

/// The end of a fit: shapes that least squares cannot move, of the effects from `from` on, then a round under the hypothesis' own noise.
pub fn finish<'d>(setting: &Setting<'d>, h: &mut Hypothesis<'d>, from: usize) {
    for index in from..h.effects.len() {
        profile_shapes(setting, h, index);
    }
    if setting.budget.omits(Step::Fits) {
        return;
    }
    let polished = setting.further(&h.base, Some(&h.base.whitener), 1, setting.iterations);
    if let Some(p) = polished
        && p.log_likelihood > h.base.log_likelihood
    {
        h.base = p;
    }
    h.log_evidence = setting.evidence(&h.base);
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

/// Line search over shapes that least squares cannot move: where the derivative by the shape vanishes or the shape stands where it began,
/// its neighbourhood in the grid is searched by shrinking steps, the other unknowns refitted at each.
fn profile_shapes<'d>(setting: &Setting<'d>, h: &mut Hypothesis<'d>, index: usize) {
    let whole = h.base.model.simulation().clone();
    let effect = h.effects[index].clone();
    for shape in &effect.written.shapes {
        if !shape.searched || shape.grid.len() < 3 {
            continue;
        }
        let mut document = whole.clone();
        let Some(p) = document.parameter_mut(&shape.name) else { continue };
        let (low, high) = (p.lower(), p.upper());
        p.fixed = true;
        let here = |b: &Base<'_>| b.values().parameters.get(&shape.name).copied().unwrap_or(0.0);
        let spacing = shape.grid.windows(2).map(|w| w[1] - w[0]).fold(f64::INFINITY, f64::min);
        let mut step = 0.5 * spacing;
        let mut moved = false;
        for _ in 0..6 {
            if setting.budget.omits(Step::Fits) {
                break;
            }
            let x = here(&h.base);
            let trials: Vec<Option<Base<'d>>> = [x - step, x + step]
                .into_par_iter()
                .map(|value| {
                    if value < low || value > high {
                        return None;
                    }
                    let mut d = document.clone();
                    if let Some(p) = d.parameter_mut(&shape.name) {
                        p.value = value;
                    }
                    let mut from = h.base.values();
                    from.parameters.insert(shape.name.clone(), value);
                    setting.fit(&d, &from, Some(&h.base.whitener), 1, 3)
                })
                .collect();
            let better = trials
                .into_iter()
                .flatten()
                .filter(|t| t.log_likelihood > h.base.log_likelihood + 1e-3)
                .max_by(|a, b| a.log_likelihood.total_cmp(&b.log_likelihood));
            match better {
                Some(t) => (h.base, moved) = (t, true),
                None => step *= 0.4,
            }
        }
        if moved {
            // Back to the document in which the shape is an unknown again.
            for iterations in [2, 0] {
                let values = h.base.values();
                if let Some(b) = setting.fit(&whole, &values, Some(&h.base.whitener), 1, iterations)
                    && (b.log_likelihood >= h.base.log_likelihood || iterations == 0)
                {
                    h.base = b;
                    break;
                }
            }
        }
    }
}

/// Candidates of a list that are fitted to the end.
const MOST_COMPLETE: usize = 8;
/// Log evidence by which a candidate may trail after a few iterations and still be refitted to the end.
pub const HOPELESS: f64 = 40.0;

/// Refits a short list on top of a hypothesis, in parallel, best evidence first.
///
/// A few iterations from the best start tell who is hopeless; the others are refitted to the end, from all their starts. The first is
/// always begun, however little time there is.
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
        .filter_map(|(c, (froms, sketched))| match sketched {
            Some(h) if h.log_evidence < threshold => Some(h),
            sketched if setting.budget.omits(Step::Fits) => sketched,
            sketched => refit_from(setting, parent, c, froms, sketched.map(|h| h.base)),
        })
        .collect();
    out.sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence));
    out
}
