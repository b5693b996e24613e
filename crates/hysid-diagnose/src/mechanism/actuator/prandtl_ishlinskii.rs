//! Hysteresis of an actuator as a weighted sum of backlashes.

use super::plays::Plays;
use crate::mechanism::{Block, Family, Mechanism, Need, anywhere};
use crate::slot::Place;

/// Hysteresis of an actuator as a weighted sum of backlashes.
pub static PRANDTL_ISHLINSKII: Mechanism = Mechanism {
    id: "prandtl_ishlinskii",
    family: Family::ActuatorHysteresis,
    block: Block::Hysteresis,
    places: &[Place::Input, Place::Command],
    applies: anywhere,
    already: &["play(u, R)", "play(u + P, R)"],
    law: |_, purpose| {
        let plays = Plays(purpose);
        plays.law(plays.simply())
    },
    contains: &["backlash"],
    confusable: &["backlash", "bouc_wen", "log_creep"],
    needs: &[Need::Turns(6), Need::Levels("u", 1.3)],
    sentence: "The actuator {place} has a rate-independent hysteresis loop, a sum of plays, which carry {share} of its gain.",
    signature: "A loop at any rate, the same for the same turning points (wiping out, congruency).",
    reference: "K. Kuhnen, Modeling, identification and compensation of complex hysteretic nonlinearities, Eur. J. Control 9 (2003) 407-418",
};

#[cfg(test)]
mod tests {
    use hysid_plant::Simulation;

    use super::*;
    use crate::mechanism::Purpose;
    use crate::mechanism::conformance::example_signals;
    use crate::slot::Structure;

    #[test]
    fn beside_the_rate_of_an_input_its_plays_stand_in_its_place() {
        let text = "[time]\nperiod_s = 0.001\n[inputs]\nV = \"amp_V\"\n[parameters]\ng = { value = 0.1, min = 0.01 }\nc = { value = 1e-5, min = 1e-6 }\n\
                    [outputs]\nstroke_um = \"g*V - c*d(V) + c*d(V - 1)\"\n";
        let simulation = Simulation::parse(text, "stack.sim.toml").unwrap();
        let slots = PRANDTL_ISHLINSKII.slots(&Structure::of(&simulation));
        let [slot] = slots.as_slice() else { panic!("{slots:?}") };
        let signals = example_signals(&simulation, slot);
        let written = PRANDTL_ISHLINSKII.rewrite(&simulation, slot, &signals, Purpose::Refit).unwrap().simulation;
        let own = written.outputs[0].expression.to_string();
        assert!(own.contains("play(V, ") && own.ends_with("- c*d(V) + c*d(V - 1)"), "{own}");
        // A motion that is prescribed is no input of an actuator.
        let moved = text.replace("amp_V", "amp_mm").replace("stroke_um", "force_N");
        let law = Simulation::parse(&moved, "spring.sim.toml").unwrap();
        assert!(PRANDTL_ISHLINSKII.slots(&Structure::of(&law)).is_empty());
    }
}
