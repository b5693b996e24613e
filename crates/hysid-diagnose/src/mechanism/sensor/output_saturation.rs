//! A sensor that does not go beyond a limit.

use crate::mechanism::{Block, Family, Grid, Law, Mechanism, Purpose, anywhere};
use crate::slot::Place;

/// A sensor that does not go beyond a limit.
pub static OUTPUT_SATURATION: Mechanism = Mechanism {
    id: "output_saturation",
    family: Family::SensorNonlinearity,
    block: Block::Output,
    places: &[Place::Sensor],
    applies: anywhere,
    already: &["max(min(y, P), Q)", "min(max(y, P), Q)"],
    law: |_, purpose| {
        let level = Grid::Quantiles("y", vec![0.5, 0.7, 0.85, 0.93, 0.98, 0.995]);
        match purpose {
            Purpose::Screening => {
                Law::replace("y + w*(max(min(y, s), -s) - y)").weight().shape("s", "y", level).searched()
            }
            Purpose::Refit | Purpose::Form(_) => Law::replace("max(min(y, s), -s)").shape("s", "y", level).searched(),
        }
    },
    contains: &[],
    confusable: &["input_saturation", "cubic_stiffness", "gap_stop"],
    needs: &[],
    sentence: "The sensor saturates at {s} {place}; the simulation's output goes beyond.",
    signature: "Plateaus at one value of the output.",
    reference: "G. Tao, P. V. Kokotovic, Adaptive Control of Systems with Actuator and Sensor Nonlinearities, Wiley (1996)",
};
