//! A sensor with coarse steps.

use crate::mechanism::{Block, Family, Grid, Law, Mechanism, Need, Purpose, anywhere};
use crate::slot::Place;

/// A sensor with coarse steps.
pub static QUANTISATION: Mechanism = Mechanism {
    id: "quantisation",
    family: Family::SensorNonlinearity,
    block: Block::Output,
    places: &[Place::Sensor],
    applies: anywhere,
    already: &["floor(y/P + Q)"],
    law: |_, purpose| match purpose {
        Purpose::Screening => Law::replace("y + w*(q*floor(y/q + 0.5) - y)").weight().shape("q", "y", Grid::Resolution),
        Purpose::Refit | Purpose::Form(_) => Law::replace("q*floor(y/q + 0.5)").constant("q", "y", Grid::Resolution),
    },
    contains: &[],
    confusable: &["backlash"],
    needs: &[Need::Steps],
    sentence: "The sensor {place} has steps of {q}; the simulation's output is continuous.",
    signature: "Repeated values; a residual that is uniform within half a step.",
    reference: "B. Widrow, I. Kollár, Quantization Noise, Cambridge University Press (2008)",
};
