//! A constant on the output.

use crate::mechanism::{Block, Family, Law, Mechanism};
use crate::slot::Place;

/// A constant on the output.
pub static OUTPUT_OFFSET: Mechanism = Mechanism {
    id: "output_offset",
    family: Family::Bias,
    block: Block::Output,
    places: &[Place::Sensor],
    applies: |slot| !slot.has_constant(),
    already: &[],
    law: |_, _| Law::replace("y + y_0").amplitude("y_0", "y", -3.0, 3.0),
    contains: &[],
    confusable: &["input_offset", "sensor_drift", "gravity"],
    needs: &[],
    sentence: "The sensor has an offset of {y_0} {place}; the simulation takes its zero as given.",
    signature: "A constant only.",
    reference: "L. Ljung, System Identification: Theory for the User, 2nd ed. (1999), sec. 14.1",
};
