//! Members of a set that add next to nothing beside the others.
//!
//! No law is written exactly: beside a large effect, what its form leaves of it looks like a small one. Such a member is not told as an effect but as
//! something small that is left.

use crate::model::hypothesis::{Effect, Hypothesis, best_that_says};
use crate::search::given_up::leaves_more;
use crate::text::number;

/// Share of a set's log evidence that a member must bring.
const TRIFLE: f64 = 0.03;

/// A member that is not told.
#[derive(Debug, Clone, PartialEq)]
pub struct Trifle {
    /// What it is, in words.
    words: String,
    /// Share of the evidence that it brings.
    share: f64,
}

impl Trifle {
    /// As a note.
    pub fn words(&self) -> String {
        format!(
            "what is left resembles {}, which brings {} % of the evidence: no more than a law that is written but nearly right leaves of itself, so that it is not told",
            self.words,
            number(100.0 * self.share)
        )
    }
}

/// Whether a set is another one with no more than trifles added: what is told in its place says what it says. Gains count from the first of the pool.
pub fn adds_trifles(pool: &[Hypothesis<'_>], set: usize, told: usize) -> bool {
    let gain = |i: usize| pool[i].log_evidence - pool[0].log_evidence;
    let (more, key) = (pool[set].key(), pool[told].key());
    more.len() > key.len() && key.iter().all(|e| more.contains(e)) && gain(set) < (1.0 + TRIFLE) * gain(told)
}

/// The set of a pool that is told in the place of the `winner`: the same without the members that add next to nothing, the least first, and what these are.
/// A member stays where the set without it was not fitted, and where that set leaves a larger error than the simulation as it is (`simulation`, where it
/// leaves the least) and this one does not: under a noise that wanders a constant force brings little evidence, and most of the error may be its. What is
/// brought counts from the set at `from`: the simulation as it is, or that with the converters of the recording.
pub fn without_trifles(
    pool: &[Hypothesis<'_>],
    winner: usize,
    from: usize,
    simulation: &Hypothesis<'_>,
) -> (usize, Vec<Trifle>) {
    let gain = |i: usize| pool[i].log_evidence - pool[from].log_evidence;
    let (mut told, mut trifles) = (winner, Vec::new());
    loop {
        let best = &pool[told];
        let whole = gain(told);
        if best.effects.len() < 2 + pool[from].effects.len() || !(whole > 0.0) {
            break;
        }
        let share = |member: usize| {
            let rest = best_that_says(pool, &best.key_without(member))?;
            let explains = leaves_more(best, simulation) || !leaves_more(&pool[rest], simulation);
            explains.then_some((member, rest, 1.0 - gain(rest) / whole))
        };
        let least = (0..best.effects.len()).filter_map(share).min_by(|a, b| a.2.total_cmp(&b.2));
        let Some((member, rest, share)) = least.filter(|l| l.2 < TRIFLE) else { break };
        trifles.push(Trifle { words: named(&best.effects[member]), share: share.max(0.0) });
        told = rest;
    }
    (told, trifles)
}

fn named(e: &Effect) -> String {
    format!("{} at {}", e.mechanism.id, e.slot.label)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::Budget;
    use crate::model::base::NoiseKind;
    use crate::model::hypothesis::{calibrated, recorded};
    use crate::oscillator::{BASELINE, PERIOD, REAL, drive, normal, respond, rms};
    use crate::search::fitting::refit;
    use crate::search::screen::screen;
    use hysid_plant::Simulation;

    /// Of a hard spring and an offset of the sensor of so many noise standard deviations, what is told, how many of them are not, and whether both say
    /// what the spring says.
    fn told(offset: f64) -> (Vec<&'static str>, usize, bool) {
        let original = Simulation::parse(BASELINE, "test.sim.toml").unwrap();
        let mut random = normal(5);
        let u = drive(1200, &mut random);
        let mut y = respond(&u, REAL, |x, _| 6e4 * x.powi(3));
        let noise = 0.01 * rms(&y);
        y.iter_mut().for_each(|y| *y += noise * (random() + offset));
        let data = recorded(&original, PERIOD, [("u_N", u), ("x_m", y)]);
        let budget = Budget::new(&|_| false);
        let (setting, none) = calibrated(original, &data, NoiseKind::White(1.0), &budget);
        let fitted = |parent: &Hypothesis<'_>, id: &str| {
            let found = screen(&parent.base, &setting.original, &[], &parent.base.evidence(), &|m, _| m.id == id);
            let sketched = refit(&setting, parent, &found[0]).unwrap();
            let base = setting.further(&sketched.base, None, 2, 40).unwrap();
            setting.hypothesis(sketched.effects, base)
        };
        let spring = fitted(&none, "cubic_stiffness");
        let (both, offset) = (fitted(&spring, "output_offset"), fitted(&none, "output_offset"));
        let pool = [none, spring, offset, both];
        let (place, trifles) = without_trifles(&pool, 3, 0, &pool[0]);
        // Nor does a set say the same that has less in it, or something else.
        assert!(!adds_trifles(&pool, 1, 3) && !adds_trifles(&pool, 2, 1) && !adds_trifles(&pool, 1, 1));
        (pool[place].effects.iter().map(|e| e.mechanism.id).collect(), trifles.len(), adds_trifles(&pool, 3, 1))
    }

    #[test]
    fn what_adds_next_to_nothing_is_not_told() {
        assert_eq!(told(0.0), (vec!["cubic_stiffness"], 1, true));
        assert_eq!(told(1.5), (vec!["cubic_stiffness", "output_offset"], 0, false));
    }
}
