//! Whether an effect may as well act at another place.
//!
//! A set that differs from the one that is told in nothing but where its mechanisms act is no rival of a mechanism's name, and says something else of the
//! machine: a stiffness that jumps where an output alone has it, or the gain of that sensor. `diagnosis.json` calls a place by the equation that it stands
//! in, and a spring to the ground and one to the next mass have one name: those are told by where they act.

use crate::model::hypothesis::{Effect, Hypothesis};

/// Log evidence within which two sets are as likely.
const TIE: f64 = 3.0;

/// The places at which effects of a set may act as well, in words.
pub fn elsewhere(pool: &[Hypothesis<'_>], told: usize) -> Vec<String> {
    let best = &pool[told];
    let mut out = Vec::new();
    let likely = |h: &&Hypothesis<'_>| h.log_evidence > best.log_evidence - TIE && h.mechanisms() == best.mechanisms();
    for other in pool.iter().filter(likely) {
        for e in best.effects.iter().filter(|e| !holds(other, e)) {
            let there = other.effects.iter().filter(|o| o.mechanism.id == e.mechanism.id && !holds(best, o));
            // Of its own name first.
            out.extend(there.min_by_key(|o| o.slot.label != e.slot.label).map(|o| {
                let (id, label) = (e.mechanism.id, &e.slot.label);
                let (here, there) = (&e.slot.whereabouts, &o.slot.whereabouts);
                if o.slot.label == *label {
                    format!("whether {id} at {label} acts {here} or {there} this recording does not tell")
                } else {
                    format!("whether {id} is at {label} or at {} this recording does not tell", o.slot.label)
                }
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
                let told: Vec<&String> = told.iter().filter(|t| t.contains(" acts ")).collect();
                assert!(told.len() == expected && told.iter().all(|t| t.contains(&both)), "{told:?} {both}");
            }
        });
    }

    #[test]
    fn so_are_places_of_other_names() {
        with_springs_of_two_masses(|_, mut sets| {
            sets[1].effects[0].slot.label = "parameter:k".into();
            let both = format!("at {} or at parameter:k", sets[0].effects[0].slot.label);
            for (behind, expected) in [(1.0, true), (9.0, false)] {
                sets[1].log_evidence = sets[0].log_evidence - behind;
                let told = elsewhere(&sets, 0);
                assert_eq!(told.iter().any(|t| t.contains(&both)), expected, "{told:?} {both}");
            }
        });
    }
}
