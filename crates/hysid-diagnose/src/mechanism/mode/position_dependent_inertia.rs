//! An inertia that depends on the position.

use crate::mechanism::{Block, Family, Law, Mechanism, Need};
use crate::slot::{OWN_VELOCITY, Place};

/// An inertia that depends on the position.
pub static POSITION_DEPENDENT_INERTIA: Mechanism = Mechanism {
    id: "position_dependent_inertia",
    family: Family::Inertia,
    block: Block::Inertia,
    places: &[Place::Force],
    applies: |slot| slot.has("x") && slot.has_own_coordinate() && !slot.shows("x*v^2") && !slot.mass_varies(),
    already: &[],
    law: |slot, _| {
        let measure = format!("{}/x^2", slot.mass_measure());
        let force = if slot.has(OWN_VELOCITY) { "m_1*x*v*v_own" } else { "m_1*x*v^2" };
        Law::inertia(force, "m_1*x^2").amplitude("m_1", measure, -0.1, 2.0)
    },
    contains: &[],
    confusable: &["cubic_stiffness"],
    needs: &[Need::Levels("x", 1.5)],
    sentence: "The moving mass {place} grows with the square of the displacement: {m_1}.",
    signature: "The resonance falls with the amplitude, and more at high frequency.",
    reference: "A. H. Nayfeh, D. T. Mook, Nonlinear Oscillations, Wiley (1979), sec. 4.2",
};
