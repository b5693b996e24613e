//! Damping by a power of the velocity.

use crate::mechanism::{Block, Family, Form, Grid, Law, Mechanism, Need, Purpose};
use crate::slot::Place;

/// Damping by a power of the velocity.
pub static POWER_LAW_DAMPING: Mechanism = Mechanism {
    id: "power_law_damping",
    family: Family::NonlinearDamping,
    block: Block::Damping,
    places: &[Place::Force, Place::Connection, Place::ForceLaw],
    applies: |slot| slot.has("v"),
    already: &["abs(v)^P", "(abs(v)/P)^Q", "((v/P)^2 + Q)^((R - 1)/2)"],
    law: |_, purpose| {
        // The reference speed keeps the unit of F_p whatever the power. Below two hundredths of it the law is smooth: the derivative of a
        // power below one is infinite at rest, and no fit survives that from afar. From nearby it survives more, where the output shows the force:
        // what the smooth law leaves at each turn would pass for dry friction.
        let square = if purpose == Purpose::Form(Form::Finer) { "0.000004" } else { "0.0004" };
        Law::force(format!("F_p*v/v_r*((v/v_r)^2 + {square})^((p_v - 1)/2)"))
            // With less than none of it, beside the damping that the simulation has, it would be a dry friction that falls.
            .amplitude("F_p", "F", 0.0, 1.0)
            .constant("v_r", "v", Grid::Values(vec![1.0]))
            .shape("p_v", "1", Grid::Values(vec![0.3, 0.5, 1.5, 2.5]))
            .within(0.1, 4.0)
    },
    contains: &["coulomb_friction", "quadratic_damping"],
    confusable: &["coulomb_friction", "quadratic_damping"],
    needs: &[Need::Levels("v", 2.0)],
    sentence: "Damping {place} follows the power {p_v} of the velocity: {F_p} at {v_r}.",
    signature: "Equivalent damping goes as the amplitude to the power p - 1.",
    reference: "S. J. Elliott, M. Ghandchi Tehrani, R. S. Langley, Nonlinear damping and quasi-linear modelling, Phil. Trans. R. Soc. A 373 (2015) 20140402",
};
