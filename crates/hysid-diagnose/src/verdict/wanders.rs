//! Whether a parameter wanders or oscillates where an effect of a set says that it changes once, drifts or follows a temperature.
//!
//! Each of these takes a good part of what a parameter does that never rests. Such a parameter is not of the catalogue: it is heard as a rival of each of
//! these effects, around the set without that effect. So is what depends on the place, where the recording was on either side of a level only before and
//! only after the moment of a change.

use std::collections::BTreeMap;

use super::FIRM;
use super::place::place_of_change;
use super::weigh::EVIDENCE_WEIGHT;
use crate::mechanism::Family;
use crate::model::hypothesis::{Effect, Hypothesis, best_that_says};
use crate::openset::varying::{LikelyVariation, varying};
use crate::openset::{ODDS_AGAINST_MORE, gains_by_chance, noises};
use crate::search::Search;
use crate::text::number;

/// A parameter that varies in the place of an effect.
#[derive(Debug, Clone)]
pub struct Wanders {
    /// The probability of it, beside the effect.
    pub probability: f64,
    /// A bound for the probability that something which varies gains so much by chance where nothing does.
    pub by_chance: f64,
    /// What it does, in words.
    pub words: String,
}

/// The probability that a change depends on the place where that explains it as well, or is a course of its own where it takes two to tell it: as
/// likely, and another recording is safer without it.
const AS_WELL: f64 = 0.6;
/// Below this probability nothing is said of it.
const WORTH_SAYING: f64 = 0.02;

impl Wanders {
    /// What explains a change as well, of which nothing but that is known.
    fn as_well(words: String) -> Self {
        Self { probability: AS_WELL, by_chance: 1.0, words }
    }

    /// Whether there is no doubt of it: it is firm beside the effect, and would be seen if the effect had never been thought of. An effect that was added
    /// for next to nothing is outdone by anything that varies as little.
    pub fn is_sure(&self, alpha: f64) -> bool {
        self.probability >= FIRM && self.by_chance < alpha
    }

    /// In words, beside the effect; `None` where it is too unlikely to be said.
    pub fn in_place_of(&self, e: &Effect) -> Option<String> {
        (self.probability >= WORTH_SAYING).then(|| {
            let Self { probability, words, .. } = self;
            let (id, slot) = (e.mechanism.id, &e.slot.label);
            format!("with a probability of {} it is not {id} at {slot} but {words}", number(*probability))
        })
    }
}

/// For each effect of a set that changes a parameter in time, a parameter that varies otherwise; `None` for the others, where nothing that varies is
/// seen, and where the set without the effect, and without what else changes that parameter, was not fitted.
pub fn wanders(search: &Search<'_, '_>, pool: &[Hypothesis<'_>], winner: usize) -> Vec<Option<Wanders>> {
    let best = &pool[winner];
    let kind = search.setting.noise;
    // What varies around a set, which members of one course share.
    let mut heard: BTreeMap<usize, Option<LikelyVariation>> = BTreeMap::new();
    let of = |member: usize| {
        if best.effects[member].mechanism.family != Family::TimeVariation {
            return None;
        }
        if let Some(words) = place_of_change(best, &best.effects[member]) {
            return Some(Wanders::as_well(words));
        }
        let course = |i: usize| is_one_course(best, i, member);
        // One parameter that changes in two ways at once does what it likes.
        let several = (0..best.effects.len()).filter(|&i| course(i)).count() > 1;
        let as_well = several.then(|| Wanders::as_well(own_course(&best.effects[member])));
        let Some(rest) = best_that_says(pool, &best.key_of(|i| !course(i))) else { return as_well };
        let base = &pool[rest].base;
        let found = heard.entry(rest).or_insert_with(|| varying(base, kind, &noises(base, kind)).into_iter().next());
        let Some(found) = found else { return as_well };
        // What varies has paid for the parameters among which it was found; a moment was looked for too.
        let places = search.places_of(&best.effects[member]).ln();
        let lead = best.log_evidence - pool[rest].log_evidence - places - found.gain_as_a_rival();
        let probability = 1.0 / (1.0 + (EVIDENCE_WEIGHT * lead).exp());
        let by_chance = gains_by_chance(found.gain, ODDS_AGAINST_MORE);
        let found = Wanders { probability, by_chance, words: found.what.words() };
        Some(as_well.filter(|w| w.probability > found.probability).unwrap_or(found))
    };
    (0..best.effects.len()).map(of).collect()
}

fn own_course(e: &Effect) -> String {
    format!("a course in time of its own at {}", e.slot.label)
}

/// Whether two members of a set are parts of one course in time: the same, or two that change one parameter.
pub fn is_one_course(set: &Hypothesis<'_>, one: usize, other: usize) -> bool {
    let changes = |e: &Effect| e.mechanism.family == Family::TimeVariation;
    let (a, b) = (&set.effects[one], &set.effects[other]);
    one == other || (changes(a) && changes(b) && a.slot.label == b.slot.label)
}

#[cfg(test)]
mod tests {
    use hysid_plant::Simulation;

    use super::*;
    use crate::budget::Budget;
    use crate::mechanism::SLOW;
    use crate::model::base::NoiseKind;
    use crate::model::hypothesis::calibrated;
    use crate::openset::varying::tests::{BASELINE, recorded};
    use crate::request::{Hooks, Options};

    /// The probabilities that the stiffness of an oscillator wanders, beside each of these changes of it, where it is multiplied by this function of the time.
    fn beside(changes: &[&str], factor: impl Fn(f64) -> f64) -> Vec<f64> {
        let data = recorded(6, factor, 0.02);
        let budget = Budget::new(&|_| false);
        let original = Simulation::parse(BASELINE, "test.sim.toml").unwrap();
        let (setting, none) = calibrated(original, &data, NoiseKind::Coloured, &budget);
        let search = Search::new(setting, Options::default(), &Hooks::SILENT);
        let question: Vec<_> = changes.iter().map(|id| ((*id).to_owned(), "parameter:k".to_owned())).collect();
        let changed = search.answer(&none, &question).unwrap();
        assert!(changed.log_evidence > none.log_evidence + SLOW, "{} {}", changed.log_evidence, none.log_evidence);
        let found = wanders(&search, &[none, changed], 1);
        found.iter().map(|w| w.as_ref().map_or(0.0, |w| w.probability)).collect()
    }

    #[test]
    fn a_parameter_that_wanders_is_heard_beside_one_that_changes() {
        let sure = beside(&["abrupt_change"], |t| if t > 6.0 { 1.03 } else { 1.0 })[0];
        assert!(sure < 0.02, "{sure}");
        let walk = |t: f64| 1.0 + 0.02 * ((0.31 * t).sin() + (0.17 * t).cos() * (0.53 * t).sin());
        let walk = beside(&["abrupt_change"], walk)[0];
        assert!(walk > 0.1, "{walk}");
    }

    #[test]
    fn what_varies_by_next_to_nothing_is_not_outside_the_catalogue() {
        let of = |by_chance| Wanders { probability: 0.95, by_chance, words: String::new() };
        assert!(of(1e-4).is_sure(0.01) && !of(0.02).is_sure(0.01));
        assert!(!Wanders::as_well(String::new()).is_sure(0.01));
    }

    #[test]
    fn two_changes_of_one_parameter_are_a_course_of_its_own() {
        let both =
            beside(&["abrupt_change", "parameter_drift"], |t| 1.0 + if t > 6.0 { 0.03 } else { 0.0 } - 0.003 * t);
        assert!(both.len() == 2 && both.iter().all(|p| *p >= AS_WELL), "{both:?}");
    }
}
