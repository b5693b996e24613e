//! A spring that stiffens (or softens) with the cube of the displacement.

use crate::mechanism::{Block, Family, Law, Mechanism, Need};
use crate::slot::Place;

/// A spring that stiffens (or softens) with the cube of the displacement.
pub static CUBIC_STIFFNESS: Mechanism = Mechanism {
    id: "cubic_stiffness",
    family: Family::HardeningStiffness,
    block: Block::Restoring,
    places: &[Place::Force, Place::Connection, Place::ForceLaw, Place::Circuit],
    applies: |slot| slot.has("x"),
    already: &["x^3", "x*x*x", "x*x^2", "x^2*x"],
    law: |_, _| Law::force("k_3*x^3").amplitude("k_3", "F/x^3", -1.0, 1.0),
    contains: &[],
    confusable: &["quintic_stiffness", "gap_stop", "output_saturation"],
    needs: &[Need::Levels("x", 1.5)],
    sentence: "The spring {place} has a cubic part of {k_3}; the simulation takes it as linear.",
    signature: "The resonance moves with the squared amplitude; third harmonic; odd.",
    reference: "G. Duffing, Erzwungene Schwingungen bei veränderlicher Eigenfrequenz, Vieweg (1918)",
};
