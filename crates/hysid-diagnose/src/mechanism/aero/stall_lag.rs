//! Flow separation that lags behind the angle of attack.

use crate::mechanism::{Block, Family, Grid, Law, Mechanism, Need, log_grid};
use crate::slot::Place;

/// Flow separation that lags behind the angle of attack.
pub static STALL_LAG: Mechanism = Mechanism {
    id: "stall_lag",
    family: Family::AeroMemory,
    block: Block::Hysteresis,
    places: &[Place::Force, Place::ForceLaw],
    applies: |slot| slot.has("x") && slot.has("v") && slot.has("rad"),
    already: &["lag(1/(1 + Z), P)"],
    law: |_, _| {
        // The share of attached flow; in equilibrium its lag vanishes, so that the steady curve stays the user's.
        Law::force(
            "C_s*sin(rad*x)*(lag(1/(1 + exp((abs(x - tau_2*v) - a_s)/d_s)), tau_1) - 1/(1 + exp((abs(x) - a_s)/d_s)))",
        )
        .amplitude("C_s", "F", -20.0, 20.0)
        .shape("a_s", "x", Grid::Quantiles("x", vec![0.5, 0.7, 0.85]))
        .shape("d_s", "x", Grid::Values(vec![0.1, 0.3]))
        .within(0.01, 3.0)
        .shape("tau_1", "x/v", log_grid(0.05, 1.0, 3))
        .within(0.005, 10.0)
        .shape("tau_2", "x/v", Grid::Values(vec![0.1, 0.5]))
        .within(0.0, 10.0)
    },
    contains: &[],
    confusable: &["bouc_wen", "viscoelastic", "displacement_dependent_damping"],
    needs: &[Need::Turns(6)],
    sentence: "Separation lags behind the angle {place}: stall begins near {a_s} and follows with {tau_1} (and {tau_2} with the rate).",
    signature: "A loop only above the stall angle; it depends on the rate and turns the other way round at slow pitching.",
    reference: "M. Goman, A. Khrabrov, State-space representation of aerodynamic characteristics of an aircraft at high angles of attack, J. Aircraft 31 (1994) 1109-1115",
};
