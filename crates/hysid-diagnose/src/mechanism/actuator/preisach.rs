//! Hysteresis of an actuator with a general weight over its turning points.

use super::plays::{Plays, density};
use crate::mechanism::{Block, Family, Form, Grid, Law, Mechanism, Need, Purpose, anywhere};
use crate::slot::Place;

/// Plays that are bent each on its own: each has three amplitudes, and twice as many follow one recording and no other.
const PLAYS: usize = 3;

/// The law with the input's reach, by which levels are scaled, and the largest level that the recording has.
fn scaled(law: Law) -> Law {
    law.constant("u_r", "u", Grid::Reach("u", vec![1.0])).constant("u_m", "u", Grid::Quantiles("u", vec![1.0]))
}

/// Hysteresis of an actuator with a general weight over its turning points.
pub static PREISACH: Mechanism = Mechanism {
    id: "preisach",
    family: Family::ActuatorHysteresis,
    block: Block::Hysteresis,
    places: &[Place::Input, Place::Command],
    applies: anywhere,
    already: &["play(u, R)", "play(u + P, R)", "relay(u, P, Q)"],
    law: |_, purpose| {
        // Preisach's model in play coordinates: a curved function of each play, which goes on as a straight line beyond what the recording
        // reached: a polynomial that runs on is no model of a hysteresis.
        let within = |play: &str| format!("max(min({play}, u_m), -u_m)");
        // Each play bent on its own, to the third degree.
        if let Purpose::Form(Form::Few) = purpose {
            let plays = Plays(purpose);
            let curved = |i: usize| {
                let play = plays.play(&format!("r_{i}"));
                format!(" + {play}*(q_{i}*{w}/u_r + s_{i}*{w}^2/u_r^2)", w = within(&play))
            };
            let bent: String = (1..=PLAYS).map(curved).collect();
            let law = scaled(plays.law(format!("{}{bent}", plays.simply())));
            return (1..=PLAYS).fold(law, |law, i| {
                law.amplitude(format!("q_{i}"), "1", -1.0, 1.0).amplitude(format!("s_{i}"), "1", -1.0, 1.0)
            });
        }
        // Alike for all plays: the density is a product of a function of the half-width and one of the level.
        let unsettled = Purpose::Form(Form::Unsettled);
        let plays = Plays(if purpose == unsettled { unsettled } else { Purpose::Refit });
        let square = purpose == Purpose::Form(Form::Finer);
        let curved = |(share, r): (String, String)| {
            let play = plays.play(&r);
            let w = within(&play);
            let second = if square { format!(" + s*{share}*{play}*{w}^2/u_r^2") } else { String::new() };
            format!(" + q*{share}*{play}*{w}/u_r{second}")
        };
        let bent: String = density().map(curved).collect();
        let law = scaled(plays.law(format!("{}{bent}", plays.simply()))).amplitude("q", "1", -5.0, 5.0);
        if square { law.amplitude("s", "1", -5.0, 5.0) } else { law }
    },
    contains: &["prandtl_ishlinskii", "backlash"],
    confusable: &["prandtl_ishlinskii", "asymmetric_hysteresis"],
    needs: &[Need::Turns(12), Need::Levels("u", 1.5)],
    sentence: "The actuator {place} has a rate-independent hysteresis loop whose shape depends on the level (Preisach).",
    signature: "A loop at any rate with wiping out; loops at different bias are congruent but not the same.",
    reference: "I. D. Mayergoyz, Mathematical Models of Hysteresis and Their Applications (2003); M. Brokate, J. Sprekels, Hysteresis and Phase Transitions (1996), sec. 2.4",
};
