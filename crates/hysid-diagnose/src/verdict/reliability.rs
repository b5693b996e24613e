//! How often a statement that is not firm is right: its support among the fitted sets, recalibrated on development cases.
//!
//! Were noise and laws exact, the odds of two fitted sets would be their likelihood ratio, and simulating the candidates again would give the
//! same. They are not: evidence counts with a weight of 0.4, and rules cap what something speaks against, both to keep a wrong name from
//! being firm. What then stands below [`FIRM`] is an order, not a frequency, and the way from one to the other is empirical: a logistic map with a
//! slope, and a term for sets of several effects. In a set that is called an imitation of something outside the catalogue none of 36 members was right.
//!
//! The map only moves what is below [`FIRM`], and nothing of it above [`NOT_FIRM`]: whether a statement is firm is settled before. Figures: `cargo
//! xtask reliability`, from statements of development seeds 311 to 361 (`xtask/reliability/`).

use super::{FIRM, NOT_FIRM};
use crate::file::{DiagnosisFile, VerdictKind};

/// From support to probability: `1 / (1 + exp(-(constant + slope logit(support) + several)))`, the last for sets of two and more.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Map {
    /// Log odds at a support of one half, for a set of one.
    pub constant: f64,
    /// How much the odds of the support count.
    pub slope: f64,
    /// Added for a member of a set of several.
    pub several: f64,
}

/// For mechanisms.
pub const MECHANISM: Map = Map { constant: 0.19, slope: 0.98, several: 0.29 };
/// For families.
pub const FAMILY: Map = Map { constant: -0.48, slope: 1.22, several: 0.24 };
/// Probability of a member of a set that is called an imitation: none of 36 was right, and half a case is granted.
pub const IMITATION: f64 = 0.01;
/// Supports beyond these count as these.
const ENDS: (f64, f64) = (0.02, 0.98);

/// Logarithm of the odds.
pub fn logit(support: f64) -> f64 {
    let p = support.clamp(ENDS.0, ENDS.1);
    (p / (1.0 - p)).ln()
}

impl Map {
    /// The probability that goes with a support, in a set of so many members.
    pub fn probability(&self, support: f64, members: usize) -> f64 {
        if support >= FIRM {
            return support;
        }
        let several = if members > 1 { self.several } else { 0.0 };
        let odds = self.constant + self.slope * logit(support) + several;
        (1.0 / (1.0 + (-odds).exp())).min(NOT_FIRM)
    }
}

/// By how much more rivals have where a statement has this probability in the place of its support. One that stays as it is gives nothing up, however little
/// it leaves.
fn left_to_rivals(probability: f64, support: f64) -> f64 {
    if probability == support { 1.0 } else { (1.0 - probability) / (1.0 - support) }
}

/// Puts probabilities in the place of supports, in effects and alternatives. The verdict stands as it is.
pub(crate) fn recalibrate(file: &mut DiagnosisFile) {
    let members = file.effects.len();
    let imitation = file.verdict == VerdictKind::NotInCatalogue;
    let of = |map: Map, support: f64| {
        if imitation && support < FIRM { IMITATION.min(support) } else { map.probability(support, members) }
    };
    // What an effect gives up its rivals share; they sum to no more than what it leaves.
    let mut rivals = if imitation { 1.0 } else { f64::INFINITY };
    for e in &mut file.effects {
        e.probability = of(MECHANISM, e.support);
        e.family_probability = of(FAMILY, e.family_support).max(e.probability);
        rivals = rivals.min(left_to_rivals(e.probability, e.support));
    }
    if !rivals.is_finite() {
        return;
    }
    let elsewhere: Vec<bool> = (file.alternatives.iter())
        .map(|a| file.alternatives.iter().any(|o| o.mechanism == a.mechanism && o.slot != a.slot))
        .collect();
    for (a, elsewhere) in file.alternatives.iter_mut().zip(elsewhere) {
        let own = file.effects.iter().find(|e| e.mechanism == a.mechanism && e.slot == a.slot);
        a.probability = match own {
            // An effect that nothing else than its place can be told of has one probability.
            Some(e) if !elsewhere => e.probability,
            Some(e) if e.support < FIRM => {
                (a.probability * e.probability / e.support.max(f64::MIN_POSITIVE)).min(e.probability)
            }
            None if a.probability < FIRM => (a.probability * rivals).min(NOT_FIRM),
            _ => a.probability,
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn order_is_kept_nothing_becomes_firm_and_what_is_firm_stays(a in 0.0..1.0_f64, b in 0.0..1.0_f64, members in 1..4_usize) {
            for map in [MECHANISM, FAMILY] {
                let (p, q) = (map.probability(a.min(b), members), map.probability(a.max(b), members));
                prop_assert!(p <= q, "{a} {b}: {p} {q}");
                prop_assert!((q >= FIRM) == (a.max(b) >= FIRM));
                if a >= FIRM {
                    prop_assert_eq!(map.probability(a, members), a);
                }
            }
        }

        /// One effect and its exclusive rivals, whatever the cap did to its support: the probabilities sum to one at most.
        #[test]
        fn exclusive_rivals_sum_to_one_at_most(raw in 0.0..1.0_f64, shares in prop::collection::vec(0.0..1.0_f64, 1..5), capped in any::<bool>()) {
            let support = if capped { raw.min(NOT_FIRM) } else { raw };
            let whole: f64 = shares.iter().sum::<f64>().max(f64::MIN_POSITIVE);
            let p = MECHANISM.probability(support, 1);
            let factor = left_to_rivals(p, support);
            let rivals: f64 = shares.iter().map(|s| (1.0 - raw) * s / whole * factor).sum();
            prop_assert!(p + rivals <= 1.0 + 1e-12);
        }
    }

    /// Rivals of what is certain are as likely as they were: a mechanism that is at one of two places is certain, and neither place is.
    #[test]
    fn what_is_certain_takes_nothing_from_others() {
        assert_eq!(left_to_rivals(1.0, 1.0), 1.0);
        assert_eq!(left_to_rivals(0.5, 0.8), 0.5 / (1.0 - 0.8));
    }
}
