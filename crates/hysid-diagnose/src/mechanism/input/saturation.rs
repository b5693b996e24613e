//! An input that does not grow beyond a limit.

use crate::mechanism::limit::{each_side, limited};
use crate::mechanism::{Block, Family, Form, Grid, Law, Mechanism, Need, Purpose, anywhere};
use crate::slot::Place;

/// An input that does not grow beyond a limit.
pub static INPUT_SATURATION: Mechanism = Mechanism {
    id: "input_saturation",
    family: Family::InputNonlinearity,
    block: Block::Input,
    places: &[Place::Input, Place::Prescribed, Place::Between, Place::Command],
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
        // What gives way by and by, an amplifier or a core (Froelich's curve): the recording need not come near the limit. Of a prescribed motion, or of the
        // force that is measured under it, it would imitate whatever softens (a rocking wall, a damper): these and sensors have no such forms.
        let by_and_by = |text: &str| {
            let reach = Grid::Reach("u", vec![0.7, 1.5, 3.0, 6.0]);
            Law::replace(text).shape("s_t", "u", reach).silent().report("s", "u", "s_t")
        };
        match purpose {
            _ if slot.place == Place::Prescribed => limited("u", &quantiles, purpose),
            Purpose::Form(Form::Soft) => by_and_by("s_t*tanh(u/s_t)"),
            Purpose::Form(Form::Softer) => by_and_by("u/(1 + abs(u)/s_t)"),
            _ => limited("u", &quantiles, purpose),
        }
    },
    contains: &[],
    confusable: &["output_saturation", "input_polynomial"],
    needs: &[Need::Levels("u", 1.2)],
    sentence: "The input saturates[ at {s}][ at no more than {s_p}][ at no less than {s_n}] {place}; the simulation lets it grow.",
    signature: "The residual lives only where the input is large.",
    reference: "G. Tao, P. V. Kokotovic, Adaptive Control of Systems with Actuator and Sensor Nonlinearities, Wiley (1996)",
};
