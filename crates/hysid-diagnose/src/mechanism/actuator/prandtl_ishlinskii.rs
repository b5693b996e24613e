//! Hysteresis of an actuator as a weighted sum of backlashes.

use super::{how_many, plays, with_radii};
use crate::mechanism::{Block, Family, Law, Mechanism, Need, anywhere};
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
        let count = how_many(purpose);
        with_radii(Law::replace(format!("u{}", plays("u", count))), "u", count)
    },
    contains: &["backlash"],
    confusable: &["backlash", "bouc_wen", "log_creep"],
    needs: &[Need::Turns(6), Need::Levels("u", 1.3)],
    sentence: "The actuator {place} has a rate-independent hysteresis loop, a sum of plays: the three narrowest have the weights {p_1}, {p_2} and {p_3}.",
    signature: "A loop at any rate, the same for the same turning points (wiping out, congruency).",
    reference: "K. Kuhnen, Modeling, identification and compensation of complex hysteretic nonlinearities, Eur. J. Control 9 (2003) 407-418",
};
