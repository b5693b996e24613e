//! Hysteresis of an actuator as a weighted sum of backlashes.

use super::plays::Plays;
use crate::mechanism::{Block, Family, Mechanism, Need, anywhere};
use crate::slot::Place;

/// Hysteresis of an actuator as a weighted sum of backlashes.
pub static PRANDTL_ISHLINSKII: Mechanism = Mechanism {
    id: "prandtl_ishlinskii",
    family: Family::ActuatorHysteresis,
    block: Block::Hysteresis,
    places: &[Place::Input, Place::Command],
    applies: anywhere,
    already: &["play(u, R)", "play(u + P, R)"],
    law: |_, purpose| {
        let plays = Plays(purpose);
        plays.law(plays.simply())
    },
    contains: &["backlash"],
    confusable: &["backlash", "bouc_wen", "log_creep"],
    needs: &[Need::Turns(6), Need::Levels("u", 1.3)],
    sentence: "The actuator {place} has a rate-independent hysteresis loop, a sum of plays, which carry {share} of its gain.",
    signature: "A loop at any rate, the same for the same turning points (wiping out, congruency).",
    reference: "K. Kuhnen, Modeling, identification and compensation of complex hysteretic nonlinearities, Eur. J. Control 9 (2003) 407-418",
};
