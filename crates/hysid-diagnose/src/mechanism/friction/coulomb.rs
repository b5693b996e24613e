//! Dry friction of constant size that opposes the motion.

use crate::mechanism::{Block, Family, Law, Mechanism, Need};
use crate::slot::{Place, SIGNS};

/// Dry friction of constant size that opposes the motion.
pub static COULOMB_FRICTION: Mechanism = Mechanism {
    id: "coulomb_friction",
    family: Family::DryFriction,
    block: Block::Damping,
    places: &[Place::Force, Place::Connection, Place::ForceLaw],
    applies: |slot| slot.has("v"),
    already: &SIGNS,
    law: |_, _| Law::force("F_c*sign(v)").amplitude("F_c", "F", 0.0, 1.0),
    contains: &[],
    confusable: &["stribeck_friction", "dahl_friction", "dead_zone", "displacement_dependent_damping"],
    needs: &[Need::Reversals("v", 6), Need::Levels("v", 1.5)],
    sentence: "Dry friction of about {F_c} opposes the motion {place}; the simulation has none.",
    signature: "Flat tops at reversals; equivalent damping falls as the amplitude grows; odd harmonics; a free decay is linear, not exponential.",
    reference: "H. Olsson, K. J. Åström, C. Canudas de Wit, M. Gäfvert, P. Lischinsky, Friction models and friction compensation, Eur. J. Control 4 (1998) 176-195",
};
