//! Hysteresis of an actuator with a general weight over its turning points.

use super::{plays, with_radii};
use crate::mechanism::{Block, Family, Grid, Law, Mechanism, Need, anywhere};
use crate::slot::Place;

/// Hysteresis of an actuator with a general weight over its turning points.
pub static PREISACH: Mechanism = Mechanism {
    id: "preisach",
    family: Family::ActuatorHysteresis,
    block: Block::Hysteresis,
    places: &[Place::Input],
    applies: anywhere,
    already: &["play(u, R)^P", "relay(u, P, Q)"],
    law: |_, _| {
        // Preisach's model in play coordinates: a curved function of each play, here of degree three.
        let bent: String =
            (1..=3).map(|i| format!(" + q_{i}*play(u, r_{i})^2/u_r + s_{i}*play(u, r_{i})^3/u_r^2")).collect();
        let mut law = with_radii(Law::replace(format!("u{}{bent}", plays("u", 3))), "u", 3);
        law = law.constant("u_r", "u", Grid::Reach("u", vec![1.0]));
        for i in 1..=3 {
            law = law.amplitude(format!("q_{i}"), "1", -1.0, 1.0).amplitude(format!("s_{i}"), "1", -1.0, 1.0);
        }
        law
    },
    contains: &["prandtl_ishlinskii", "backlash"],
    confusable: &["prandtl_ishlinskii", "asymmetric_hysteresis"],
    needs: &[Need::Turns(12), Need::Levels("u", 1.5)],
    sentence: "The actuator {place} has a rate-independent hysteresis loop whose shape depends on the level (Preisach).",
    signature: "A loop at any rate with wiping out; loops at different bias are congruent but not the same.",
    reference: "I. D. Mayergoyz, Mathematical Models of Hysteresis and Their Applications (2003); M. Brokate, J. Sprekels, Hysteresis and Phase Transitions (1996), sec. 2.4",
};
