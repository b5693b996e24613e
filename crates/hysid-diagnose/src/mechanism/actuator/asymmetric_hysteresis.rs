//! Hysteresis of an actuator with a one-sided characteristic behind it.

use super::plays::Plays;
use crate::mechanism::{Block, Family, Grid, Mechanism, Need, Purpose, anywhere};
use crate::slot::Place;

/// Hysteresis of an actuator with a one-sided characteristic behind it.
pub static ASYMMETRIC_HYSTERESIS: Mechanism = Mechanism {
    id: "asymmetric_hysteresis",
    family: Family::ActuatorHysteresis,
    block: Block::Hysteresis,
    places: &[Place::Input, Place::Command],
    applies: anywhere,
    already: &["play(u, R)", "play(u + P, R)", "max(Z - P, 0)"],
    law: |_, purpose| {
        let plays = Plays(purpose);
        let h = plays.simply();
        let text = match purpose {
            // Linear in its amplitudes: the one-sided part acts on the bare input.
            Purpose::Screening => format!("{h} + a_h*max(u - u_h, 0)"),
            Purpose::Refit | Purpose::Form(_) => format!("({h}) + a_h*max(({h}) - u_h, 0)"),
        };
        plays.law(text).amplitude("a_h", "1", -0.9, 2.0).shape(
            "u_h",
            "u",
            Grid::SignedQuantiles("u", vec![0.3, 0.5, 0.7]),
        )
    },
    contains: &["prandtl_ishlinskii", "backlash"],
    confusable: &["prandtl_ishlinskii", "preisach", "input_polynomial", "input_saturation"],
    needs: &[Need::Turns(12), Need::BothSides("u")],
    sentence: "The actuator {place} has a hysteresis loop with unequal sides: above {u_h} its gain changes by {a_h}.",
    signature: "An asymmetric major loop.",
    reference: "K. Kuhnen, Modeling, identification and compensation of complex hysteretic nonlinearities, Eur. J. Control 9 (2003) 407-418",
};
