//! Two effects in one signal path the other way round: a play behind a lag moves later than one before it, and a curve bends what it is given.
//!
//! An effect that is looked for beside another in the same path is written before the one that was found first, since what it is added to holds that one's law.
//! Which of them the signal meets first the recording may tell, and where the order is wrong the second comes to rest far from where it belongs.

use rayon::prelude::*;

use super::assemble::{Part, SKETCH, assemble, carried_on};
use crate::budget::Step;
use crate::mechanism::Family;
use crate::model::hypothesis::{Effect, Hypothesis, Setting};
use crate::slot::Place;

/// Sets that are turned, and what they may trail the best of them by (log evidence).
const MOST: usize = 4;
const NEAR: f64 = 50.0;

/// Whether a signal meets two effects one after the other, and the one order is not as the other: it is where both laws are linear.
fn stand_in_a_row(a: &Effect, b: &Effect) -> bool {
    let path = [Place::Input, Place::Prescribed, Place::Between, Place::Command, Place::Sensor];
    let linear = |e: &Effect| {
        matches!(e.mechanism.family, Family::SignalPathLag | Family::LinearMemory | Family::ExtraMode)
            || e.mechanism.family.is_slow_noise()
    };
    path.contains(&a.slot.place) && a.slot.is_at(&b.slot) && !(linear(a) && linear(b))
}

/// The likeliest of these sets with the effect that came last before those with which it stands in a row, from where it is and from where it came to rest alone.
pub fn turned<'d>(
    setting: &Setting<'d>,
    none: &Hypothesis<'d>,
    found: &[Hypothesis<'d>],
    pool: &[Hypothesis<'d>],
) -> Vec<Hypothesis<'d>> {
    let place = |h: &Hypothesis<'_>| {
        let (last, others) = h.effects.split_last()?;
        others.iter().position(|e| stand_in_a_row(e, last))
    };
    let mut sets: Vec<(usize, &Hypothesis<'d>)> = found.iter().filter_map(|h| Some((place(h)?, h))).collect();
    sets.sort_by(|(_, a), (_, b)| b.log_evidence.total_cmp(&a.log_evidence));
    let near = found.iter().map(|h| h.log_evidence).fold(f64::NEG_INFINITY, f64::max) - NEAR;
    sets.retain(|(_, h)| h.log_evidence > near);
    sets.truncate(MOST);
    let turn = |(before, set): (usize, &Hypothesis<'d>)| {
        if setting.budget.omits(Step::Composition) {
            return None;
        }
        let values = set.base.values();
        let (last, others) = set.effects.split_last()?;
        let alone = pool
            .iter()
            .find(|h| matches!(&h.effects[..], [e] if e.mechanism.id == last.mechanism.id && e.slot.is_at(&last.slot)));
        let begun = |first: Part| {
            let mut parts: Vec<Part> = others.iter().map(|e| Part::of_effect(e, &values)).collect();
            parts.insert(before, first);
            assemble(setting, none, &values, &parts, &set.base.whitener, SKETCH)
        };
        let there = begun(Part::of_effect(last, &values));
        let alone = alone.and_then(|h| begun(Part::of_effect(&h.effects[0], &h.base.values())));
        carried_on(setting, there.into_iter().chain(alone), set)
    };
    sets.into_par_iter().filter_map(turn).collect()
}

#[cfg(test)]
mod tests {
    use hysid_plant::Simulation;

    use super::*;
    use crate::budget::Budget;
    use crate::model::base::NoiseKind;
    use crate::model::hypothesis::{calibrated, lacking_a_law};
    use crate::oscillator::normal;
    use crate::request::{Hooks, Options, Question};
    use crate::search::Search;

    const BOAT: &str = "[time]\nperiod_s = 0.1\n[inputs]\nd = \"rudder_deg\"\n[parameters]\nK = { value = 1.0, min = 0.3, max = 2.0, unit = \"1/s\" }\n\
                        T = { value = 2.0, min = 0.7, max = 6.0, unit = \"s\" }\n[states]\nr = { derivative = \"(K*d - r)/T\", initial = 0.0, unit = \"deg/s\" }\n\
                        [outputs]\nyaw_deg_s = \"r\"\n";

    /// What this set, found in its order, gains by being turned, and the half width of its play then; `None` where it is not turned.
    fn gained(rudder: &str, set: [&str; 2]) -> Option<(f64, Option<f64>)> {
        let original = Simulation::parse(BOAT, "boat.sim.toml").unwrap();
        let mut random = normal(5);
        let steps: Vec<f64> = (0..60).map(|_| 6.0 * random()).collect();
        let d: Vec<f64> = (0..1200).map(|n| steps[n / 20]).collect();
        let law = format!("(K*{rudder} - r)/T");
        let data = lacking_a_law(&original, ("r", &law), 0.1, ("rudder_deg", d), (0.02, &mut random));
        let budget = Budget::new(&|_| false);
        let (setting, none) = calibrated(original, &data, NoiseKind::White(1.0), &budget);
        let search = Search::new(setting.clone(), Options::default(), &Hooks::SILENT);
        let ask = |ids: &[&str]| -> Hypothesis<'_> {
            let question: Question = ids.iter().map(|id| ((*id).to_owned(), "input:d".to_owned())).collect();
            search.answer(&none, &question).unwrap()
        };
        let found = [ask(&set)];
        let turned = turned(&setting, &none, &found, &[ask(&set[1..])]).pop()?;
        assert_eq!(turned.key(), found[0].key(), "the statement is the same");
        let play = turned.effects.iter().find(|e| e.mechanism.id == "backlash");
        let values = turned.base.values().parameters;
        let width = play.and_then(|e| values.get(&e.written.shapes[0].name).copied());
        Some((turned.log_evidence - found[0].log_evidence, width))
    }

    #[test]
    fn a_play_behind_a_lag_is_told_from_one_before_it() {
        let (gain, width) = gained("play(lag(d, 0.35), 1.6)", ["actuator_lag", "backlash"]).unwrap();
        assert!(gain > 20.0 && width.is_some_and(|w| (w / 1.6 - 1.0).abs() < 0.05), "{gain} {width:?}");
        let (gain, _) = gained("lag(play(d, 1.6), 0.35)", ["actuator_lag", "backlash"]).unwrap();
        assert!(gain < -20.0, "{gain}");
        assert_eq!(gained("lag(delay(d, 0.4), 0.35)", ["actuator_lag", "delay"]), None, "one is as the other");
    }
}
