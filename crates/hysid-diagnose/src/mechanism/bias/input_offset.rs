//! A constant on the input.

use crate::mechanism::{Block, Family, Law, Mechanism};
use crate::slot::Place;

/// A constant on the input.
pub static INPUT_OFFSET: Mechanism = Mechanism {
    id: "input_offset",
    family: Family::Bias,
    block: Block::Input,
    places: &[Place::Input],
    applies: |slot| !slot.has_constant(),
    already: &[],
    law: |_, _| Law::replace("u + u_0").amplitude("u_0", "u", -3.0, 3.0),
    contains: &[],
    confusable: &["output_offset", "gravity", "asymmetric_friction"],
    needs: &[],
    sentence: "The input has an offset of {u_0} {place}; the simulation takes its zero as given.",
    signature: "A constant only.",
    reference: "L. Ljung, System Identification: Theory for the User, 2nd ed. (1999), sec. 14.1",
};
