//! An actuator that follows its command with a first-order lag.

use super::first_order;
use crate::mechanism::{Block, Family, Mechanism, Need, anywhere};
use crate::slot::Place;

/// An actuator that follows its command with a first-order lag.
pub static ACTUATOR_LAG: Mechanism = Mechanism {
    id: "actuator_lag",
    family: Family::SignalPathLag,
    block: Block::Input,
    places: &[Place::Input, Place::Command],
    applies: anywhere,
    already: &["lag(u, P)", "lag(y, P)"],
    law: |slot, purpose| {
        let s = if slot.place == Place::Sensor { "y" } else { "u" };
        first_order(s, purpose)
    },
    contains: &[],
    confusable: &["delay", "sensor_lag", "back_emf"],
    needs: &[Need::Band(1.5)],
    sentence: "The actuator follows its command with a lag of {tau} {place}; the simulation takes it as immediate.",
    signature: "A phase error and a roll-off; on a linear plant the same as a sensor's lag.",
    reference: "L. Ljung, System Identification: Theory for the User, 2nd ed. (1999)",
};
