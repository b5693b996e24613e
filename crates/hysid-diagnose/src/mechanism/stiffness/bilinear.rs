//! A spring whose stiffness changes at one point.

use crate::mechanism::{Block, Family, Form, Grid, Law, Mechanism, Need, Purpose};
use crate::slot::Place;

/// A spring whose stiffness changes at one point.
pub static BILINEAR_STIFFNESS: Mechanism = Mechanism {
    id: "bilinear_stiffness",
    family: Family::AsymmetricStiffness,
    block: Block::Restoring,
    places: &[Place::Force, Place::Connection, Place::ForceLaw, Place::Circuit],
    applies: |slot| slot.has("x"),
    already: &["max(x, 0)", "max(0, x)", "max(x - P, 0)", "max(0, x - P)", "step(x)*x", "x*step(x)"],
    law: |_, purpose| {
        // The rest is where most springs change: a stop that just touches, a crack that opens.
        if purpose == Purpose::Form(Form::Few) {
            return Law::force("k_b*max(x, 0)").amplitude("k_b", "F/x", -2.0, 50.0);
        }
        // Where the knee lies on the far side of the rest the spring may be slack there or at rest: the recording tells which.
        let at_rest = if purpose == Purpose::Form(Form::Other) { " - max(-x_0, 0)" } else { "" };
        Law::force(format!("k_b*(max(x - x_0, 0){at_rest})"))
            .amplitude("k_b", "F/x", -2.0, 50.0)
            .shape("x_0", "x", Grid::SignedQuantiles("x", vec![0.1, 0.25, 0.4, 0.5, 0.6, 0.75, 0.9]))
            .searched()
    },
    contains: &[],
    confusable: &["quadratic_stiffness", "gap_stop"],
    needs: &[Need::BothSides("x")],
    sentence: "The spring {place} is {|k_b|} {k_b:stiffer/softer} above[ {x_0}] than below.",
    signature: "Even and odd harmonics, sub-harmonics; a knee on one side.",
    reference: "S. W. Shaw, P. J. Holmes, A periodically forced piecewise linear oscillator, J. Sound Vib. 90 (1983) 129-155",
};
