//! Members of a set that add next to nothing beside the others.
//!
//! No law is written exactly: beside a large effect, what its form leaves of it looks like a small one. Such a member is not told as an effect but as
//! something small that is left.

use crate::model::hypothesis::{Effect, Hypothesis, best_that_says};
use crate::search::given_up::leaves_more;
use crate::text::number;

/// Share of a set's log evidence that a member must bring.
const TRIFLE: f64 = 0.03;
/// Share of the squared error that a set takes, and log evidence, from which on a member that takes and brings so much is none.
const MUCH: (f64, f64) = (0.3, 20.0);

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

/// Whether what a set has besides `rest` is plain to see and takes a good part of the squared error that the set takes of the `simulation`: what the form of a law
/// leaves is small beside what the law takes. The share of evidence does not say so where the noise model predicts an error that is slow (gravity on a drive,
/// beside a backlash).
fn takes_much(simulation: &Hypothesis<'_>, rest: &Hypothesis<'_>, set: &Hypothesis<'_>) -> bool {
    let [none, without, with] = [simulation, rest, set].map(|h| h.base.unexplained());
    set.log_evidence > rest.log_evidence + MUCH.1 && without - with > MUCH.0 * (none - with)
}

/// Whether a set is another one with no more than trifles added: what is told in its place says what it says. Gains count from the first of the pool.
pub fn adds_trifles(pool: &[Hypothesis<'_>], set: usize, told: usize) -> bool {
    let gain = |i: usize| pool[i].log_evidence - pool[0].log_evidence;
    let (more, key) = (pool[set].key(), pool[told].key());
    let adds = more.len() > key.len() && key.iter().all(|e| more.contains(e));
    adds && gain(set) < (1.0 + TRIFLE) * gain(told) && !takes_much(&pool[0], &pool[told], &pool[set])
}

/// The set of a pool that is told in the place of the `winner`: the same without the members that add next to nothing, the least first, and what these are.
/// A member stays where the set without it was not fitted, and where that set leaves a larger error than the simulation as it is (`simulation`, where it
/// leaves the least) and this one does not, or where it takes a good part of the error: under a noise that wanders a constant force brings little evidence, and most of
/// the error may be its. What is brought counts from the set at `from`: the simulation as it is, or that with the converters of the recording.
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
            (explains && !takes_much(simulation, &pool[rest], best)).then_some((member, rest, 1.0 - gain(rest) / whole))
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
    /// what the spring says; where the error is `slow`, so that the noise model predicts it, the spring alone has left as much of it as nothing does.
    fn told(offset: f64, slow: bool) -> (Vec<&'static str>, usize, bool) {
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
        let mut pool = [none, spring, offset, both];
        if slow {
            pool[1].base.fit.residual = pool[0].base.fit.residual.clone();
            pool[3].log_evidence = pool[1].log_evidence + 1.2 * MUCH.1;
        }
        let (place, trifles) = without_trifles(&pool, 3, 0, &pool[0]);
        // Nor does a set say the same that has less in it, or something else.
        assert!(!adds_trifles(&pool, 1, 3) && !adds_trifles(&pool, 2, 1) && !adds_trifles(&pool, 1, 1));
        (pool[place].effects.iter().map(|e| e.mechanism.id).collect(), trifles.len(), adds_trifles(&pool, 3, 1))
    }

    #[test]
    fn what_adds_next_to_nothing_is_not_told() {
        assert_eq!(told(0.0, false), (vec!["cubic_stiffness"], 1, true));
        assert_eq!(told(1.5, false), (vec!["cubic_stiffness", "output_offset"], 0, false));
    }

    #[test]
    fn what_takes_most_of_the_error_is_told_however_little_evidence_it_brings() {
        assert_eq!(told(0.0, true), (vec!["cubic_stiffness", "output_offset"], 0, false));
    }
}
