//! Hysteresis of an actuator whose loop widens with the rate.

use super::plays::Plays;
use crate::mechanism::{Block, Family, Grid, Law, Mechanism, Need, Purpose, anywhere, log_grid};
use crate::slot::Place;

/// A half-width of a play that grows in proportion to the rate. The rate is that of the way from the sample before: a central difference is nearly
/// blind to what turns at every sample, and such inputs widen the loop most.
fn widened(half_width: &str) -> String {
    format!("{half_width}*(1 + lambda*abs(u - delay(u, h_u))/h_u)")
}

/// Plays that the simulation has widen, all of them by one share.
fn of_own_plays() -> Law {
    Law::replace(widened("r")).amplitude("lambda", "h/u", 0.0, 1000.0).constant("h_u", "h_u", Grid::Values(vec![1.0]))
}

/// Hysteresis of an actuator whose loop widens with the rate.
pub static RATE_DEPENDENT_HYSTERESIS: Mechanism = Mechanism {
    id: "rate_dependent_hysteresis",
    family: Family::ActuatorHysteresis,
    block: Block::Hysteresis,
    places: &[Place::Input, Place::Plays],
    applies: anywhere,
    already: &["play(u, R)", "play(u + P, R)", "1 + P*abs(D)", "1 + P*abs(D)/H"],
    law: |slot, purpose| {
        if slot.place == Place::Plays {
            return of_own_plays();
        }
        // Plays in series with a lag do to first order what thresholds that grow with the rate do, each play by a lag of its own where they
        // grow in proportion; only sharp recordings tell the difference.
        let plays = Plays::settled(purpose);
        let wide = |r: &str| format!("play(u, {})", widened(r));
        match purpose {
            Purpose::Screening | Purpose::Refit => plays
                .law(plays.sum(|r| format!("lag(play(u, {r}), tau)")))
                .shape("tau", "h", log_grid(0.5, 50.0, 4))
                .within(0.05, 1000.0),
            Purpose::Form(_) => plays
                .law(plays.sum(wide))
                .shape("lambda", "h/u", Grid::Values(vec![0.5, 5.0]))
                .within(0.0, 1000.0)
                .constant("h_u", "h_u", Grid::Values(vec![1.0])),
        }
    },
    contains: &["prandtl_ishlinskii", "backlash"],
    confusable: &["prandtl_ishlinskii", "actuator_lag", "viscoelastic"],
    needs: &[Need::Turns(12), Need::Band(4.0)],
    sentence: "The actuator {place} has a hysteresis loop that widens with the rate[: its plays carry {share} of the gain][ and lag by {tau}][; each unit of the rate widens them by the share {lambda}].",
    signature: "The loop widens with the frequency but does not vanish at slow rates.",
    reference: "M. Al Janaideh, S. Rakheja, C.-Y. Su, An analytical generalized Prandtl-Ishlinskii model inversion, IEEE/ASME Trans. Mechatron. 16 (2011) 734-744; W. T. Ang, P. K. Khosla, C. N. Riviere (2007)",
};

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use hysid_plant::{Compiled, Drive, Run, Simulation};

    use super::*;
    use crate::mechanism::{Form, Signals};
    use crate::slot::Structure;

    /// Plays whose half-width is that of the rate from one sample to the next.
    fn by_samples(u: &[f64], period: f64, radius: f64, lambda: f64) -> Vec<f64> {
        let mut w = 0.0f64;
        let mut before = u[0];
        u.iter()
            .map(|&now| {
                let r = radius * (1.0 + lambda * ((now - before) / period).abs());
                before = now;
                w = w.min(now + r).max(now - r);
                w
            })
            .collect()
    }

    #[test]
    fn plays_that_a_simulation_has_widen_together() {
        let text = include_str!("../specimens/stack.sim.toml");
        let simulation = Simulation::parse(text, "stack.sim.toml").unwrap();
        let slots = RATE_DEPENDENT_HYSTERESIS.slots(&Structure::of(&simulation));
        let [slot] = slots.as_slice() else { panic!("{slots:?}") };
        let input: Vec<f64> = (0..400).map(|i| 9.0 * (0.02 * f64::from(i).powf(1.3)).sin()).collect();
        let signals = Signals::new(0.01, 0.0, BTreeMap::from([("u".to_owned(), input)]));
        let written =
            RATE_DEPENDENT_HYSTERESIS.rewrite(&simulation, slot, &signals, Purpose::Refit).unwrap().simulation;
        let wide = "*(1 + lambda*abs(u - delay(u, h_u))/h_u)";
        let y = written.outputs[0].expression.to_string();
        for r in ["r_1", "r_2"] {
            assert!(y.contains(&format!("play(u, {r}{wide})")), "{y}");
        }
        // An input may be called as a half-width is in the law's text.
        let renamed = text.replace("u = \"u_V\"", "r = \"u_V\"").replace("g*u", "g*r").replace("play(u,", "play(r,");
        let other = Simulation::parse(&renamed, "stack.sim.toml").unwrap();
        let there = RATE_DEPENDENT_HYSTERESIS.slots(&Structure::of(&other)).swap_remove(0);
        let of_other = RATE_DEPENDENT_HYSTERESIS.rewrite(&other, &there, &signals, Purpose::Refit).unwrap().simulation;
        let same = y.replace("*u ", "*r ").replace("(u", "(r").replace("abs(u", "abs(r");
        assert_eq!(of_other.outputs[0].expression.to_string(), same);
        // What widens already is no candidate, and neither is a further operator beside the plays.
        assert!(RATE_DEPENDENT_HYSTERESIS.slots(&Structure::of(&written)).is_empty());
    }

    #[test]
    fn the_rate_is_that_of_the_piece_between_two_samples_however_the_input_is_held() {
        let period = 0.01;
        let input: Vec<f64> =
            (0..400).map(|i| 9.0 * (1.3 * f64::from(i)).sin() * (0.013 * f64::from(i)).cos()).collect();
        let (p, lambda) = (0.06, 5e-4);
        // On a straight line every part of a piece has its rate; a held input moves at the samples only.
        for (hold, parts) in [("linear", 32), ("zero", 1)] {
            let text = format!(
                "title = \"Actuator\"\n[time]\nperiod_s = 0.01\nhold = \"{hold}\"\n[inputs]\nu = \"u_V\"\n[parameters]\n\
                 g = {{ value = 1.0, min = 0.1, max = 10.0, unit = \"um/V\" }}\n\
                 tau = {{ value = 0.02, min = 0.001, max = 1.0, unit = \"s\" }}\n\
                 [states]\nx = {{ derivative = \"(g*u - x)/tau\", initial = 0.0 }}\n[outputs]\ny_um = \"x\"\n"
            );
            let simulation = Simulation::parse(&text, "actuator.sim.toml").unwrap();
            let slot = RATE_DEPENDENT_HYSTERESIS.slots(&Structure::of(&simulation)).swap_remove(0);
            let signals =
                Signals::new(period, 0.0, BTreeMap::from([("u".to_owned(), input.clone())])).held(simulation.time.hold);
            let purpose = Purpose::Form(Form::Spaced);
            let mut written =
                RATE_DEPENDENT_HYSTERESIS.rewrite(&simulation, &slot, &signals, purpose).unwrap().simulation;
            let mut set = |name: &str, value: f64| written.parameter_mut(name).unwrap().value = value;
            (1..=6).for_each(|i| set(&format!("p_{i}"), if i == 2 { p } else { 0.0 }));
            set("r_s", 1.5);
            set("lambda", lambda);
            let finer: Vec<f64> = input
                .windows(2)
                .flat_map(|w| (0..parts).map(move |i| w[0] + (w[1] - w[0]) * f64::from(i) / f64::from(parts)))
                .chain(input.last().copied())
                .collect();
            let short = period / f64::from(parts);
            let answer = |simulation: &Simulation, period: f64, input: &[f64]| {
                let compiled = Compiled::new(simulation).unwrap();
                let drive = Drive::new(0.0, period, input.len(), vec![input.to_vec()]).unwrap();
                let mut outputs =
                    compiled.simulate(&Run { substeps: 8, ..Run::new(&drive, &compiled.theta()) }).outputs;
                outputs.swap_remove(0)
            };
            let bent: Vec<f64> =
                by_samples(&finer, short, 3.0, lambda).iter().zip(&finer).map(|(w, u)| u + p * (w - u)).collect();
            let (y, plain) = (answer(&written, period, &input), answer(&simulation, period, &input));
            let expected: Vec<f64> = answer(&simulation, short, &bent).into_iter().step_by(parts as usize).collect();
            let off = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
            assert_eq!(expected.len(), y.len());
            let (error, effect) = (off(&y, &expected), off(&plain, &expected));
            assert!(error < 0.1 * effect, "{hold}: {error} of {effect}");
        }
    }
}
