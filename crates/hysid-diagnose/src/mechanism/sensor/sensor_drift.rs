//! A sensor whose zero drifts.

use crate::mechanism::time::settling;
use crate::mechanism::{Block, Family, Form, Law, Mechanism, Purpose, anywhere};
use crate::slot::Place;

/// A sensor whose zero drifts.
pub static SENSOR_DRIFT: Mechanism = Mechanism {
    id: "sensor_drift",
    family: Family::SensorDrift,
    block: Block::Output,
    places: &[Place::Sensor],
    applies: anywhere,
    already: &["P*t"],
    law: |_, purpose| match purpose {
        // An amplifier that warms up.
        Purpose::Form(Form::Finer) => {
            settling(Law::replace("y + d_e*(1 - exp(-t/tau_d))").amplitude("d_e", "y", -3.0, 3.0))
        }
        _ => Law::replace("y + d_1*t").amplitude("d_1", "y/T", -3.0, 3.0),
    },
    contains: &[],
    confusable: &["log_creep", "output_offset", "parameter_drift"],
    needs: &[],
    sentence: "The sensor's zero drifts[ by {d_1}][ by {d_e} with a time constant of {tau_d}] {place}; the simulation's does not.",
    signature: "Very slow and independent of the input.",
    reference: "L. Ljung, System Identification: Theory for the User, 2nd ed. (1999), sec. 14.1",
};
