//! The forms of a law: a smooth series, more terms of it, terms whose places are fitted, a start of its own.
//!
//! A hysteresis made of plays is a sum over as many as one likes. Three weights follow a loop that noise blurs; a density of two parameters
//! follows a smooth one at a lower price and beyond what the recording reached; six weights follow one that stands far above the noise, where
//! what three leave would pass for another effect. The evidence decides, so that no recording pays for terms that it cannot tell.

use rayon::prelude::*;

use super::assemble::{Part, assemble};
use super::finish::finish;
use super::given_up::HOPELESS;
use super::screen::rewrite_at;
use crate::budget::Step;
use crate::mechanism::{Form, Law, Mechanism, Purpose, Role};
use crate::model::Values;
use crate::model::hypothesis::{Effect, Hypothesis, Setting};

/// Log evidence that an effect must have brought before a form with more unknowns is tried.
const WORTH_REFINING: f64 = 10.0;
/// Log evidence that an effect may lack where a form has no more unknowns than it has now.
const WORTH_RECASTING: f64 = -5.0;
/// Log evidence that it may lack besides for each unknown that the form has less.
const UNKNOWN: f64 = 8.0;
/// Log evidence that makes an effect plain to see.
const PLAIN_TO_SEE: f64 = 100.0;
/// Log evidence within which two forms are one.
const INDIFFERENT: f64 = 0.1;
/// Log evidence within which two forms tie.
const TIE: f64 = 3.0;
/// Log likelihood by which one that ties must lead to be taken.
const LESS_LEFT: f64 = 1.0;
/// Iterations of a fit that tells from which start a form is fitted.
const SKETCH: usize = 3;
/// Most starts of a form.
const MOST_STARTS: usize = 4;

/// The hypothesis with the law of its `index`-th effect in another form, if one is better.
///
/// `trunk` is a hypothesis of the first effects of this one, before that effect; those that follow are written into it anew.
pub fn finer<'d>(
    setting: &Setting<'d>,
    trunk: &Hypothesis<'_>,
    h: &Hypothesis<'d>,
    index: usize,
) -> Option<Hypothesis<'d>> {
    let effect = h.effects.get(index)?;
    let present = effect.mechanism.law_at(&effect.slot, effect.written.purpose);
    let now = unknowns(&present);
    let in_form = |(purpose, law): (Purpose, Law)| {
        let own = unknowns(&law);
        let worth = match purpose {
            Purpose::Form(Form::FinerUnsettled) => PLAIN_TO_SEE,
            _ if own > now => WORTH_REFINING,
            _ => WORTH_RECASTING - UNKNOWN * (now - own) as f64,
        };
        let tried = purpose != effect.written.purpose && h.log_evidence >= trunk.log_evidence + worth;
        if !tried || setting.budget.omits(Step::Fits) {
            return None;
        }
        written_as(setting, trunk, h, index, &present, (purpose, &law))
    };
    let mut forms: Vec<Hypothesis<'d>> =
        effect.mechanism.forms(&effect.slot).into_par_iter().filter_map(in_form).collect();
    let merits: Vec<(f64, f64)> =
        std::iter::once(h).chain(&forms).map(|f| (f.log_evidence, f.base.log_likelihood)).collect();
    // In the list of merits the present form is the first.
    let plain_form = forms.iter().position(|f| f.effects[index].written.purpose == Purpose::Refit).map(|i| i + 1);
    // A second stop that noise puts where few samples come would be no closer look, but a limit where there is none.
    let closer = h.log_evidence - trunk.log_evidence > PLAIN_TO_SEE && !effect.is_a_limit();
    let chosen = preferred(&merits, plain_form, closer)?;
    chosen.checked_sub(1).map(|i| forms.swap_remove(i))
}

/// The form to be taken, of their evidences and log likelihoods, the present one first, the law's plain one at a place: the one with the most evidence. Where a `closer`
/// look is wanted, at an effect that is plain to see, of those that tie the one that leaves the least, if it leaves less indeed: they say the same, and what a smooth curve leaves of an angular one would
/// pass for another effect.
fn preferred(merits: &[(f64, f64)], plain_form: Option<usize>, closer: bool) -> Option<usize> {
    let most = (0..merits.len()).max_by(|&a, &b| merits[a].0.total_cmp(&merits[b].0))?;
    // The plain law where nothing speaks against it (a limit alike on both sides of which one was never reached), and else what is there already.
    let as_good = |i: &usize| merits[*i].0 > merits[most].0 - INDIFFERENT;
    let top = plain_form.into_iter().chain([0]).find(as_good).unwrap_or(most);
    let (evidence, likelihood) = merits[top];
    let leaves_less = |i: &usize| merits[*i].0 >= evidence - TIE && merits[*i].1 > likelihood + LESS_LEFT;
    let closest = (0..merits.len()).filter(|i| closer && leaves_less(i));
    closest.max_by(|&a, &b| merits[a].1.total_cmp(&merits[b].1)).or(Some(top))
}

/// What a law asks of the recording.
fn unknowns(law: &Law) -> usize {
    law.parameters.iter().filter(|p| !matches!(p.role, Role::Constant(_))).count()
}

/// The hypothesis with the law of its `index`-th effect in this form.
fn written_as<'d>(
    setting: &Setting<'d>,
    trunk: &Hypothesis<'_>,
    h: &Hypothesis<'d>,
    index: usize,
    present: &Law,
    (purpose, law): (Purpose, &Law),
) -> Option<Hypothesis<'d>> {
    let first = trunk.effects.len();
    let values = h.base.values();
    let effect = &h.effects[index];
    let (slot, mechanism) = (&effect.slot, effect.mechanism);
    let (written, _) = rewrite_at(&trunk.base, &trunk.base.document(), &setting.original, mechanism, slot, purpose)?;
    let old = named(present, effect, &values);
    let names = Names::of(law);
    // What the present form says too is kept; the rest starts at the points of its grid. A lower limit by itself is counted otherwise than the others.
    let mirrored = effect.is_a_limit() && effect.written.purpose == Purpose::Form(Form::Few);
    let kept = |name: &String| old.1.iter().find(|(n, _)| n == name && !mirrored).map(|(_, value)| *value);
    let mut starts: Vec<Vec<Option<f64>>> = Vec::new();
    for point in written.starts() {
        let shapes = names.shapes.iter().zip(point).map(|(name, (_, value))| kept(name).or(Some(value)));
        let start: Vec<Option<f64>> = spread(&old.0, &names.amplitudes).into_iter().chain(shapes).collect();
        if !starts.contains(&start) {
            starts.push(start);
        }
    }
    let every = starts.len().div_ceil(MOST_STARTS).max(1);
    let starts: Vec<_> = starts.into_iter().step_by(every).collect();
    let begun = starts.into_par_iter().filter_map(|start| {
        let mut parts: Vec<Part> = h.effects[first..].iter().map(|e| Part::of_effect(e, &values)).collect();
        parts[index - first] = Part { purpose, values: start, ..Part::of_effect(effect, &values) };
        assemble(setting, trunk, &values, &parts, &h.base.whitener, SKETCH)
    });
    let best = begun.max_by(|a, b| a.base.log_likelihood.total_cmp(&b.base.log_likelihood));
    let mut best = best.filter(|b| b.log_evidence > h.log_evidence - HOPELESS)?;
    if let Some(base) = setting.further(&best.base, Some(&h.base.whitener), 1, setting.iterations) {
        best.base = base;
    }
    finish(setting, &mut best, first);
    Some(best)
}

/// Start values for a law in the place of an effect, in the order of the law: what both name alike as the effect has it, further amplitudes at zero,
/// further shapes as in `own`, values in the same order; where the mechanism contains that of the effect they are alike in order (the time constant of a lag
/// is that of a winding). A friction that turns out to be unequal begins at the size that it has as an equal one.
pub fn inherited(
    (mechanism, law): (&Mechanism, &Law),
    own: &[Option<f64>],
    effect: &Effect,
    values: &Values,
) -> Vec<Option<f64>> {
    let present = effect.mechanism.law_at(&effect.slot, effect.written.purpose);
    let (amplitudes, shapes) = named(&present, effect, values);
    let names = Names::of(law);
    let alike = |list: &[Named], name: &String| list.iter().find(|(n, _)| n == name).map(|(_, value)| *value);
    let further = own.iter().skip(names.amplitudes.len());
    let first = names.amplitudes.iter().map(|name| Some(alike(&amplitudes, name).unwrap_or(0.0)));
    let in_order = |at: usize| {
        shapes.get(at).filter(|_| mechanism.contains.contains(&effect.mechanism.id)).map(|(_, value)| *value)
    };
    let others = names.shapes.iter().zip(further).enumerate();
    first.chain(others.map(|(at, (name, own))| alike(&shapes, name).or(in_order(at)).or(*own))).collect()
}

/// The names that a law has for what is fitted.
struct Names {
    amplitudes: Vec<String>,
    shapes: Vec<String>,
}

impl Names {
    fn of(law: &Law) -> Self {
        let of_role = |wanted: fn(&Role) -> bool| -> Vec<String> {
            law.parameters.iter().filter(|p| wanted(&p.role)).map(|p| p.name.clone()).collect()
        };
        Self { amplitudes: of_role(|r| matches!(r, Role::Amplitude)), shapes: of_role(|r| matches!(r, Role::Shape(_))) }
    }
}

/// A value under the name that the law has for it.
type Named = (String, f64);

/// The amplitudes and the shapes of an effect that was fitted.
fn named(law: &Law, effect: &Effect, values: &Values) -> (Vec<Named>, Vec<Named>) {
    let names = Names::of(law);
    let value = |name: &String| values.parameters.get(name).copied().unwrap_or(0.0);
    let amplitudes = names.amplitudes.into_iter().zip(effect.written.amplitudes.iter().map(|a| value(&a.name)));
    let shapes = names.shapes.into_iter().zip(effect.written.shapes.iter().map(|s| value(&s.name)));
    (amplitudes.collect(), shapes.collect())
}

/// Start values for another series of terms: each of the old ones over as many terms as stand in its place, or the sum of those in whose place
/// one stands.
fn spread(old: &[Named], new: &[String]) -> Vec<Option<f64>> {
    let series = |name: &str| name.split('_').next().unwrap_or(name).to_owned();
    let one = |name: &String| {
        let few: Vec<f64> = old.iter().filter(|(n, _)| series(n) == series(name)).map(|(_, value)| *value).collect();
        let many: Vec<&String> = new.iter().filter(|n| series(n) == series(name)).collect();
        let place = many.iter().position(|n| *n == name)?;
        // Both cut the same whole into equal shares: what of each old share lies within the new one.
        let (from, to) = (place as f64 / many.len() as f64, (place + 1) as f64 / many.len() as f64);
        let share = |i: usize| {
            let (a, b) = (i as f64 / few.len() as f64, (i + 1) as f64 / few.len() as f64);
            (b.min(to) - a.max(from)).max(0.0) * few.len() as f64
        };
        (!few.is_empty()).then(|| few.iter().enumerate().map(|(i, value)| value * share(i)).sum())
    };
    new.iter().map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mechanism::conformance::{example_signals, specimens};
    use crate::mechanism::mechanism;
    use crate::slot::Structure;

    #[test]
    fn of_forms_that_tie_the_one_that_leaves_the_least_is_taken() {
        let check =
            |merits: &[(f64, f64)], closer, expected| assert_eq!(preferred(merits, None, closer), Some(expected));
        // Evidence and log likelihood of three plays, a density and six plays.
        let near = [(300.0, 315.0), (345.8, 357.0), (345.2, 371.0)];
        check(&near, true, 2);
        check(&near, false, 1);
        check(&[(300.0, 315.0), (345.8, 357.0), (341.0, 371.0)], true, 1);
        check(&[(8.0, 15.0), (7.9, 15.5)], false, 0);
        // A limit on one side, and the plain one of which the other was never reached.
        assert_eq!(preferred(&[(57.4, 61.0), (57.39, 61.0)], Some(1), false), Some(1));
        assert_eq!(preferred(&[(57.4, 61.0), (50.0, 54.0)], Some(1), false), Some(0));
        // A term that brings nothing.
        check(&[(183.5, 188.40), (186.0, 188.39)], true, 1);
    }

    #[test]
    fn a_law_in_the_place_of_another_begins_where_that_stands() {
        let simulation = specimens().swap_remove(0);
        let coulomb = mechanism("coulomb_friction").unwrap();
        let slot = coulomb.slots(&Structure::of(&simulation)).remove(0);
        let signals = example_signals(&simulation, &slot);
        let written = coulomb.rewrite(&simulation, &slot, &signals, Purpose::Refit).unwrap();
        let mut values = Values::default();
        values.parameters.insert(written.amplitudes[0].name.clone(), 3.5);
        let effect = Effect { mechanism: coulomb, slot: slot.clone(), written, concealment: None };
        let begun = |id: &str, own: &[Option<f64>]| {
            let mechanism = mechanism(id).unwrap();
            inherited((mechanism, &mechanism.law_at(&slot, Purpose::Refit)), own, &effect, &values)
        };
        assert_eq!(begun("asymmetric_friction", &[Some(9.0), Some(8.0)]), [Some(3.5), Some(0.0)]);
        assert_eq!(begun("stribeck_friction", &[Some(9.0), Some(8.0), Some(0.2)]), [Some(3.5), Some(0.0), Some(0.2)]);
    }

    #[test]
    fn a_winding_begins_with_the_time_constant_of_the_lag_that_it_contains() {
        let [lag, winding] = ["actuator_lag", "back_emf"].map(|id| mechanism(id).unwrap());
        let places = specimens().into_iter().find_map(|simulation| {
            let structure = Structure::of(&simulation);
            let at = lag.slots(&structure).into_iter().next()?;
            let there = winding.slots(&structure).into_iter().find(|s| s.label == at.label)?;
            Some((simulation, at, there))
        });
        let (simulation, slot, there) = places.unwrap();
        let signals = example_signals(&simulation, &slot);
        let written = lag.rewrite(&simulation, &slot, &signals, Purpose::Refit).unwrap();
        let mut values = Values::default();
        values.parameters.insert(written.shapes[0].name.clone(), 0.02);
        let effect = Effect { mechanism: lag, slot, written, concealment: None };
        let law = winding.law_at(&there, Purpose::Refit);
        let own = [Some(9.0), Some(8.0)];
        assert_eq!(inherited((winding, &law), &own, &effect, &values), [Some(0.0), Some(0.02)]);
        // The lag of a sensor does not contain that of an actuator.
        let other = mechanism("sensor_lag").unwrap();
        assert_eq!(inherited((other, &law), &own, &effect, &values), [Some(0.0), Some(8.0)]);
    }

    #[test]
    fn weights_are_spread_over_the_terms_in_their_place() {
        let check = |old: &[(&str, f64)], new: &[&str], expected: &[Option<f64>]| {
            let old: Vec<Named> = old.iter().map(|(n, v)| ((*n).to_owned(), *v)).collect();
            let new: Vec<String> = new.iter().map(|n| (*n).to_owned()).collect();
            let found = spread(&old, &new);
            assert_eq!(found.len(), expected.len());
            for (f, e) in found.iter().zip(expected) {
                let near = match (f, e) {
                    (Some(f), Some(e)) => (f - e).abs() < 1e-12,
                    (f, e) => f == e,
                };
                assert!(near, "{old:?} as {new:?}: {found:?}");
            }
        };
        let old = [("p_1", 0.2), ("p_2", 0.4), ("a_h", 0.7)];
        let more = [Some(0.1), Some(0.1), Some(0.2), Some(0.2), Some(0.7), None];
        check(&old, &["p_1", "p_2", "p_3", "p_4", "a_h", "q_1"], &more);
        check(&old, &["p", "a_h"], &[Some(0.6), Some(0.7)]);
        check(&old, &["p_1", "p_2", "p_3"], &[Some(0.2 * 2.0 / 3.0), Some(0.2), Some(0.4 * 2.0 / 3.0)]);
    }
}
