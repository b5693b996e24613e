//! Damping that grows with the displacement.

use crate::mechanism::{Block, Family, Law, Mechanism, Need};
use crate::slot::Place;

/// Damping that grows with the displacement.
pub static DISPLACEMENT_DEPENDENT_DAMPING: Mechanism = Mechanism {
    id: "displacement_dependent_damping",
    family: Family::NonlinearDamping,
    block: Block::Damping,
    places: &[Place::Force, Place::Connection, Place::ForceLaw],
    applies: |slot| slot.has("x") && slot.has("v"),
    already: &["x^2*v", "v*x^2"],
    law: |_, _| Law::force("c_x*x^2*v").amplitude("c_x", "F/(v*x^2)", -2.0, 2.0),
    contains: &[],
    confusable: &["quadratic_damping"],
    needs: &[Need::Levels("x", 1.5)],
    sentence: "Damping {place} grows with the square of the displacement: {c_x}.",
    signature: "Damping proportional to the squared amplitude, largest where large swings are fast.",
    reference: "B. van der Pol, On relaxation-oscillations, Philos. Mag. 2 (1926) 978-992",
};
