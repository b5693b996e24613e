//! A parameter that drifts over the recording.

use super::settling;
use crate::mechanism::{Block, Family, Form, Grid, Law, Mechanism, Need, Purpose, anywhere};
use crate::slot::Place;

/// A parameter that drifts over the recording.
pub static PARAMETER_DRIFT: Mechanism = Mechanism {
    id: "parameter_drift",
    family: Family::TimeVariation,
    block: Block::TimeVariation,
    places: &[Place::Parameter],
    applies: anywhere,
    already: &["p*(1 + P*t/Q)"],
    law: |_, purpose| {
        let drift = |course: &str| {
            Law::replace(format!("p*(1 + epsilon*{course})"))
                .amplitude("epsilon", "1", -0.9, 3.0)
                .constant("T_r", "T", Grid::Values(vec![1.0]))
                .silent()
        };
        // What warms up or wears in comes to an end.
        match purpose {
            Purpose::Form(Form::Finer) => settling(drift("(1 - exp(-t/tau_d))/(1 - exp(-T_r/tau_d))")),
            _ => drift("t/T_r"),
        }
    },
    contains: &[],
    confusable: &["abrupt_change", "degradation", "dissipation_heating"],
    needs: &[Need::EarlyAndLate("y")],
    sentence: "{parameter} drifts by the share {epsilon} over the recording[, with a time constant of {tau_d}]; the simulation holds it constant.",
    signature: "The residual grows away from the middle of the recording.",
    reference: "M. Niedzwiecki, Identification of Time-varying Processes, Wiley (2000)",
};
