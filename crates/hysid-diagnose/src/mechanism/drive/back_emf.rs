//! The electrical side of a drive: induced voltage and inductance.

use crate::mechanism::path::{FASTEST, SHORTEST, emptiness, with_duration};
use crate::mechanism::{Block, Family, Form, Law, Mechanism, Need, Purpose, log_grid};
use crate::slot::{Place, feeds};

/// A law with the winding's parameters, however short its time constant.
fn wound(law: Law) -> Law {
    law.amplitude("k_e", "u/v", 0.0, 5.0)
        .shape("tau_e", "h", log_grid(0.5, 50.0, 4))
        .within(SHORTEST, 2000.0)
        .never_baseline()
}

/// The electrical side of a drive: induced voltage and inductance.
pub static BACK_EMF: Mechanism = Mechanism {
    id: "back_emf",
    family: Family::Electrical,
    block: Block::Input,
    places: &[Place::Input, Place::Command, Place::Winding],
    applies: |slot| slot.has("v") && slot.quantity("u").and_then(|u| u.unit.as_ref()).is_none_or(feeds),
    already: &["lag(u - P*v, Q)"],
    law: |slot, purpose| match purpose {
        // The simulation has the winding's resistance and inductance.
        _ if slot.has("i") => Law::replace("u - k_e*v").amplitude("k_e", "u/v", 0.0, 5.0),
        Purpose::Screening => Law::replace("u + w*(lag(u, tau_e) - u) - k_e*lag(v, tau_e)")
            .weight()
            .amplitude("k_e", "u/v", 0.0, 5.0)
            .shape("tau_e", "h", log_grid(0.5, 50.0, 4))
            .within(SHORTEST, 2000.0),
        // A drive that is switched on has no current yet.
        Purpose::Form(Form::Finer) => Law::replace("u_e")
            .amplitude("k_e", "u/v", 0.0, 5.0)
            .shape("tau_e", "h", log_grid(0.5, 50.0, 4))
            .within(FASTEST, 2000.0)
            .state("u_e", "u", "(u - k_e*v - u_e)/tau_e")
            .starting_free()
            .never_baseline(),
        // The same within a sampling period, where a state of its own would need shorter steps.
        Purpose::Form(Form::Unsettled) => {
            wound(with_duration(Law::replace(format!("lag(u - k_e*v, tau_e) - {}", emptiness("u", "tau_e")))))
        }
        Purpose::Refit | Purpose::Form(_) => wound(Law::replace("lag(u - k_e*v, tau_e)")),
    },
    contains: &["actuator_lag"],
    confusable: &["actuator_lag", "delay"],
    needs: &[Need::Band(3.0)],
    sentence: "The drive has an electrical side {place}: a back-EMF of {k_e}[ and a time constant of {tau_e}].",
    signature: "An input that weakens with the speed and lags.",
    reference: "W. Leonhard, Control of Electrical Drives, 3rd ed., Springer (2001)",
};

#[cfg(test)]
mod tests {
    use hysid_plant::Simulation;

    use super::*;
    use crate::slot::Structure;

    #[test]
    fn what_steers_is_no_voltage() {
        let fed = |column: &str| {
            let text = format!(
                "[time]\nperiod_s = 0.1\n[inputs]\nu = \"{column}\"\n[parameters]\nK = {{ value = 0.1, min = 0.01 }}\nT = {{ value = 9.0, min = 2.0 }}\n\
                 [states]\npsi = {{ derivative = \"r\", initial = 0.0, unit = \"deg\" }}\nr = {{ derivative = \"(K*u - r)/T\", initial = 0.0, unit = \"deg/s\" }}\n\
                 [outputs]\nheading_deg = \"psi\"\n"
            );
            let structure = Structure::of(&Simulation::parse(&text, "test.sim.toml").unwrap());
            !BACK_EMF.slots(&structure).is_empty()
        };
        assert!(["drive_V", "coil_A", "torque_Nm", "duty_percent", "command"].into_iter().all(fed));
        assert!(!["rudder_deg", "rate_rpm", "lift_m", "ground_m_s2"].into_iter().any(fed));
    }

    #[test]
    fn a_winding_has_a_current_or_the_flux_linkage_that_tells_it() {
        let wound = |unit: &str| {
            let text = format!(
                "[time]\nperiod_s = 1e-3\n[inputs]\ne = \"coil_V\"\n[parameters]\nR = {{ value = 4.0, min = 1.0 }}\nK = {{ value = 11.0, min = 2.0 }}\n\
                 [states]\ns = {{ derivative = \"e - R*s\", initial = 0.0, unit = \"{unit}\" }}\nx = {{ derivative = \"v\", initial = 0.0, unit = \"m\" }}\n\
                 v = {{ derivative = \"K*s - 9*v - 500*x\", initial = 0.0, unit = \"m/s\" }}\n[outputs]\npos_m = \"x\"\n"
            );
            let structure = Structure::of(&Simulation::parse(&text, "solenoid.sim.toml").unwrap());
            BACK_EMF.slots(&structure).iter().any(|s| s.label == "state:s" && s.has("i"))
        };
        assert!(wound("A") && wound("V s") && wound("Wb"));
        assert!(!wound("K"));
    }
}
