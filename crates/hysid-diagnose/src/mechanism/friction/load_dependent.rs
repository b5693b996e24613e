//! Dry friction that grows with the transmitted load.

use super::{is_there, sign};
use crate::mechanism::{Block, Family, Law, Mechanism, Need};
use crate::slot::Place;

/// Dry friction that grows with the transmitted load.
pub static LOAD_DEPENDENT_FRICTION: Mechanism = Mechanism {
    id: "load_dependent_friction",
    family: Family::DryFriction,
    block: Block::Damping,
    places: &[Place::Force],
    applies: |slot| slot.has("v") && slot.has("u"),
    already: &["abs(u)*sign(v)"],
    law: |slot, _| {
        if is_there(slot) {
            return Law::force(format!("mu*abs(u)*{}", sign(slot))).amplitude("mu", "F/u", 0.0, 1.0);
        }
        Law::force("(F_c + mu*abs(u))*sign(v)").amplitude("F_c", "F", 0.0, 1.0).amplitude("mu", "F/u", 0.0, 1.0)
    },
    contains: &["coulomb_friction"],
    confusable: &["coulomb_friction", "input_polynomial"],
    needs: &[Need::Reversals("v", 6), Need::Levels("u", 1.5)],
    sentence: "Dry friction {place} grows with the load by {mu}.",
    signature: "Friction follows the envelope of the drive, not only the direction of motion.",
    reference: "P. Hamon, M. Gautier, P. Garrec, Dynamic identification of robots with a dry friction model depending on load and velocity, IROS (2010) 6187-6193",
};
