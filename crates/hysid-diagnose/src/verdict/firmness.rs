//! How firmly the members of the winning set are named: their support among all sets that were fitted, less what speaks against trusting it.

use super::weigh::{EVIDENCE_WEIGHT, IMPERFECT_WEIGHT, bounded, log_weights, stretched};
use super::{Hypothesis as Weighed, NOT_FIRM, Support, probabilities, supports};
use crate::mechanism::{Family, catalogue};
use crate::model::base::Base;
use crate::model::hypothesis::{Effect, Hypothesis, OnBlocks, best_that_says};
use crate::slot::Structure;

/// Log likelihood by which a set must trail before the recording refutes it.
const REFUTED: f64 = 4.0;
/// The same between shifts in time that pass between samples: whether a winding starts with its current or without it shows in all of a
/// motion that is integrated, and no law tells how a recording began.
const REFUTED_BUT_FOR_THE_START: f64 = 60.0;

/// Probabilities of the sets of a pool.
pub fn likelihoods(
    pool: &[Hypothesis<'_>],
    weighed: &[Weighed],
    blocks: &[Option<OnBlocks>],
    winner: usize,
    imperfect: bool,
) -> Vec<f64> {
    let weight = if imperfect { IMPERFECT_WEIGHT } else { EVIDENCE_WEIGHT };
    probabilities(&log_weights(pool, weighed, blocks, winner, weight), 1.0)
}

/// The support of each member of the winning set, never firm where something shows that the set is not the whole truth.
pub fn firmness(
    pool: &[Hypothesis<'_>],
    weighed: &[Weighed],
    probability: &[f64],
    winner: usize,
    imperfect: bool,
) -> Vec<Support> {
    let best = &pool[winner];
    let claims = &weighed[winner].claims;
    let mut support = supports(claims, weighed, probability);
    // A set that leaves something significant may stand in for something else; what is still far from the recording is not understood,
    // whatever was gained; and three members imitate almost anything: on development cases such sets were wrong more often than right.
    let doubtful = imperfect || best.base.far() || claims.len() > 2;
    let plays: Vec<&Effect> = best.effects.iter().filter(|o| o.mechanism.family.members_imitate()).collect();
    for (i, (e, s)) in best.effects.iter().zip(&mut support).enumerate() {
        // Two members of one family in one set: something of that kind, but neither of them as it stands.
        let twice = claims.iter().enumerate().any(|(j, c)| i != j && c.family == claims[i].family);
        let own = e.mechanism.family;
        // A fractional element is a relaxation and a mode within the band that was excited.
        let of_a_spectrum =
            own.extends_a_spectrum() && best.effects.iter().any(|o| o.mechanism.family == Family::LinearMemory);
        let beside = |id: &str| e.mechanism.id != id && best.effects.iter().any(|o| o.mechanism.id == id);
        let of_turned_noise = own.adds_what_noise_does() && beside("rectified_output");
        // What rounding leaves is neither white nor normal: a change by 0.12 % was firm beside it (report of seed 2383, 0010).
        let of_rounding = beside("quantisation");
        // A sum of plays beside a law that explains nearly all follows what the form of that law leaves, as well as a play that is there.
        let of_plays = !plays.is_empty() && best.effects.len() > 1 && brings_little(pool, winner, i);
        // A loop with unequal sides is a sum of plays and a curve: a curve at the same signal may be what another law of such loops has in one.
        let of_a_loop = own == Family::InputNonlinearity && plays.iter().any(|o| o.slot.label == e.slot.label);
        // Plays of an input that is counted from elsewhere are those of the input and a constant: about what a loop is centred belongs to its law.
        let of_its_middle = own == Family::Bias && !plays.is_empty();
        let vague = own.stands_for_others()
            || of_plays
            || of_a_loop
            || of_its_middle
            || of_turned_noise
            || of_rounding
            || of_a_spectrum
            || is_turned_round(&best.base, e)
            || stretched(&best.base, e)
            || has_twin(pool, winner, i);
        if doubtful || twice || vague {
            s.weaken();
        }
        let bounded = bounded(&best.base, e);
        if bounded && is_alone(own) {
            s.weaken();
        }
        if bounded || e.mechanism.family.members_imitate() || e.written.sum_of_others {
            s.mechanism = s.mechanism.min(NOT_FIRM);
        }
    }
    support
}

/// Share of the likelihood that a set gains below which a member may make up for what a sum of plays leaves of the loop.
const LITTLE: f64 = 0.1;

/// The log likelihood that a set gains over the simulation as it is, which comes first in a pool.
fn gained(pool: &[Hypothesis<'_>], h: &Hypothesis<'_>) -> f64 {
    h.base.log_likelihood - pool[0].base.log_likelihood
}

/// Whether a set gains most of its likelihood without a member: where the rest is a sum of a few plays, that is what their number leaves (a resonance
/// was firm beside plays whose thresholds grow with the rate by another law).
fn brings_little(pool: &[Hypothesis<'_>], winner: usize, member: usize) -> bool {
    let best = &pool[winner];
    best_that_says(pool, &best.key_without(member))
        .is_some_and(|rest| gained(pool, &pool[rest]) > (1.0 - LITTLE) * gained(pool, best))
}

/// Whether a family has one member only: no sibling can be meant where that does not fit.
fn is_alone(family: Family) -> bool {
    catalogue().iter().filter(|m| m.family == family).count() == 1
}

/// Whether a set is a sum of relaxations: two members with a linear memory, or one beside a mode at the same slot. One relaxation is an element; two in
/// one recording are what a memory with many time scales looks like (a fractional element), and the catalogue has no law of that kind.
pub fn is_a_spectrum(h: &Hypothesis<'_>) -> bool {
    let memories = h.effects.iter().enumerate().filter(|(_, e)| e.mechanism.family == Family::LinearMemory);
    memories.into_iter().any(|(i, memory)| {
        h.effects.iter().enumerate().any(|(j, other)| {
            let more = match other.mechanism.family {
                Family::LinearMemory => true,
                Family::ExtraMode => other.slot.label == memory.slot.label,
                _ => false,
            };
            i != j && more
        })
    })
}

/// Whether a set with a member of the twin family in this member's place follows the recording as well, or was never fitted although the simulation has a
/// place for one. That it needs a parameter more makes it less likely, but refutes nothing: what is named firmly must be what the recording demands.
fn has_twin(pool: &[Hypothesis<'_>], winner: usize, member: usize) -> bool {
    let best = &pool[winner];
    let Some(twin) = best.effects[member].mechanism.family.twin() else { return false };
    let rest = best.key_without(member);
    let refuted = if passes_between_samples(best, member) {
        REFUTED_BUT_FOR_THE_START
    } else if is_a_loop_without_a_spring(best, member) {
        REFUTED.max(LITTLE * gained(pool, best))
    } else {
        REFUTED
    };
    let in_its_place = |h: &&Hypothesis<'_>| {
        let of_twin = h.effects.iter().position(|e| e.mechanism.family == twin);
        h.effects.len() == best.effects.len() && of_twin.is_some_and(|place| h.key_without(place) == rest)
    };
    let nearest = pool.iter().filter(in_its_place).map(|h| h.base.log_likelihood).max_by(f64::total_cmp);
    match nearest {
        Some(nearest) => nearest > best.base.log_likelihood - refuted,
        None => can_stand(&pool[0], twin),
    }
}

/// Whether a member of a family has a slot in the simulation as it is.
fn can_stand(none: &Hypothesis<'_>, family: Family) -> bool {
    let structure = Structure::of(&none.base.document());
    catalogue().iter().any(|m| m.family == family && !m.slots(&structure).is_empty())
}

/// Whether a member is a loop on a part that no spring of the simulation holds, as a drive: a hysteretic spring and a friction that gives way elastically
/// are one thing there, and which law says it a little better tells no name (a LuGre friction was told as a Bouc-Wen loop, firm, 20 of 330 nats ahead:
/// report of seed 2417, 0011).
fn is_a_loop_without_a_spring(h: &Hypothesis<'_>, member: usize) -> bool {
    let effect = &h.effects[member];
    matches!(effect.mechanism.family, Family::HystereticSpring | Family::Presliding) && !effect.slot.has("k")
}

/// Whether a member is a Stribeck friction that is smaller at rest than when sliding. That is none, and stands for what rises with the speed and levels off
/// (the drag of an eddy-current brake was told so with 100 %).
fn is_turned_round(base: &Base<'_>, effect: &Effect) -> bool {
    let falls = effect.written.amplitudes.last().and_then(|a| base.model.place_of(&a.name));
    effect.mechanism.id == "stribeck_friction" && falls.is_some_and(|place| base.fit.theta[place] < 0.0)
}

/// Whether a member is a lag shorter than a sample: its transient passes between the samples, where a delay, a lag of a sensor and that of a
/// winding are all the same shift in time, and what is left to tell them apart is how the recording began.
fn passes_between_samples(h: &Hypothesis<'_>, member: usize) -> bool {
    let effect = &h.effects[member];
    let values = h.base.values();
    effect.mechanism.family == Family::SignalPathLag
        && (effect.written.shapes.iter().filter_map(|shape| values.parameters.get(&shape.name)))
            .all(|tau| *tau < h.base.model.data().period_s)
}

#[cfg(test)]
mod tests {
    use hysid_plant::Simulation;

    use super::*;
    use crate::budget::Budget;
    use crate::model::base::NoiseKind;
    use crate::model::hypothesis::{calibrated, recorded};
    use crate::oscillator::{BASELINE, PERIOD, REAL, drive, normal, respond};
    use crate::request::{Hooks, Options};
    use crate::search::Search;

    /// Whether a lag at the input stands for a winding, where these sets besides were fitted to a recording of an oscillator that lags.
    fn stands_for_a_winding(text: &str, output: &str, besides: &[&str]) -> bool {
        let mut random = normal(5);
        let mut u = drive(600, &mut random);
        let y = respond(&u, REAL, |_, _| 0.0);
        // The input is recorded four samples early.
        u.rotate_left(4);
        let original = Simulation::parse(text, "test.sim.toml").unwrap();
        let data = recorded(&original, PERIOD, [("u_N", u), (output, y)]);
        let budget = Budget::new(&|_| false);
        let (setting, none) = calibrated(original, &data, NoiseKind::White(1.0), &budget);
        let search = Search::new(setting, Options::default(), &Hooks::SILENT);
        let sets = std::iter::once("delay").chain(besides.iter().copied());
        let sets: Vec<Hypothesis<'_>> =
            sets.filter_map(|id| search.answer(&none, &vec![(id.to_owned(), "input:u".to_owned())])).collect();
        let pool: Vec<Hypothesis<'_>> = std::iter::once(none).chain(sets).collect();
        assert_eq!(pool.len(), 2 + besides.len());
        has_twin(&pool, 1, 0)
    }

    #[test]
    fn a_friction_that_is_smaller_at_rest_is_not_firm() {
        let original = Simulation::parse(BASELINE, "test.sim.toml").unwrap();
        let u = drive(600, &mut normal(11));
        let y = respond(&u, REAL, |_, v| 4.0 * v.signum());
        let data = recorded(&original, PERIOD, [("u_N", u), ("x_m", y)]);
        let budget = Budget::new(&|_| false);
        let (setting, none) = calibrated(original, &data, NoiseKind::White(1.0), &budget);
        let search = Search::new(setting, Options::default(), &Hooks::SILENT);
        let told = |id: &str, falls: f64| {
            let set = search.answer(&none, &vec![(id.to_owned(), "state:v".to_owned())]).unwrap();
            let Hypothesis { mut base, effects, .. } = set;
            let last = base.model.place_of(&effects[0].written.amplitudes.last().unwrap().name).unwrap();
            base.fit.theta[last] = falls;
            is_turned_round(&base, &effects[0])
        };
        assert!(told("stribeck_friction", -0.5) && !told("stribeck_friction", 0.5));
        assert!(!told("cubic_stiffness", -0.5), "a spring may soften");
    }

    #[test]
    fn a_twin_that_was_never_fitted_refutes_nothing() {
        assert!(stands_for_a_winding(BASELINE, "x_m", &[]));
        assert!(!stands_for_a_winding(BASELINE, "x_m", &["back_emf"]), "it was fitted and does not follow");
        let store = "[inputs]\nu = \"u_N\"\n[time]\nperiod_s = 0.025\n[parameters]\na = { value = 1.0, min = 0.1, max = 9.0 }\n[states]\n\
                     h = { derivative = \"u - a*h\", initial = 0.0, unit = \"K\" }\n[outputs]\nh_K = \"h\"\n";
        assert!(!stands_for_a_winding(store, "h_K", &[]), "nothing moves that could induce a voltage");
    }
}
