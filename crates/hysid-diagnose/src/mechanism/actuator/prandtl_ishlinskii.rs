//! Hysteresis of an actuator as a weighted sum of backlashes.

use super::{plays, with_radii};
use crate::mechanism::{Block, Family, Law, Mechanism, Need, Purpose, anywhere};
use crate::slot::Place;

/// Hysteresis of an actuator as a weighted sum of backlashes.
pub static PRANDTL_ISHLINSKII: Mechanism = Mechanism {
    id: "prandtl_ishlinskii",
    family: Family::ActuatorHysteresis,
    block: Block::Hysteresis,
    places: &[Place::Input],
    applies: anywhere,
    already: &["play(u, R)"],
    law: |_, purpose| {
        let count = if purpose == Purpose::Screening { 4 } else { 6 };
        with_radii(Law::replace(format!("u{}", plays("u", count))), "u", count)
    },
    contains: &["backlash"],
    confusable: &["backlash", "bouc_wen", "log_creep"],
    needs: &[Need::Turns(6), Need::Levels("u", 1.3)],
    sentence: "The actuator {place} has a rate-independent hysteresis loop: plays of weight {p_1}, {p_2}, {p_3}, {p_4}, {p_5} and {p_6}.",
    signature: "A loop at any rate, the same for the same turning points (wiping out, congruency).",
    reference: "K. Kuhnen, Modeling, identification and compensation of complex hysteretic nonlinearities, Eur. J. Control 9 (2003) 407-418",
};
