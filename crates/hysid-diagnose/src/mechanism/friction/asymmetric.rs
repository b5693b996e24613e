//! Dry friction of different size in the two directions.

use super::{is_there, sign};
use crate::mechanism::{Block, Family, Form, Law, Mechanism, Need, Purpose};
use crate::slot::Place;

/// Dry friction of different size in the two directions.
pub static ASYMMETRIC_FRICTION: Mechanism = Mechanism {
    id: "asymmetric_friction",
    family: Family::DryFriction,
    block: Block::Damping,
    places: &[Place::Force, Place::Connection, Place::ForceLaw],
    applies: |slot| slot.has("v"),
    already: &["step(v)", "step(-v)", "abs(sign(v))", "sign(v)*sign(v)", "sign(v)^2"],
    law: |slot, purpose| {
        if is_there(slot) {
            // The symmetric part is there already: only what the directions differ by.
            let dry = format!("F_a*abs({})", sign(slot));
            return match purpose {
                // What slides in grease, too.
                Purpose::Form(Form::Finer) => {
                    let law = Law::force(format!("{dry} + c_a*abs(v)")).amplitude("F_a", "F", -1.0, 1.0);
                    law.amplitude("c_a", "F/v", -1.0, 1.0)
                }
                _ => Law::force(dry).amplitude("F_a", "F", -1.0, 1.0).sum_of_others(),
            };
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
