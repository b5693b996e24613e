//! A sensor that follows with a first-order lag.

use super::first_order;
use crate::mechanism::{Block, Family, Mechanism, Need, anywhere};
use crate::slot::Place;

/// A sensor that follows with a first-order lag.
pub static SENSOR_LAG: Mechanism = Mechanism {
    id: "sensor_lag",
    family: Family::SignalPathLag,
    block: Block::Input,
    places: &[Place::Sensor],
    applies: anywhere,
    already: &["lag(u, P)", "lag(y, P)"],
    law: |slot, purpose| {
        let s = if slot.place == Place::Sensor { "y" } else { "u" };
        first_order(s, purpose)
    },
    contains: &[],
    confusable: &["delay", "actuator_lag", "viscoelastic"],
    needs: &[Need::Band(1.5)],
    sentence: "The sensor follows with a lag of {tau} {place}; the simulation takes it as immediate.",
    signature: "A phase error and a roll-off; on a linear plant the same as an actuator's lag.",
    reference: "L. Ljung, System Identification: Theory for the User, 2nd ed. (1999)",
};
