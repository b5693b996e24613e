//! Dry friction of different size in the two directions.

use super::{is_there, sign};
use crate::mechanism::{Block, Family, Form, Law, Mechanism, Need, Purpose};
use crate::slot::Place;

/// Dry friction of different size in the two directions.
pub static ASYMMETRIC_FRICTION: Mechanism = Mechanism {
    id: "asymmetric_friction",
    family: Family::DryFriction,
    block: Block::Damping,
    places: &[Place::Force, Place::Connection, Place::ForceLaw],
    applies: |slot| slot.has("v"),
    already: &["step(v)", "step(-v)", "abs(sign(v))", "sign(v)*sign(v)", "sign(v)^2"],
    law: |slot, purpose| {
        if is_there(slot) {
            // The symmetric part is there already: only what the directions differ by.
            let dry = format!("F_a*abs({})", sign(slot));
            let unequal = |text: String| Law::force(text).amplitude("F_a", "F", -1.0, 1.0);
            return match purpose {
                // What slides in grease, too.
                Purpose::Form(Form::Finer) => unequal(format!("{dry} + c_a*abs(v)")).amplitude("c_a", "F/v", -1.0, 1.0),
                _ => unequal(dry).sum_of_others(),
            };
        }
        // Dry friction and a constant force, sticking included.
        Law::force("(F_c + F_a*sign(v))*sign(v)")
            .amplitude("F_c", "F", 0.0, 1.0)
            .silent()
            .amplitude("F_a", "F", -1.0, 1.0)
            .report("F_plus", "F", "F_c + F_a")
            .report("F_minus", "F", "F_c - F_a")
            .report("F_a", "F", "F_a")
            .sum_of_others()
    },
    contains: &["coulomb_friction"],
    confusable: &["input_offset", "gravity"],
    needs: &[Need::Reversals("v", 6)],
    sentence: "Dry friction {place} is unequal in the two directions: half the difference is {F_a}.",
    signature: "An even part in the velocity: an offset whose sign follows the direction of travel.",
    reference: "A. Janot, M. Gautier, M. Brunot, Data set and reference models of EMPS, Workshop on Nonlinear System Identification Benchmarks (2019)",
};

#[cfg(test)]
mod tests {
    use hysid_plant::Simulation;

    use super::*;
    use crate::budget::Budget;
    use crate::model::base::NoiseKind;
    use crate::model::hypothesis::{calibrated, lacking_a_law};
    use crate::oscillator::{drive, normal, rms};
    use crate::search::fitting::refit;
    use crate::search::screen::screen;

    /// An axis with dry friction that is unequal in both its parts, with a noise of five in a thousand.
    #[test]
    fn what_slides_in_grease_may_be_unequal_too() {
        let text = "[time]\nperiod_s = 0.02\n[inputs]\nu = \"torque_Nm\"\n[parameters]\nJ = { value = 0.02, min = 0.005, max = 0.1, unit = \"kg m^2\" }\n\
                    b = { value = 0.08, min = 0.01, max = 0.5, unit = \"N m s/rad\" }\nM = { value = 0.5, min = 0.1, max = 2.0, unit = \"N m\" }\n\
                    k = { value = 1.1, min = 0.3, max = 4.0, unit = \"N m/rad\" }\n[states]\nq = { derivative = \"w\", initial = 0.0, unit = \"rad\" }\n\
                    w = { derivative = \"(u - b*w - M*sign(w) - k*q)/J\", initial = 0.0, unit = \"rad/s\" }\n[outputs]\nq_rad = \"q\"\n";
        let original = Simulation::parse(text, "axis.sim.toml").unwrap();
        let (dry, viscous) = (0.05, 0.02);
        let unequal = format!("(u - b*w - M*sign(w) - k*q - {dry}*abs(sign(w)) - {viscous}*abs(w))/J");
        let mut random = normal(8);
        let u = drive(1500, &mut random);
        let size = 1.5 / rms(&u);
        let u: Vec<f64> = u.into_iter().map(|x| size * x).collect();
        let data = lacking_a_law(&original, ("w", &unequal), 0.02, ("torque_Nm", u), (0.005, &mut random));
        let budget = Budget::new(&|_| false);
        let (setting, none) = calibrated(original, &data, NoiseKind::White(1.0), &budget);
        let evidence = none.base.evidence();
        let found = screen(&none.base, &setting.original, &[], &evidence, &|m, _| m.id == ASYMMETRIC_FRICTION.id);
        let h = refit(&setting, &none, &found[0]).unwrap();
        assert_eq!(h.effects[0].written.purpose, Purpose::Form(Form::Finer));
        let values = h.base.values().parameters;
        for (name, truth) in [("F_a", dry), ("c_a", viscous)] {
            assert!((values[name] / truth - 1.0).abs() < 0.2, "{name} {}", values[name]);
        }
    }
}
