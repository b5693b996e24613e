//! Hysteresis of an actuator with a general weight over its turning points.

use super::{plays, with_radii};
use crate::mechanism::{Block, Family, Grid, Law, Mechanism, Need, anywhere};
use crate::slot::Place;

/// Plays in the law: each has three amplitudes, and twice as many follow one recording and no other.
const PLAYS: usize = 3;

/// Hysteresis of an actuator with a general weight over its turning points.
pub static PREISACH: Mechanism = Mechanism {
    id: "preisach",
    family: Family::ActuatorHysteresis,
    block: Block::Hysteresis,
    places: &[Place::Input],
    applies: anywhere,
    already: &["play(u, R)^P", "relay(u, P, Q)"],
    law: |_, _| {
        // Preisach's model in play coordinates: a curved function of each play, here of degree three, which goes on as a straight line beyond
        // what the recording reached: a cubic that runs on is no model of a hysteresis.
        let within = |i: usize| format!("max(min(play(u, r_{i}), u_m), -u_m)");
        let bent: String = (1..=PLAYS)
            .map(|i| format!(" + play(u, r_{i})*(q_{i}*{w}/u_r + s_{i}*{w}^2/u_r^2)", w = within(i)))
            .collect();
        let mut law = with_radii(Law::replace(format!("u{}{bent}", plays("u", PLAYS))), "u", PLAYS);
        law =
            law.constant("u_r", "u", Grid::Reach("u", vec![1.0])).constant("u_m", "u", Grid::Quantiles("u", vec![1.0]));
        for i in 1..=PLAYS {
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
