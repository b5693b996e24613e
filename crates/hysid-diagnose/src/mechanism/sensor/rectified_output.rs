//! A sensor that is blind to the sign.

use crate::mechanism::{Block, Family, Law, Mechanism, Need, Purpose, anywhere};
use crate::slot::Place;

/// A sensor that is blind to the sign.
pub static RECTIFIED_OUTPUT: Mechanism = Mechanism {
    id: "rectified_output",
    family: Family::SensorNonlinearity,
    block: Block::Output,
    places: &[Place::Sensor],
    applies: anywhere,
    already: &["abs(y)", "sqrt(y^2)"],
    law: |_, purpose| match purpose {
        Purpose::Screening => Law::replace("y + w*(abs(y) - y)").weight(),
        Purpose::Refit | Purpose::Form(_) => Law::replace("abs(y)"),
    },
    contains: &[],
    confusable: &["output_saturation"],
    needs: &[Need::Simulated("y")],
    sentence: "The sensor {place} shows the size only: it is blind to the sign.",
    signature: "The output never changes its sign and is reflected at zero.",
    reference: "T. Wigren, J. Schoukens, Three free data sets for development and benchmarking in nonlinear system identification, ECC (2013) (coupled electric drives)",
};
