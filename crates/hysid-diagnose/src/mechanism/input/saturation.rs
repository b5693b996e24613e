//! An input that does not grow beyond a limit.

use crate::mechanism::limit::{each_side, limited};
use crate::mechanism::{Block, Family, Grid, Mechanism, Need, anywhere};
use crate::slot::Place;

/// An input that does not grow beyond a limit.
pub static INPUT_SATURATION: Mechanism = Mechanism {
    id: "input_saturation",
    family: Family::InputNonlinearity,
    block: Block::Input,
    places: &[Place::Input, Place::Between, Place::Command],
    applies: anywhere,
    already: &["max(min(u, P), Q)", "min(max(u, P), Q)", "min(u, P)", "max(u, P)", "u - P*max(u - Q, 0)"],
    law: |slot, purpose| {
        let quantiles = [0.5, 0.65, 0.8, 0.9, 0.95, 0.99, 0.997, 0.9995];
        if slot.place == Place::Between {
            // A stage inside a circuit or a drive train rarely cuts alike on both sides, or off: a diode bends one side only.
            return each_side("u", "u + s")
                .amplitude("a_p", "1", -1.0, 1.2)
                .amplitude("a_n", "1", -1.0, 1.2)
                .shape("s", "u", Grid::Quantiles("u", quantiles.to_vec()))
                .searched();
        }
        limited("u", &quantiles, purpose)
    },
    contains: &[],
    confusable: &["output_saturation", "input_polynomial"],
    needs: &[Need::Levels("u", 1.2)],
    sentence: "The input saturates[ at {s}][ at no more than {s_p}][ at no less than {s_n}] {place}; the simulation lets it grow.",
    signature: "The residual lives only where the input is large.",
    reference: "G. Tao, P. V. Kokotovic, Adaptive Control of Systems with Actuator and Sensor Nonlinearities, Wiley (1996)",
};
