//! A parameter that drifts over the recording.

use crate::mechanism::{Block, Family, Grid, Law, Mechanism, Need, anywhere};
use crate::slot::Place;

/// A parameter that drifts over the recording.
pub static PARAMETER_DRIFT: Mechanism = Mechanism {
    id: "parameter_drift",
    family: Family::TimeVariation,
    block: Block::TimeVariation,
    places: &[Place::Parameter],
    applies: anywhere,
    already: &["p*(1 + P*t/Q)"],
    law: |_, _| {
        Law::replace("p*(1 + epsilon*t/T_r)")
            .amplitude("epsilon", "1", -0.9, 3.0)
            .constant("T_r", "T", Grid::Values(vec![1.0]))
            .silent()
    },
    contains: &[],
    confusable: &["abrupt_change", "degradation", "dissipation_heating"],
    needs: &[Need::EarlyAndLate("y")],
    sentence: "{parameter} drifts by the share {epsilon} over the recording; the simulation holds it constant.",
    signature: "The residual grows away from the middle of the recording.",
    reference: "M. Niedzwiecki, Identification of Time-varying Processes, Wiley (2000)",
};
