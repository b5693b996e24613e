//! A constant on the input.

use crate::mechanism::{Block, Family, Law, Mechanism};
use crate::slot::Place;

/// A constant on the input.
pub static INPUT_OFFSET: Mechanism = Mechanism {
    id: "input_offset",
    family: Family::Bias,
    block: Block::Input,
    places: &[Place::Input],
    applies: |slot| !slot.has_constant(),
    already: &[],
    law: |_, _| Law::replace("u + u_0").amplitude("u_0", "u", -3.0, 3.0),
    contains: &[],
    confusable: &["output_offset", "gravity", "asymmetric_friction"],
    needs: &[],
    sentence: "The input has an offset of {u_0} {place}; the simulation takes its zero as given.",
    signature: "A constant only.",
    reference: "L. Ljung, System Identification: Theory for the User, 2nd ed. (1999), sec. 14.1",
};

#[cfg(test)]
mod tests {
    use hysid_plant::Simulation;

    use super::*;
    use crate::slot::Structure;

    #[test]
    fn a_constant_takes_up_an_offset_where_it_stands_beside_the_input_wherever_that_enters() {
        let stands = |charge: &str, voltage: &str| {
            let text = format!(
                "[time]\nperiod_s = 1.0\n[inputs]\ni = \"load_A\"\n[parameters]\nE = {{ value = 4.0, min = 1.0 }}\nR = {{ value = 0.02, min = 0.001 }}\n\
                 [states]\ns = {{ derivative = \"{charge}\", initial = 95.0 }}\n[outputs]\ncell_V = \"{voltage}\"\n"
            );
            let structure = Structure::of(&Simulation::parse(&text, "cell.sim.toml").unwrap());
            INPUT_OFFSET.slots(&structure).iter().any(|s| s.label == "input:i")
        };
        // What it adds to a store stays, whatever the sensor's constant is.
        assert!(stands("-i/82.8", "E + 0.004*s - R*i"));
        assert!(stands("-i/82.8", "E + 0.004*s"));
        assert!(!stands("E - i", "0.004*s"));
        assert!(!stands("E - i", "E + 0.004*s - R*i"));
        assert!(stands("E - i", "0.004*s - R*i"));
    }
}
