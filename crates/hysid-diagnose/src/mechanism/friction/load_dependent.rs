//! Dry friction that grows with the transmitted load.

use super::{is_there, sign};
use crate::mechanism::{Block, Family, Form, Law, Mechanism, Need, Purpose};
use crate::slot::{Place, Slot};

/// Dry friction that grows with the transmitted load.
pub static LOAD_DEPENDENT_FRICTION: Mechanism = Mechanism {
    id: "load_dependent_friction",
    family: Family::DryFriction,
    block: Block::Damping,
    places: &[Place::Force, Place::ForceLaw],
    applies: |slot| slot.has("v") && slot.has("u") && (slot.place != Place::ForceLaw || !slot.loads().is_empty()),
    already: &["abs(u)*sign(v)"],
    law: |slot, purpose| {
        let loads = loads(slot, purpose);
        let size: Vec<String> = loads.iter().map(|(mu, u)| format!("{mu}*abs({u})")).collect();
        let size = size.join(" + ");
        let law = if is_there(slot) {
            Law::force(format!("({size})*{}", sign(slot)))
        } else {
            Law::force(format!("(F_c + {size})*sign(v)")).amplitude("F_c", "F", 0.0, 1.0)
        };
        loads.into_iter().fold(law, |law, (mu, u)| law.amplitude(mu, format!("F/{u}"), 0.0, 1.0))
    },
    contains: &["coulomb_friction"],
    confusable: &["coulomb_friction", "input_polynomial"],
    needs: &[Need::Reversals("v", 6), Need::Levels("u", 1.5)],
    sentence: "Dry friction {place} grows with the load by {mu}.",
    signature: "Friction follows the envelope of the drive, not only the direction of motion.",
    reference: "P. Hamon, M. Gautier, P. Garrec, Dynamic identification of robots with a dry friction model depending on load and velocity, IROS (2010) 6187-6193",
};

/// What loads the guide, with the name of its coefficient. Where there are several (a motor's torque and the load at the tool, a clamping force that the
/// simulation makes no use of, the torque that a gear passes on) no equation tells which of them presses: up to three are looked for, and each is fitted by
/// itself.
fn loads(slot: &Slot, purpose: Purpose) -> Vec<(&'static str, String)> {
    let mut all = slot.loads();
    if all.is_empty() {
        all.push("u".to_owned());
    }
    let fitted = match purpose {
        Purpose::Screening => return NAMES.into_iter().zip(all).collect(),
        Purpose::Form(Form::Other) => all.get(1),
        Purpose::Form(Form::Few) => all.get(2),
        Purpose::Refit | Purpose::Form(_) => None,
    };
    fitted.or(all.first()).map(|load| (NAMES[0], load.clone())).into_iter().collect()
}

/// The coefficients of what may load it.
const NAMES: [&str; 3] = ["mu", "mu_2", "mu_3"];

#[cfg(test)]
mod tests {
    use hysid_plant::Simulation;

    use super::*;
    use crate::slot::Structure;

    #[test]
    fn each_input_that_enters_the_force_may_be_the_load() {
        let text = "[time]\nperiod_s = 0.01\n[inputs]\nT = \"temp_K\"\ntq = \"torque_Nm\"\nfa = \"axial_N\"\n[parameters]\nJ = { value = 2.0, min = 0.1 }\n\
                    [states]\nq = { derivative = \"w\", initial = 0.0 }\nw = { derivative = \"(tq - 0.1*fa)/J\", initial = 0.0 }\n[outputs]\nq_rad = \"q + 0*T\"\n";
        let structure = Structure::of(&Simulation::parse(text, "axis.sim.toml").unwrap());
        let slot = structure.slots.iter().find(|s| s.place == Place::Force).unwrap();
        let of = |purpose| loads(slot, purpose).into_iter().map(|(_, u)| u).collect::<Vec<_>>();
        assert_eq!(of(Purpose::Screening), ["u_2", "u_3"]);
        assert_eq!(of(Purpose::Refit), ["u_2"]);
        assert_eq!(of(Purpose::Form(Form::Other)), ["u_3"]);
    }

    #[test]
    fn a_recorded_force_that_the_simulation_makes_no_use_of_may_be_the_load() {
        let text = "[time]\nperiod_s = 0.01\n[inputs]\nT = \"temp_K\"\nF = \"drive_N\"\nF_n = \"clamp_N\"\n[parameters]\nm = { value = 2.0, min = 0.1 }\n\
                    [states]\nx = { derivative = \"v\", initial = 0.0 }\nv = { derivative = \"F/m\", initial = 0.0 }\n[outputs]\nx_m = \"x\"\n";
        let structure = Structure::of(&Simulation::parse(text, "slide.sim.toml").unwrap());
        let slot = structure.slots.iter().find(|s| s.place == Place::Force).unwrap();
        assert_eq!(slot.loads(), ["u_3", "u_2"]);
        // Nor is it another where its effect has been written.
        let original = Simulation::parse(text, "slide.sim.toml").unwrap();
        let with_it =
            Simulation::parse(&text.replace("F/m", "(F - 0.1*abs(F_n)*sign(v))/m"), "slide.sim.toml").unwrap();
        let structure = Structure::within(&with_it, &original);
        assert_eq!(structure.slots.iter().find(|s| s.place == Place::Force).unwrap().loads(), ["u_3", "u_2"]);
    }

    #[test]
    fn what_a_gear_passes_on_may_be_the_load() {
        let of = |motor: &str| {
            let text = format!(
                "[time]\nperiod_s = 0.01\n[inputs]\nu = \"torque_Nm\"\n[parameters]\nJ = {{ value = 2.0, min = 0.1 }}\nk = {{ value = 50.0, min = 1.0 }}\n\
                 [states]\nq = {{ derivative = \"w\", initial = 0.0 }}\nw = {{ derivative = \"{motor}\", initial = 0.0 }}\n\
                 p = {{ derivative = \"r\", initial = 0.0 }}\nr = {{ derivative = \"(k*(q - p) - 0.1*r)/J\", initial = 0.0 }}\n[outputs]\nq_rad = \"q\"\n"
            );
            let structure = Structure::of(&Simulation::parse(&text, "joint.sim.toml").unwrap());
            let slot = structure.slots.into_iter().find(|s| s.place == Place::Force).unwrap();
            let load = slot.quantity("load").map(|q| q.expression.to_string());
            (load, loads(&slot, Purpose::Form(Form::Other)).remove(0).1)
        };
        let shaft = Some("-(k*(q - p))".to_owned());
        assert_eq!(of("(u - 0.1*w - k*(q - p))/J"), (shaft, "load".to_owned()));
        assert_eq!(of("u/J - 0.1/J*w - k*(q - p)/J").1, "load");
        assert_eq!(of("(u - 0.1*w - k*q)/J"), (None, "u_1".to_owned()));
    }

    #[test]
    fn a_test_bench_is_loaded_by_a_force_beside_its_motion() {
        let loads = |third: &str, law: &str| {
            let text = format!(
                "[time]\nperiod_s = 0.01\n[inputs]\nx = \"x_mm\"\nv = \"v_mm_s\"\ng = \"{third}\"\n[parameters]\nk = {{ value = 2.0, min = 0.1, unit = \"N/mm\" }}\n\
                 [outputs]\nforce_N = \"{law}\"\n"
            );
            let structure = Structure::of(&Simulation::parse(&text, "bench.sim.toml").unwrap());
            let slot = structure.slots.into_iter().find(|s| s.place == Place::ForceLaw).unwrap();
            (slot.loads(), LOAD_DEPENDENT_FRICTION.fits(&slot))
        };
        assert_eq!(loads("clamp_N", "k*x"), (vec!["u_3".to_owned()], true));
        assert_eq!(loads("clamp_N", "k*x + 0.1*g"), (vec!["u_3".to_owned()], true));
        // What is moved, or is warm, presses upon nothing.
        assert_eq!(loads("y_mm", "k*x"), (vec![], false));
        assert_eq!(loads("temp_K", "k*x + 0.1*g"), (vec![], false));
    }
}
