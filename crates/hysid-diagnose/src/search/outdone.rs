//! Whether what composition has reached is outdone by generic terms: where these explain far more, no further effect of the catalogue makes up for it, and
//! looking for one takes most of the time.

use super::{Search, fitted_key, held};
use crate::budget::Step;
use crate::model::hypothesis::Hypothesis;
use crate::openset::needed::{Refitted, likelier};
use crate::openset::{ODDS_AGAINST_MORE, OpenSet};

/// Share of what generic terms explain (log evidence) below which a single effect is given up, and a set of several. Of 31 pairs and triples of development seed 697
/// such terms left nothing in seven; there the best set had 0.37 of it or more before pairs were composed, and 0.78 or more before the third effect.
const SINGLE: f64 = 0.2;
const SEVERAL: f64 = 0.5;
/// Part of these shares where the terms leave something: in the other 24 the best set had 0.6 of what they explain or more.
const IN_PART: f64 = 0.5;
/// Share of what the simulation without effects leaves, noise and all, below which a set is no imitation, whatever generic terms add: of a recording that is a
/// thousand times louder than its noise no law takes all (Silverbox: a cubic spring and a quadratic one leave a twentieth, in which terms find half as
/// much evidence again).
const HARDLY_ANY: f64 = 0.1;

/// Whether a set leaves so much of what the simulation without effects leaves that it may be an imitation of a law that the catalogue does not have.
pub fn may_imitate(none: &Hypothesis<'_>, set: &Hypothesis<'_>) -> bool {
    set.base.unexplained() > HARDLY_ANY.powi(2) * none.base.unexplained()
}

impl<'d> Search<'_, 'd> {
    /// Whether generic terms in the equations of the simulation without effects explain far more than the best set and leave nothing, or explain still more;
    /// `false` where there is no time left to see.
    pub fn is_outdone(&self, none: &Hypothesis<'d>, best: &Hypothesis<'d>) -> bool {
        let explained = best.log_evidence - none.log_evidence;
        let share = if best.effects.len() > 1 { SEVERAL } else { SINGLE };
        let beyond = |share: f64, gain: f64| explained < share * gain;
        let told = |o: &OpenSet| beyond(share, o.gain) && o.by_chance(ODDS_AGAINST_MORE) < self.options.alpha;
        if !may_imitate(none, best) {
            return false;
        }
        let Some(open) = self.open(none).filter(told) else { return false };
        let refitted = || {
            let late = self.setting.budget.omits(Step::Imitation);
            if late { None } else { likelier(&self.setting, none, &open, f64::NEG_INFINITY) }
        };
        let Some(found) = self.known_correction(none).or_else(refitted) else { return false };
        let gain = found.hypothesis.log_evidence - none.log_evidence - found.of.choice;
        let whole = || beyond(share, gain) && !self.is_unexplained(&found.hypothesis);
        let outdone = beyond(IN_PART * share, gain) || whole();
        *held(&self.corrected) = Some((fitted_key(none), found));
        outdone
    }

    /// Generic terms of the simulation without effects, refitted in its equations; further ones are looked for where these reach the `least` log evidence.
    pub fn corrected(&self, none: &Hypothesis<'d>, open: &OpenSet, least: f64) -> Option<Refitted<'d>> {
        self.known_correction(none).or_else(|| likelier(&self.setting, none, open, least))
    }

    /// The same where composition has asked for it.
    fn known_correction(&self, none: &Hypothesis<'d>) -> Option<Refitted<'d>> {
        held(&self.corrected).take_if(|(key, _)| *key == fitted_key(none)).map(|(_, found)| found)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicBool, Ordering};

    use hysid_plant::Simulation;

    use super::*;
    use crate::budget::Budget;
    use crate::model::base::NoiseKind;
    use crate::model::hypothesis::{calibrated, recorded};
    use crate::oscillator::{BASELINE, PERIOD, REAL, drive, normal, respond, rms};
    use crate::request::{Hooks, Options};

    /// Whether each of these effects is outdone where an oscillator has this force, and whether it is when no time is left.
    fn outdone(force: impl Fn(f64, f64) -> f64, effects: [&str; 2]) -> [(bool, bool); 2] {
        let mut random = normal(8);
        let u = drive(1500, &mut random);
        let mut y = respond(&u, REAL, force);
        let noise = 0.005 * rms(&y);
        y.iter_mut().for_each(|y| *y += noise * random());
        let original = Simulation::parse(BASELINE, "test.sim.toml").unwrap();
        let data = recorded(&original, PERIOD, [("u_N", u), ("x_m", y)]);
        let late = AtomicBool::new(false);
        let expired = |_: f64| late.load(Ordering::Relaxed);
        let budget = Budget::new(&expired);
        let (setting, none) = calibrated(original, &data, NoiseKind::White(1.0), &budget);
        effects.map(|id| {
            let search = || Search::new(setting.clone(), Options::default(), &Hooks::SILENT);
            late.store(false, Ordering::Relaxed);
            let asked = search();
            let set = asked.answer(&none, &vec![(id.to_owned(), "state:v".to_owned())]).unwrap();
            let in_time = asked.is_outdone(&none, &set);
            late.store(true, Ordering::Relaxed);
            // What was refitted in time is known.
            assert_eq!(asked.is_outdone(&none, &set), in_time, "{id}");
            (in_time, search().is_outdone(&none, &set))
        })
    }

    #[test]
    fn an_imitation_is_outdone_and_a_law_of_the_catalogue_is_not() {
        // A stiffness that grows with the size of the speed is none of the catalogue.
        let [dry, quadratic] = outdone(|x, v| 6.0 * x * v.abs(), ["coulomb_friction", "quadratic_damping"]);
        assert_eq!([dry, quadratic], [(true, false), (true, false)]);
        let [law, other] = outdone(|x, _| 9.0 * x * x * x, ["cubic_stiffness", "coulomb_friction"]);
        assert_eq!((law, other.1), ((false, false), false), "{other:?}");
    }
}
