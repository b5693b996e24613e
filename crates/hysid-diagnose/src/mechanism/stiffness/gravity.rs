//! The weight of an arm or a pendulum.

use crate::mechanism::{Block, Family, Law, Mechanism, Need};
use crate::slot::Place;

/// The weight of an arm or a pendulum.
pub static GRAVITY: Mechanism = Mechanism {
    id: "gravity",
    family: Family::Gravity,
    block: Block::Restoring,
    places: &[Place::Force],
    applies: |slot| slot.has("x") && slot.has("rad"),
    already: &["sin(rad*x)", "sin(x)", "sin(P*x)", "sin(x*P)", "sin(x + P)", "sin(x - P)", "cos(x)", "cos(x + P)"],
    law: |_, _| {
        Law::force("G_s*sin(rad*x) + G_c*cos(rad*x)")
            .amplitude("G_s", "F", -2.0, 2.0)
            .silent()
            .amplitude("G_c", "F", -2.0, 2.0)
            .silent()
            .report("G", "F", "sqrt(G_s^2 + G_c^2)")
            .report("phi", "1", "atan2(G_c, G_s)")
    },
    contains: &[],
    confusable: &["input_offset", "cubic_stiffness", "quadratic_stiffness"],
    needs: &[Need::Angle(0.3)],
    sentence: "A weight pulls {place}: up to {G}, as the sine of the angle plus {phi} rad; the simulation has none.",
    signature: "For small swings a stiffness and an offset; for large ones softening.",
    reference: "A. H. Nayfeh, D. T. Mook, Nonlinear Oscillations, Wiley (1979), ch. 2",
};
