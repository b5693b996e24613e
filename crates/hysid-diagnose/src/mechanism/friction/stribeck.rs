//! Dry friction that is larger at small speed.

use super::is_there;
use crate::mechanism::{Block, Family, Law, Mechanism, Need, log_grid};
use crate::slot::Place;

/// Dry friction that is larger at small speed.
pub static STRIBECK_FRICTION: Mechanism = Mechanism {
    id: "stribeck_friction",
    family: Family::DryFriction,
    block: Block::Damping,
    places: &[Place::Force, Place::Connection, Place::ForceLaw],
    applies: |slot| slot.has("v"),
    already: &[
        "exp(-(v/P)^2)",
        "exp(-abs(v/P))",
        "exp(-(abs(v)/P))",
        "exp(-abs(v)/P)",
        "exp(-(abs(v)/P)^2)",
        "exp(-v^2/P)",
    ],
    law: |slot, _| {
        let speed = log_grid(0.01, 0.6, 5);
        if is_there(slot) {
            return Law::force("F_d*exp(-(v/v_s)^2)*sign(v)")
                .amplitude("F_d", "F", -0.5, 1.0)
                .shape("v_s", "v", speed)
                .within(0.002, 2.0);
        }
        Law::force("(F_c + F_d*exp(-(v/v_s)^2))*sign(v)")
            .amplitude("F_c", "F", 0.0, 1.0)
            .amplitude("F_d", "F", -0.5, 1.0)
            .shape("v_s", "v", speed)
            .within(0.002, 2.0)
            .report("F_s", "F", "F_c + F_d")
    },
    contains: &["coulomb_friction"],
    confusable: &["coulomb_friction", "cogging"],
    needs: &[Need::Reversals("v", 6), Need::Slow("v")],
    sentence: "Dry friction {place} is {F_d} larger at rest than when sliding and falls over {v_s}.",
    signature: "A falling friction near zero speed: stick-slip, limit cycles.",
    reference: "B. Armstrong-Hélouvry, P. Dupont, C. Canudas de Wit, A survey of models, analysis tools and compensation methods for the control of machines with friction, Automatica 30 (1994) 1083-1138",
};
