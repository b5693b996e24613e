//! A parameter that follows the heat of the dissipated power.

use std::f64::consts::TAU;

use crate::mechanism::{Block, Family, Form, Grid, Law, Mechanism, Need, Purpose};
use crate::slot::Place;

/// A parameter that follows the heat of the dissipated power.
pub static DISSIPATION_HEATING: Mechanism = Mechanism {
    id: "dissipation_heating",
    family: Family::TimeVariation,
    block: Block::TimeVariation,
    places: &[Place::Parameter],
    applies: |slot| slot.has("v") && !slot.is_mass(),
    already: &["p*(1 + P*Z)"],
    law: |slot, purpose| {
        // What dissipates less when it is hot heats itself less.
        let share = if slot.dissipates() { "(1 + beta*theta)*" } else { "" };
        // The power of a force in proportion to the speed, of one that has a size of its own at any speed, or of all that the equations have, in which the parameter
        // is replaced as everywhere.
        let (power, measure) = match purpose {
            Purpose::Form(Form::Other) => (format!("{share}abs(v)"), "v"),
            Purpose::Form(Form::Finer) if slot.has("heat") => ("heat".to_owned(), "heat"),
            _ => (format!("{share}v^2"), "v^2"),
        };
        Law::replace("p*(1 + beta*theta)")
            .amplitude("beta", format!("1/{measure}"), -0.9, 3.0)
            .shape("tau_h", "T", Grid::Values(vec![0.05, 0.2, 0.6]))
            .within(0.01, 5.0)
            // One period of the motion.
            .told_from(TAU, "x/v", "what follows within one period of the motion is a law of the motion")
            .state("theta", measure, format!("({power} - theta)/tau_h"))
    },
    contains: &[],
    confusable: &["parameter_drift", "degradation"],
    needs: &[Need::ActivityChange("v")],
    sentence: "{parameter} follows the heat that is dissipated with a time constant of {tau_h}: {beta}.",
    signature: "It follows the activity and recovers in pauses.",
    reference: "B. Armstrong-Hélouvry, Control of Machines with Friction, Kluwer (1991)",
};
