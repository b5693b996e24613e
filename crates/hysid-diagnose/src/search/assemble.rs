//! Sets of effects written into a simulation together: from parts with start values to a hypothesis, on to its end, and without one of them.

use super::finish::finish;
use super::screen::{Candidate, rewrite_at, with_added_starts};
use super::starts::{set, starts, weakened};
use crate::evidence::Whitener;
use crate::mechanism::{Mechanism, Purpose};
use crate::model::Values;
use crate::model::hypothesis::{Effect, Hypothesis, Setting};

/// An effect to be written: the mechanism, the slot's name, values of its parameters in the order of the law.
pub struct Part {
    /// The mechanism.
    pub mechanism: &'static Mechanism,
    /// The slot.
    pub slot: String,
    /// The form of its law.
    pub purpose: Purpose,
    /// Start values of amplitudes, then shapes; missing ones stay as the law has them.
    pub values: Vec<Option<f64>>,
    /// Share that the simulation's own parameters absorb, from the screening.
    pub concealment: Option<f64>,
}

impl Part {
    /// A candidate at a point of its grid, `amplitudes` as they explain the residual.
    pub fn of_candidate(candidate: &Candidate, point: usize, amplitudes: &[(String, f64)]) -> Self {
        let start = starts(candidate).into_iter().next().unwrap_or_default();
        let shapes = candidate.points.get(point).map_or(&[][..], |p| &p.shapes);
        // A pair tells how strong each of its members is.
        let weaker = amplitudes.first().and_then(|(_, weight)| weakened(candidate, shapes, *weight));
        let shapes = weaker.as_deref().unwrap_or(shapes);
        let find = |list: &[(String, f64)], name: &str| list.iter().find(|(n, _)| n == name).map(|(_, v)| *v);
        let values = candidate.refit.parameters_of();
        Self {
            mechanism: candidate.mechanism,
            slot: candidate.slot.label.clone(),
            purpose: candidate.refit.purpose,
            values: values
                .iter()
                .map(|n| find(amplitudes, n).or_else(|| find(shapes, n)).or_else(|| find(&start, n)))
                .collect(),
            concealment: candidate.concealment(),
        }
    }

    /// An effect of a fitted hypothesis, as it stands.
    pub fn of_effect(effect: &Effect, values: &Values) -> Self {
        Self {
            mechanism: effect.mechanism,
            slot: effect.slot.label.clone(),
            purpose: effect.written.purpose,
            values: effect.written.parameters_of().iter().map(|n| values.parameters.get(n).copied()).collect(),
            concealment: effect.concealment,
        }
    }
}

/// Several effects written into the simulation of `trunk` one after the other and fitted for `iterations` from these values, first under
/// this noise model.
pub fn assemble<'d>(
    setting: &Setting<'d>,
    trunk: &Hypothesis<'_>,
    own: &Values,
    parts: &[Part],
    noise: &Whitener,
    iterations: usize,
) -> Option<Hypothesis<'d>> {
    let mut document = trunk.base.document();
    let mut values = own.clone();
    let mut effects = trunk.effects.clone();
    for part in parts {
        let (written, slot) =
            rewrite_at(&trunk.base, &document, &setting.original, part.mechanism, &part.slot, part.purpose)?;
        values = with_added_starts(&values, &written, &slot, setting.data.stretches.len());
        for (name, x) in written.parameters_of().iter().zip(&part.values) {
            if let Some(x) = x {
                set(&mut values, &written.simulation, name, *x);
            }
        }
        document = written.simulation.clone();
        effects.push(Effect { mechanism: part.mechanism, slot, written, concealment: part.concealment });
    }
    let base = setting.fit(&document, &values, Some(noise), 1, iterations)?;
    Some(setting.hypothesis(effects, base))
}

/// Goes on with a hypothesis that was fitted for a few iterations only.
pub fn complete<'d>(setting: &Setting<'d>, mut h: Hypothesis<'d>) -> Hypothesis<'d> {
    if let Some(base) = setting.further(&h.base, Some(&h.base.whitener), 2, setting.iterations)
        && base.log_likelihood > h.base.log_likelihood
    {
        h.base = base;
    }
    finish(setting, &mut h, 0);
    h
}

/// The set without its `index`-th effect: the others are written anew in their order and fitted from where they were.
pub fn without<'d>(
    setting: &Setting<'d>,
    none: &Hypothesis<'d>,
    set: &Hypothesis<'d>,
    index: usize,
) -> Option<Hypothesis<'d>> {
    let values = set.base.values();
    let rest: Vec<Part> = (set.effects.iter().enumerate())
        .filter(|(i, _)| *i != index)
        .map(|(_, e)| Part::of_effect(e, &values))
        .collect();
    if rest.is_empty() {
        return None;
    }
    assemble(setting, none, &values, &rest, &none.base.whitener, setting.iterations).map(|h| complete(setting, h))
}
