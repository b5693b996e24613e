//! A spring that stiffens with the fifth power of the displacement.

use crate::mechanism::{Block, Family, Law, Mechanism, Need};
use crate::slot::Place;

/// A spring that stiffens with the fifth power of the displacement.
pub static QUINTIC_STIFFNESS: Mechanism = Mechanism {
    id: "quintic_stiffness",
    family: Family::HardeningStiffness,
    block: Block::Restoring,
    places: &[Place::Force, Place::Connection, Place::ForceLaw, Place::Circuit],
    applies: |slot| slot.has("x"),
    already: &["x^5"],
    law: |_, _| Law::force("k_5*x^5").amplitude("k_5", "F/x^5", -0.5, 0.5),
    contains: &[],
    confusable: &["cubic_stiffness", "gap_stop"],
    needs: &[Need::Levels("x", 1.5)],
    sentence: "The spring {place} has a part of the fifth power, {k_5}; the simulation takes it as linear.",
    signature: "The resonance moves with the fourth power of the amplitude.",
    reference: "A. Ben Abdessalem, N. Dervilis, D. Wagg, K. Worden, Model selection and parameter estimation in structural dynamics using approximate Bayesian computation, Mech. Syst. Signal Process. 99 (2018) 306-325",
};
