//! A spring with a part of the squared displacement.

use crate::mechanism::{Block, Family, Law, Mechanism, Need};
use crate::slot::Place;

/// A spring with a part of the squared displacement.
pub static QUADRATIC_STIFFNESS: Mechanism = Mechanism {
    id: "quadratic_stiffness",
    family: Family::AsymmetricStiffness,
    block: Block::Restoring,
    places: &[Place::Force, Place::Connection, Place::ForceLaw, Place::Circuit],
    applies: |slot| slot.has("x"),
    already: &["x^2", "x*x"],
    law: |_, _| Law::force("k_2*x^2").amplitude("k_2", "F/x^2", -1.0, 1.0),
    contains: &[],
    confusable: &["input_offset", "gravity", "input_polynomial", "bilinear_stiffness"],
    needs: &[Need::BothSides("x"), Need::Levels("x", 1.5)],
    sentence: "The spring {place} is unequal on its two sides: a quadratic part of {k_2}.",
    signature: "The mean moves with the squared amplitude; even harmonics.",
    reference: "A. H. Nayfeh, D. T. Mook, Nonlinear Oscillations, Wiley (1979), sec. 4.1",
};
