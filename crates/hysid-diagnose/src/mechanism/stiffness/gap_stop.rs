//! Elastic stops beyond a gap on both sides.

use crate::mechanism::{Block, Family, Grid, Law, Mechanism, Need};
use crate::slot::Place;

/// Elastic stops beyond a gap on both sides.
pub static GAP_STOP: Mechanism = Mechanism {
    id: "gap_stop",
    family: Family::HardeningStiffness,
    block: Block::Restoring,
    places: &[Place::Force, Place::Connection, Place::ForceLaw, Place::Circuit],
    applies: |slot| slot.has("x"),
    already: &["max(x - P, 0)", "max(0, x - P)", "max(abs(x) - P, 0)", "max(0, abs(x) - P)"],
    law: |_, _| {
        Law::force("k_g*(max(x - g, 0) - max(-x - g, 0))")
            .amplitude("k_g", "F/x", -2.0, 50.0)
            .shape("g", "x", Grid::Quantiles("x", vec![0.3, 0.45, 0.6, 0.7, 0.8, 0.87, 0.93, 0.97, 0.99, 0.998]))
            .searched()
    },
    contains: &[],
    confusable: &["cubic_stiffness", "quintic_stiffness"],
    needs: &[Need::Levels("x", 1.5)],
    sentence: "Beyond {g} on either side the stiffness {place} changes by {k_g}: a stop where it grows, a softening where it falls.",
    signature: "A knee at |x| = g; the residual lives only outside the gap.",
    reference: "S. W. Shaw, P. J. Holmes, A periodically forced piecewise linear oscillator, J. Sound Vib. 90 (1983) 129-155",
};
