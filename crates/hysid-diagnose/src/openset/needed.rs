//! A correction refitted in the equations, and which of its terms are needed there.
//!
//! Regression chooses terms on the tangent of the simulation as it is. Where the mismatch is large the tangent is only near, and further terms mend what one
//! that is right leaves of it; once that stands in the equations and is refitted they mend nothing, and on another recording they harm. Terms that are
//! missing show around it then.

use hysid_linalg::dot;
use hysid_plant::Simulation;

use super::written::Sparse;
use super::{OpenSet, Writable, correction};
use crate::budget::Step;
use crate::evidence::norm2;
use crate::file::TermRecord;
use crate::model::Values;
use crate::model::base::Base;
use crate::model::hypothesis::{Hypothesis, Setting};

/// A correction that was refitted in the equations.
pub struct Refitted<'d> {
    /// The simulation with it.
    pub hypothesis: Hypothesis<'d>,
    /// The terms that it needs there, as they were fitted; none for a parameter that oscillates.
    pub terms: Vec<TermRecord>,
    /// What the tangent said of it; a parameter that varies as it was fitted.
    pub of: OpenSet,
}

/// Times that terms are looked for around a correction that was refitted.
const MORE: usize = 3;

/// A sparse correction as it was fitted: its terms, the names of their parameters, the fit.
struct Fit<'d> {
    sparse: Sparse,
    names: Vec<Vec<String>>,
    hypothesis: Hypothesis<'d>,
}

/// Share of a correction's gain on the tangent from which its rivals are fitted too: a parameter that varies is one law where it takes many terms to tell it,
/// of which the tangent shows but a part, and is one fit; terms take many.
const RIVAL: (f64, f64) = (0.5, 0.9);

/// What an exponential must lead a sum by, in log evidence: a product of a parameter and what it follows is the simpler law, and beyond what was recorded the two
/// part.
const BENT: f64 = 3.0;

/// A correction as [`fitted`], or a rival of it, whichever has more evidence once it stands in the equations.
pub fn likelier<'d>(
    setting: &Setting<'d>,
    parent: &Hypothesis<'d>,
    open: &OpenSet,
    least: f64,
) -> Option<Refitted<'d>> {
    let likely = |rival: &&OpenSet| {
        let share = if matches!(rival.writable, Some(Writable::Varying(_))) { RIVAL.0 } else { RIVAL.1 };
        rival.gain > share * open.gain
    };
    let rivals = open.rivals.iter().filter(likely).take_while(|_| !setting.budget.omits(Step::Terms));
    let all = std::iter::once(open).chain(rivals);
    let lead = |r: &Refitted<'d>| r.hypothesis.log_evidence - r.of.choice;
    all.filter_map(|o| fitted(setting, parent, o, least)).max_by(|a, b| lead(a).total_cmp(&lead(b)))
}

/// The correction fitted in the place of, or on top of, a set, without the terms that it does not need; further ones are looked for where it reaches this
/// log evidence without them.
fn fitted<'d>(setting: &Setting<'d>, parent: &Hypothesis<'d>, open: &OpenSet, least: f64) -> Option<Refitted<'d>> {
    let sparse = match open.writable.as_ref()? {
        Writable::Varying(varied) => {
            let fits = varied.forms.iter().filter_map(|form| {
                let hypothesis = fit(setting, parent, &parent.base.values(), &form.simulation)?;
                Some((form, hypothesis))
            });
            // In the order of the forms: a later one has to show.
            let (form, hypothesis) = fits.reduce(|best, other| {
                let leads = other.1.log_evidence > best.1.log_evidence + BENT;
                if leads { other } else { best }
            })?;
            let of = open.fitted(varied.fitted(form, &hypothesis.base.values())?);
            return Some(Refitted { hypothesis, terms: Vec::new(), of });
        }
        Writable::Sparse(sparse) => sparse.clone(),
    };
    let mut best = pruned(setting, parent, sparse, &parent.base.values())?;
    for _ in 0..MORE {
        if best.hypothesis.log_evidence < least {
            break;
        }
        let Some(longer) = with_more(setting, parent, &best) else { break };
        best = longer;
    }
    let terms = told(parent, &best)?;
    Some(Refitted { hypothesis: best.hypothesis, terms, of: open.clone() })
}

/// The terms of a correction as they were fitted, each with the share of the residual's power, before any of them, that it explains.
fn told(parent: &Hypothesis<'_>, best: &Fit<'_>) -> Option<Vec<TermRecord>> {
    let base = &best.hypothesis.base;
    let white = |x: &[f64]| base.whitener.apply(&base.model.data().layout, x);
    let r = white(&parent.base.fit.residual);
    let fitted = fitted_values(best)?;
    let of = |(((term, slot), values), names): (((String, &str), &Vec<f64>), &Vec<String>)| {
        let (name, coefficient) = (names.first()?, *values.first()?);
        let column = white(base.fit.jacobian.get(base.model.place_of(name)?)?);
        Some(TermRecord {
            term,
            slot: slot.to_owned(),
            coefficient,
            err: coefficient * dot(&column, &r) / norm2(&r).max(f64::MIN_POSITIVE),
        })
    };
    best.sparse.texts(&fitted).zip(best.sparse.slots()).zip(&fitted).zip(&best.names).map(of).collect()
}

/// A simulation with terms in it, fitted from these values.
fn fit<'d>(
    setting: &Setting<'d>,
    parent: &Hypothesis<'d>,
    from: &Values,
    simulation: &Simulation,
) -> Option<Hypothesis<'d>> {
    let base = setting.fit(simulation, from, Some(&parent.base.whitener), 2, setting.iterations)?;
    Some(setting.hypothesis(parent.effects.clone(), base))
}

/// A correction, fitted, without the terms that it does not need.
fn pruned<'d>(setting: &Setting<'d>, parent: &Hypothesis<'d>, sparse: Sparse, from: &Values) -> Option<Fit<'d>> {
    let (simulation, names) = sparse.written()?;
    let hypothesis = fit(setting, parent, from, &simulation)?;
    let mut best = Fit { sparse, names, hypothesis };
    while let Some(fewer) = without_the_weakest(setting, parent, &best) {
        if fewer.hypothesis.log_evidence < best.hypothesis.log_evidence {
            break;
        }
        best = fewer;
    }
    Some(best)
}

/// The correction with terms that show once it stands in the equations: around it the tangent is another one. `None` where they do not pay for
/// themselves and for having been chosen.
fn with_more<'d>(setting: &Setting<'d>, parent: &Hypothesis<'d>, best: &Fit<'d>) -> Option<Fit<'d>> {
    if setting.budget.omits(Step::Terms) {
        return None;
    }
    let mut open = correction(&best.hypothesis.base, setting.noise)?;
    let rivals = std::mem::take(&mut open.rivals);
    let terms = |o: OpenSet| match o.writable {
        Some(Writable::Sparse(terms)) if o.gain > 0.0 => Some((terms, o.choice)),
        _ => None,
    };
    let (more, choice) = std::iter::once(open).chain(rivals).find_map(terms)?;
    let longer = best.sparse.with(&fitted_values(best)?, &more);
    let longer = pruned(setting, parent, longer, &best.hypothesis.base.values())?;
    (longer.hypothesis.log_evidence > best.hypothesis.log_evidence + choice).then_some(longer)
}

/// Where each term's own parameters were fitted to.
fn fitted_values(fit: &Fit<'_>) -> Option<Vec<Vec<f64>>> {
    let values = fit.hypothesis.base.values().parameters;
    let of_term = |names: &Vec<String>| names.iter().map(|n| values.get(n).copied()).collect();
    fit.names.iter().map(of_term).collect()
}

/// The correction without the term whose coefficient is the smallest beside its standard error.
fn without_the_weakest<'d>(setting: &Setting<'d>, parent: &Hypothesis<'d>, best: &Fit<'d>) -> Option<Fit<'d>> {
    let certainty = certainty(&best.hypothesis.base, &best.names)?;
    let weakest = (0..best.names.len()).min_by(|&a, &b| certainty[a].total_cmp(&certainty[b]))?;
    let sparse = best.sparse.without(weakest, &fitted_values(best)?)?;
    if setting.budget.omits(Step::Terms) {
        return None;
    }
    let (simulation, names) = sparse.written()?;
    let hypothesis = fit(setting, parent, &parent.base.values(), &simulation)?;
    Some(Fit { sparse, names, hypothesis })
}

/// Each term's coefficient over the width of its interval.
fn certainty(base: &Base<'_>, names: &[Vec<String>]) -> Option<Vec<f64>> {
    let intervals = base.intervals();
    let of = |names: &Vec<String>| {
        let of = intervals.iter().find(|i| Some(&i.name) == names.first())?;
        // Nothing is known of one that stands at a bound, or that nothing moves.
        Some(of.ends.map_or(0.0, |[low, high]| of.value.abs() / (high - low).max(f64::MIN_POSITIVE)))
    };
    names.iter().map(of).collect()
}
