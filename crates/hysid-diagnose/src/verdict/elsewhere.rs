//! Whether an effect may as well act at another place of the same name.
//!
//! `diagnosis.json` calls a place by the equation that it stands in, and a spring to the ground and one to the next mass have one name. A set that differs
//! from the one that is told in nothing but that is no rival by name, and says something else of the machine.

use crate::model::hypothesis::{Effect, Hypothesis};

/// Log evidence within which two sets are as likely.
const TIE: f64 = 3.0;

/// The places at which effects of a set may act as well, by their names, in words.
pub fn elsewhere(pool: &[Hypothesis<'_>], told: usize) -> Vec<String> {
    let best = &pool[told];
    let mut out = Vec::new();
    let likely = |h: &&Hypothesis<'_>| h.log_evidence > best.log_evidence - TIE && h.names() == best.names();
    for other in pool.iter().filter(likely) {
        for e in best.effects.iter().filter(|e| !holds(other, e)) {
            let instead = other.effects.iter().find(|o| o.states_the_same(e) && !holds(best, o));
            out.extend(instead.map(|o| {
                let (here, there) = (&e.slot.whereabouts, &o.slot.whereabouts);
                format!(
                    "whether {} at {} acts {here} or {there} this recording does not tell",
                    e.mechanism.id, e.slot.label
                )
            }));
        }
    }
    out.sort();
    out.dedup();
    out
}

/// Whether a set has this effect at this very place.
fn holds(h: &Hypothesis<'_>, effect: &Effect) -> bool {
    h.effects.iter().any(|e| e.mechanism.id == effect.mechanism.id && e.slot.is_at(&effect.slot))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::search::assemble::tests::with_springs_of_two_masses;

    #[test]
    fn two_places_of_one_name_are_told_where_both_are_likely() {
        with_springs_of_two_masses(|_, mut sets| {
            let slots: Vec<_> = sets.iter().map(|s| s.effects[0].slot.clone()).collect();
            let alike = |i: usize, j: usize| slots[i].label == slots[j].label && !slots[i].is_at(&slots[j]);
            let (one, other) = (0..slots.len())
                .flat_map(|i| (0..slots.len()).map(move |j| (i, j)))
                .find(|&(i, j)| alike(i, j))
                .unwrap();
            let both = format!("acts {} or {}", slots[one].whereabouts, slots[other].whereabouts);
            for (behind, expected) in [(1.0, 1), (9.0, 0)] {
                sets[other].log_evidence = sets[one].log_evidence - behind;
                let told = elsewhere(&sets, one);
                assert!(told.len() == expected && told.iter().all(|t| t.contains(&both)), "{told:?} {both}");
            }
        });
    }
}
