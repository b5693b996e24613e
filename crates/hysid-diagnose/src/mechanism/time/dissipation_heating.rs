//! A parameter that follows the heat of the dissipated power.

use std::f64::consts::TAU;

use crate::mechanism::{Block, Family, Grid, Law, Mechanism, Need};
use crate::slot::Place;

/// A parameter that follows the heat of the dissipated power.
pub static DISSIPATION_HEATING: Mechanism = Mechanism {
    id: "dissipation_heating",
    family: Family::TimeVariation,
    block: Block::TimeVariation,
    places: &[Place::Parameter],
    applies: |slot| slot.has("v") && !slot.is_mass(),
    already: &["p*(1 + P*Z)"],
    law: |slot, _| {
        // What dissipates less when it is hot heats itself less.
        let heat = if slot.dissipates() { "((1 + beta*theta)*v^2 - theta)/tau_h" } else { "(v^2 - theta)/tau_h" };
        Law::replace("p*(1 + beta*theta)")
            .amplitude("beta", "1/v^2", -0.9, 3.0)
            .shape("tau_h", "T", Grid::Values(vec![0.05, 0.2, 0.6]))
            .within(0.01, 5.0)
            // One period of the motion.
            .told_from(TAU, "x/v", "what follows within one period of the motion is a law of the motion")
            .state("theta", "v^2", heat)
    },
    contains: &[],
    confusable: &["parameter_drift", "degradation"],
    needs: &[Need::ActivityChange("v")],
    sentence: "{parameter} follows the heat of the motion with a time constant of {tau_h}: {beta}.",
    signature: "It follows the activity and recovers in pauses.",
    reference: "B. Armstrong-Hélouvry, Control of Machines with Friction, Kluwer (1991)",
};
