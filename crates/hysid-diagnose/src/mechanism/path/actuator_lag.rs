//! An actuator that follows its command with a first-order lag.

use crate::mechanism::{Block, Family, Law, Mechanism, Need, Purpose, anywhere, log_grid};
use crate::slot::Place;

/// An actuator that follows its command with a first-order lag.
pub static ACTUATOR_LAG: Mechanism = Mechanism {
    id: "actuator_lag",
    family: Family::SignalPathLag,
    block: Block::Input,
    places: &[Place::Input],
    applies: anywhere,
    already: &["lag(u, P)", "lag(y, P)"],
    law: |slot, purpose| {
        let s = if slot.place == Place::Sensor { "y" } else { "u" };
        let law = match purpose {
            Purpose::Screening => Law::replace(format!("{s} + w*(lag({s}, tau) - {s})")).weight(),
            Purpose::Refit | Purpose::Finer => Law::replace(format!("lag({s}, tau)")),
        };
        law.shape("tau", "h", log_grid(0.5, 50.0, 6)).within(0.02, 2000.0)
    },
    contains: &[],
    confusable: &["delay", "sensor_lag", "back_emf"],
    needs: &[Need::Band(1.5)],
    sentence: "The actuator follows its command with a lag of {tau} {place}; the simulation takes it as immediate.",
    signature: "A phase error and a roll-off; on a linear plant the same as a sensor's lag.",
    reference: "L. Ljung, System Identification: Theory for the User, 2nd ed. (1999)",
};
