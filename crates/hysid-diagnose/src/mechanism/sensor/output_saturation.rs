//! A sensor that does not go beyond a limit.

use crate::mechanism::limit::limited;
use crate::mechanism::{Block, Family, Mechanism, anywhere};
use crate::slot::Place;

/// A sensor that does not go beyond a limit.
pub static OUTPUT_SATURATION: Mechanism = Mechanism {
    id: "output_saturation",
    family: Family::SensorNonlinearity,
    block: Block::Output,
    places: &[Place::Sensor],
    applies: anywhere,
    already: &["max(min(y, P), Q)", "min(max(y, P), Q)", "min(y, P)", "max(y, P)"],
    law: |_, purpose| limited("y", &[0.5, 0.7, 0.85, 0.93, 0.98, 0.995, 0.999, 0.9998], purpose),
    contains: &[],
    confusable: &["input_saturation", "cubic_stiffness", "gap_stop"],
    needs: &[],
    sentence: "The sensor saturates[ at {s}][ at no more than {s_p}][ at no less than {s_n}] {place}; the simulation's output goes beyond.",
    signature: "Plateaus at one value of the output.",
    reference: "G. Tao, P. V. Kokotovic, Adaptive Control of Systems with Actuator and Sensor Nonlinearities, Wiley (1996)",
};
