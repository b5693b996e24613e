//! A force from outside that follows the clock.

use crate::mechanism::{Block, Family, Grid, Law, Mechanism, Need, anywhere};
use crate::slot::Place;

/// A force from outside that follows the clock.
pub static PERIODIC_DISTURBANCE: Mechanism = Mechanism {
    id: "periodic_disturbance",
    family: Family::ExternalDisturbance,
    block: Block::Disturbance,
    places: &[Place::Disturbance],
    applies: anywhere,
    already: &["sin(2*pi*P*t)", "sin(P*t)", "sin(P*t + Q)"],
    law: |_, _| {
        Law::drive("A_s*sin(2*pi*f_d*t) + A_c*cos(2*pi*f_d*t)")
            .amplitude("A_s", "F", -1.0, 1.0)
            .silent()
            .amplitude("A_c", "F", -1.0, 1.0)
            .silent()
            // Fewer than four cycles are a drift, which anything slow imitates.
            .shape("f_d", "1/t", Grid::Peaks(24))
            .at_least(4.0, "1/T")
            .searched()
            .report("A", "F", "sqrt(A_s^2 + A_c^2)")
            .report("phi", "1", "atan2(A_c, A_s)")
    },
    contains: &[],
    confusable: &["cogging"],
    needs: &[Need::Turns(6)],
    sentence: "A periodic disturbance of {A} at {f_d} acts {place}, whatever the input does.",
    signature: "Coherent with the clock, neither with the input nor with the motion.",
    reference: "M. Bodson, S. C. Douglas, Adaptive algorithms for the rejection of sinusoidal disturbances with unknown frequency, Automatica 33 (1997) 2213-2221",
};

#[cfg(test)]
mod tests {
    use hysid_plant::Simulation;

    use super::*;
    use crate::slot::Structure;

    #[test]
    fn of_several_sensors_one_may_hum() {
        let places = |outputs: &str| {
            let text = format!(
                "[time]\nperiod_s = 0.01\n[inputs]\nu = \"u_N\"\n[parameters]\nk = {{ value = 9.0, min = 0.1 }}\n[states]\n\
                 x = {{ derivative = \"v\", initial = 0.0 }}\nv = {{ derivative = \"u - k*x - 2*v\", initial = 0.0 }}\n[outputs]\n{outputs}\n"
            );
            let simulation = Simulation::parse(&text, "spring.sim.toml").unwrap();
            let slots = PERIODIC_DISTURBANCE.slots(&Structure::of(&simulation));
            assert!(slots.iter().all(|s| s.label == "disturbance"));
            slots.into_iter().map(|s| s.whereabouts).collect::<Vec<_>>()
        };
        assert_eq!(places("x_mm = \"1000*x\""), ["at x"]);
        assert_eq!(places("x_mm = \"1000*x\"\nrate_m_s = \"v\""), ["at x", "in x_mm", "in rate_m_s"]);
    }
}
