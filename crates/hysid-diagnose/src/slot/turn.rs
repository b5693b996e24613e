//! The angle of what turns, where a simulation has its speed only.
//!
//! The poles of a motor, an unbalance, a crank act once or several times a turn: what they do depends on the angle, which a simulation of the speed alone does
//! without. It is added as a state that nothing uses. It is no displacement: where nobody saw an angle, no spring is looked for over it, only what returns
//! with the turn. Where a recording begins within a turn nobody knows: for another recording that is to be found out.

use std::f64::consts::PI;

use hysid_plant::{Expr, Initial, Simulation, State, Unit};

use super::motion::{motions, shown_unit};

/// What the names of such states begin with.
const TURN: &str = "turn";

/// Radians per second of one of a speed's units, as text units are written.
fn radians_per_second(unit: &Unit) -> Option<f64> {
    match unit.to_string().as_str() {
        "rad/s" => Some(1.0),
        "deg/s" => Some(PI / 180.0),
        "rev/s" => Some(2.0 * PI),
        "rpm" => Some(PI / 30.0),
        _ => None,
    }
}

/// Whether a unit is that of the speed of something that turns.
pub(super) fn is_rate_of_turn(unit: &Unit) -> bool {
    radians_per_second(unit).is_some()
}

/// The same simulation with an angle, in rad, for each speed of something that turns and has none.
pub(crate) fn with_turns(simulation: &Simulation) -> Simulation {
    let mut out = simulation.clone();
    for motion in motions(simulation, simulation).iter().filter(|m| m.x.is_none()) {
        let Some(factor) = shown_unit(simulation, motion.v).as_ref().and_then(radians_per_second) else { continue };
        let speed = Expr::symbol(motion.v);
        let derivative = if factor == 1.0 { speed } else { Expr::Number(factor) * speed };
        let (name, unit) = (out.fresh_symbol(TURN), Unit::parse("rad").ok());
        out.states.push(State { name, derivative, initial: Initial::Number(0.0), unit });
    }
    out
}

/// Whether a state is such an angle: nothing of the simulation as it was, `original`, uses it.
pub(crate) fn is_turn(original: &Simulation, name: &str) -> bool {
    name.starts_with(TURN) && !original.expressions().into_iter().any(|(_, e)| e.uses(name))
}

/// The simulation without the angles that the user's does not have and that nothing came to use; those that something uses begin anywhere within a turn.
pub(crate) fn with_used_turns(document: &Simulation, user: &Simulation) -> Simulation {
    let mut out = document.clone();
    let added = |s: &State| user.state(&s.name).is_none() && s.name.starts_with(TURN);
    out.states.retain(|s| !added(s) || !is_turn(document, &s.name));
    out.states.iter_mut().filter(|s| added(s)).for_each(|s| s.initial = Initial::Free);
    out
}

/// Whether a state is such an angle that something uses.
pub(crate) fn begins_anywhere(state: &State) -> bool {
    state.name.starts_with(TURN) && state.initial == Initial::Free
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rotor(unit: &str) -> Simulation {
        let text = format!(
            "[time]\nperiod_s = 0.01\n[inputs]\ni = \"i_A\"\n[parameters]\nJ = {{ value = 1.0, min = 0.1, max = 9.0 }}\nb = {{ value = 1.0, min = 0.1, max = 9.0 }}\n\
             [states]\nn = {{ derivative = \"(i - b*n)/J\", initial = 0.0, unit = \"{unit}\" }}\n[outputs]\nspeed = \"n\"\n"
        );
        Simulation::parse(&text, "rotor.sim.toml").unwrap()
    }

    #[test]
    fn what_turns_gets_an_angle_that_stays_where_something_uses_it() {
        for (unit, factor) in [("rad/s", 1.0), ("rpm", PI / 30.0), ("deg/s", PI / 180.0), ("rev/s", 2.0 * PI)] {
            let user = rotor(unit);
            let turning = with_turns(&user);
            let rate = &turning.states[1].derivative;
            let expected = if factor == 1.0 { Expr::symbol("n") } else { Expr::Number(factor) * Expr::symbol("n") };
            assert_eq!((rate, turning.states[1].name.as_str()), (&expected, "turn"));
            assert_eq!(with_used_turns(&turning, &user), user);
            let mut rippled = turning.clone();
            rippled.states[0].derivative = Expr::parse("(i - b*n - sin(7*turn))/J").unwrap();
            assert_eq!(with_used_turns(&rippled, &user).states[1].initial, Initial::Free);
            // Found again in what an effect was written into.
            let slots = super::super::Structure::within(&rippled, &turning).slots;
            let force = slots.iter().find(|s| s.label == "state:n").unwrap();
            assert!(force.has("turn") && !force.has("x"));
        }
        // What slides, and what has an angle, get none.
        let slides = rotor("m/s");
        assert_eq!(with_turns(&slides), slides);
        let mut turned = rotor("rad/s");
        turned.states.push(State {
            name: "q".into(),
            derivative: Expr::symbol("n"),
            initial: Initial::Number(0.0),
            unit: None,
        });
        assert_eq!(with_turns(&turned), turned);
    }
}
