//! Dry friction of different size in the two directions.

use super::{is_there, sign};
use crate::mechanism::{Block, Family, Law, Mechanism, Need};
use crate::slot::Place;

/// Dry friction of different size in the two directions.
pub static ASYMMETRIC_FRICTION: Mechanism = Mechanism {
    id: "asymmetric_friction",
    family: Family::DryFriction,
    block: Block::Damping,
    places: &[Place::Force, Place::Connection, Place::ForceLaw],
    applies: |slot| slot.has("v"),
    already: &["step(v)", "step(-v)", "abs(sign(v))", "sign(v)*sign(v)", "sign(v)^2"],
    law: |slot, _| {
        if is_there(slot) {
            // The symmetric part is there already: only what the directions differ by.
            return Law::force(format!("F_a*abs({})", sign(slot))).amplitude("F_a", "F", -1.0, 1.0).sum_of_others();
        }
        // Dry friction and a constant force, sticking included.
        Law::force("(F_c + F_a*sign(v))*sign(v)")
            .amplitude("F_c", "F", 0.0, 1.0)
            .silent()
            .amplitude("F_a", "F", -1.0, 1.0)
            .report("F_plus", "F", "F_c + F_a")
            .report("F_minus", "F", "F_c - F_a")
            .report("F_a", "F", "F_a")
            .sum_of_others()
    },
    contains: &["coulomb_friction"],
    confusable: &["input_offset", "gravity"],
    needs: &[Need::Reversals("v", 6)],
    sentence: "Dry friction {place} is unequal in the two directions: half the difference is {F_a}.",
    signature: "An even part in the velocity: an offset whose sign follows the direction of travel.",
    reference: "A. Janot, M. Gautier, M. Brunot, Data set and reference models of EMPS, Workshop on Nonlinear System Identification Benchmarks (2019)",
};
