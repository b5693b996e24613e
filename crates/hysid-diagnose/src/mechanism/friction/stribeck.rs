//! Dry friction that is larger at small speed.

use super::{is_there, sign};
use crate::mechanism::{Block, Family, Form, Grid, Law, Mechanism, Need, Purpose, log_grid};
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
    law: |slot, purpose| {
        // The power of the fall is two until a sharp recording tells otherwise; below one it has no slope at rest.
        let free = purpose == Purpose::Form(Form::Finer);
        let fall = if free { "exp(-(abs(v)/v_s)^d_s)" } else { "exp(-(v/v_s)^2)" };
        let speed = |law: Law| {
            let law = law.shape("v_s", "v", log_grid(0.01, 0.6, 5)).within(0.002, 2.0);
            if free { law.shape("d_s", "1", Grid::Values(vec![1.0, 1.5])).within(1.0, 4.0) } else { law }
        };
        if is_there(slot) {
            return speed(Law::force(format!("F_d*{fall}*{}", sign(slot))).amplitude("F_d", "F", -0.5, 1.0));
        }
        let law = Law::force(format!("(F_c + F_d*{fall})*sign(v)"));
        speed(law.amplitude("F_c", "F", 0.0, 1.0).amplitude("F_d", "F", -0.5, 1.0)).report("F_s", "F", "F_c + F_d")
    },
    contains: &["coulomb_friction"],
    confusable: &["coulomb_friction", "cogging"],
    needs: &[Need::Sweeps("v", 6), Need::Slow("v")],
    sentence: "Dry friction {place}[, {F_c} at speed,] is {|F_d|} {F_d:larger/smaller} at rest than when sliding and {F_d:falls/grows} over {v_s}.",
    signature: "A falling friction near zero speed: stick-slip, limit cycles.",
    reference: "B. Armstrong-Hélouvry, P. Dupont, C. Canudas de Wit, A survey of models, analysis tools and compensation methods for the control of machines with friction, Automatica 30 (1994) 1083-1138",
};
