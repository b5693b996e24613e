//! One for two: a law that is the sum of two others holds the place of a near relative of the one beside the other.
//!
//! Dry friction of unequal size is dry friction and a constant force. Where the truth is a damping that hardly grows with the speed and an offset, no
//! member of a pair leads alone, the sum explains nearly all that both do, and what it leaves is too little to go on from.

use rayon::prelude::*;

use super::assemble::{Part, SKETCH, assemble, carried_on};
use super::candidate::Candidate;
use super::compose::best_of_size;
use crate::budget::Step;
use crate::mechanism::{Block, Family};
use crate::model::hypothesis::{Hypothesis, Setting};

/// Relatives and offsets that are paired.
const RELATIVES: usize = 5;
const OFFSETS: usize = 2;

/// Pairs in the place of the best single effect of a pool where that is the sum of two others; none where it is not.
pub fn parted<'d>(
    setting: &Setting<'d>,
    none: &Hypothesis<'d>,
    pool: &[Hypothesis<'d>],
    candidates: &[Candidate],
) -> Vec<Hypothesis<'d>> {
    let Some(best) = best_of_size(pool, 1).map(|i| &pool[i]) else { return Vec::new() };
    let sum = &best.effects[0];
    // Beside a friction that the simulation has the sum is the offset alone.
    if !sum.written.sum_of_others || sum.written.amplitudes.len() < 2 {
        return Vec::new();
    }
    let relative = |c: &&Candidate| {
        c.slot.label == sum.slot.label
            && matches!(c.mechanism.block, Block::Damping | Block::Hysteresis)
            && c.mechanism.id != sum.mechanism.id
            && !sum.mechanism.contains.contains(&c.mechanism.id)
    };
    let relatives: Vec<&Candidate> = candidates.iter().filter(relative).take(RELATIVES).collect();
    let offsets: Vec<&Candidate> =
        candidates.iter().filter(|c| c.mechanism.family == Family::Bias).take(OFFSETS).collect();
    let pairs: Vec<[&Candidate; 2]> = relatives.iter().flat_map(|r| offsets.iter().map(move |o| [*r, *o])).collect();
    let own = none.base.values();
    let fitted = pairs.into_par_iter().filter_map(|pair| {
        if setting.budget.omits(Step::Composition) {
            return None;
        }
        let parts = pair.map(|c| Part::of_candidate(c, 0, c.points.first().map_or(&[][..], |p| &p.amplitudes)));
        carried_on(setting, assemble(setting, none, &own, &parts, &best.base.whitener, SKETCH), best)
    });
    fitted.collect()
}

#[cfg(test)]
mod tests {
    use hysid_plant::Simulation;

    use super::*;
    use crate::budget::Budget;
    use crate::model::base::NoiseKind;
    use crate::model::hypothesis::{calibrated, recorded};
    use crate::oscillator::{BASELINE, PERIOD, REAL, drive, normal, respond, rms};
    use crate::search::compose::add;
    use crate::search::fitting::refit_all;
    use crate::search::screen::screen;

    /// A damping that hardly grows with the speed, beside an offset of the sensor: unequal friction leads, and is not what there is.
    #[test]
    fn what_stands_for_two_gives_way_to_them() {
        let original = Simulation::parse(BASELINE, "test.sim.toml").unwrap();
        let mut random = normal(7);
        let u = drive(900, &mut random);
        let mut y = respond(&u, REAL, |_, v| 2.0 * v.signum() * v.abs().powf(0.6));
        let noise = 0.01 * rms(&y);
        y.iter_mut().for_each(|y| *y += noise * (random() + 0.6));
        let data = recorded(&original, PERIOD, [("u_N", u), ("x_m", y)]);
        let budget = Budget::new(&|_| false);
        let (setting, none) = calibrated(original, &data, NoiseKind::White(1.0), &budget);
        let candidates = screen(&none.base, &setting.original, &[], &none.base.evidence(), &|_, _| true);
        let single = ["asymmetric_friction", "coulomb_friction", "output_offset"];
        let list: Vec<&Candidate> = candidates.iter().filter(|c| single.contains(&c.mechanism.id)).collect();
        let mut pool = Vec::new();
        refit_all(&setting, &none, &list).into_iter().for_each(|h| add(&mut pool, h));
        let best = &pool[best_of_size(&pool, 1).unwrap()];
        assert_eq!(best.effects[0].mechanism.id, "asymmetric_friction");
        let found = parted(&setting, &none, &pool, &candidates);
        let pair = found.iter().max_by(|a, b| a.log_evidence.total_cmp(&b.log_evidence)).unwrap();
        assert!(pair.log_evidence > best.log_evidence + 4.0);
        assert!(pair.effects.iter().any(|e| e.mechanism.id == "power_law_damping"), "{:?}", pair.key());
        // Where the best is no such sum there is nothing to part.
        pool.retain(|h| h.effects[0].mechanism.id == "coulomb_friction");
        assert!(parted(&setting, &none, &pool, &candidates).is_empty());
    }
}
