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

#[cfg(test)]
mod tests {
    use hysid_plant::Simulation;

    use super::*;
    use crate::mechanism::conformance::{benches, example_signals};
    use crate::slot::Structure;

    /// Heat that follows within a period of the motion is told from there on, in seconds.
    #[test]
    fn the_period_of_the_motion_is_the_least_time_constant_of_heat() {
        let mut seen = 0;
        for bench in benches().iter().filter(|b| b.simulation.state("v").is_some() && b.simulation.state("x").is_some())
        {
            // A current is no motion.
            for (slot, signals) in bench.slots(&DISSIPATION_HEATING).into_iter().filter(|(slot, _)| slot.has("x")) {
                let (Some(x), Some(v)) = (signals.size("x"), signals.size("v")) else { panic!("{slot}") };
                let written = DISSIPATION_HEATING.rewrite(&bench.simulation, &slot, &signals, Purpose::Refit).unwrap();
                let (from, _) = written.shapes[0].told_from.unwrap();
                assert!((from * v / (TAU * x) - 1.0).abs() < 1e-12, "{slot}: {from}");
                seen += 1;
            }
        }
        assert!(seen > 0);
    }

    /// The power that heats follows the square of the motion, or its size where the force has a size of its own; a current heats what resists it.
    #[test]
    fn heat_follows_the_power_that_is_dissipated() {
        let text = "[time]\nperiod_s = 0.001\n[inputs]\nu = \"u_V\"\n[parameters]\nR = { value = 2.0, min = 0.1, unit = \"Ohm\" }\n\
                    L = { value = 0.1, min = 0.01, unit = \"H\" }\n[states]\ni = { derivative = \"(u - R*i)/L\", initial = 0.0, unit = \"A\" }\n\
                    [outputs]\ni_A = \"i\"\n";
        let simulation = Simulation::parse(text, "winding.sim.toml").unwrap();
        let slots = DISSIPATION_HEATING.slots(&Structure::of(&simulation));
        assert_eq!(slots.iter().map(|s| s.label.as_str()).collect::<Vec<_>>(), ["parameter:R"]);
        let signals = example_signals(&simulation, &slots[0]);
        let heat = |purpose| {
            let written = DISSIPATION_HEATING.rewrite(&simulation, &slots[0], &signals, purpose).unwrap().simulation;
            written.state("theta").unwrap().derivative.to_string()
        };
        assert_eq!(heat(Purpose::Refit), "((1 + beta*theta)*i^2 - theta)/tau_h");
        assert_eq!(heat(Purpose::Form(Form::Other)), "((1 + beta*theta)*abs(i) - theta)/tau_h");
        // A recorded current heats what it passes through.
        let cell = "[time]\nperiod_s = 1.0\n[inputs]\ni = \"current_A\"\n[parameters]\ne0 = { value = 4.0, min = 0.1, unit = \"V\" }\nR0 = { value = 0.05, min = 0.01, unit = \"ohm\" }\n\
                    R1 = { value = 0.02, min = 0.01, unit = \"ohm\" }\ntau = { value = 30.0, min = 1.0, unit = \"s\" }\n[states]\nv1 = { derivative = \"(i*R1 - v1)/tau\", initial = 0.0, unit = \"V\" }\n\
                    [outputs]\ncell_V = \"e0 - R0*i - v1\"\n";
        let cell = Simulation::parse(cell, "cell.sim.toml").unwrap();
        let resistors: Vec<String> =
            DISSIPATION_HEATING.slots(&Structure::of(&cell)).into_iter().map(|s| s.label).collect();
        assert_eq!(resistors, ["parameter:R0", "parameter:R1"]);
    }
}
