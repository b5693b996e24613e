//! A pure delay in the signal path.

use crate::mechanism::{Block, Family, Law, Mechanism, Need, Purpose, anywhere, log_grid};
use crate::slot::Place;

/// A pure delay in the signal path.
pub static DELAY: Mechanism = Mechanism {
    id: "delay",
    family: Family::SignalPathLag,
    block: Block::Input,
    places: &[Place::Input, Place::Command, Place::Sensor],
    applies: anywhere,
    already: &["delay(u, P)", "delay(y, P)"],
    law: |slot, purpose| {
        let s = if slot.place == Place::Sensor { "y" } else { "u" };
        let law = match purpose {
            Purpose::Screening => Law::replace(format!("{s} + w*(delay({s}, tau) - {s})")).weight(),
            Purpose::Refit | Purpose::Form(_) => Law::replace(format!("delay({s}, tau)")),
        };
        law.shape("tau", "h", log_grid(0.5, 20.0, 6)).within(0.0, 200.0).neutral(0.0)
    },
    contains: &[],
    confusable: &["actuator_lag", "sensor_lag"],
    needs: &[Need::Band(1.5)],
    sentence: "The signal is delayed by {tau} {place}; the simulation has no delay.",
    signature: "A phase error proportional to the frequency without an error of the amplitude.",
    reference: "L. Ljung, System Identification: Theory for the User, 2nd ed. (1999)",
};
