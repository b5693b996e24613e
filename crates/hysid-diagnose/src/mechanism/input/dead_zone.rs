//! An input that does nothing while it is small.

use crate::mechanism::{Block, Family, Grid, Law, Mechanism, Need, Purpose, anywhere, log_steps};
use crate::slot::Place;

/// An input that does nothing while it is small.
pub static DEAD_ZONE: Mechanism = Mechanism {
    id: "dead_zone",
    family: Family::InputNonlinearity,
    block: Block::Input,
    places: &[Place::Input, Place::Between, Place::Command],
    applies: anywhere,
    already: &["max(min(u, P), Q)", "max(u - P, 0)"],
    law: |_, purpose| {
        let width = Grid::Reach("u", log_steps(0.01, 0.5, 5));
        match purpose {
            Purpose::Screening => Law::replace("u - w*max(min(u, d_z), -d_z)").weight().shape("d_z", "u", width),
            Purpose::Refit | Purpose::Form(_) => {
                Law::replace("u - max(min(u, d_z), -d_z)").shape("d_z", "u", width).within(0.0, 3.0).neutral(0.0)
            }
        }
    },
    contains: &[],
    confusable: &["coulomb_friction", "input_polynomial"],
    needs: &[Need::Levels("u", 1.3)],
    sentence: "The input does nothing below {d_z} {place}; the simulation has no dead zone.",
    signature: "No response to small inputs; the missing part of the input is a clipped copy of it.",
    reference: "G. Tao, P. V. Kokotovic, Adaptive Control of Systems with Actuator and Sensor Nonlinearities, Wiley (1996)",
};
