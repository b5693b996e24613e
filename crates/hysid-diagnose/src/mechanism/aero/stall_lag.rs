//! Flow separation that lags behind the angle of attack.

use crate::mechanism::{Amplitudes, Block, Family, Form, Grid, Law, Mechanism, Need, Purpose, log_grid};
use crate::slot::Place;

/// Where the simulation has the separation as a function of the angle (Kirchhoff's steady curve), that function lags. While it follows
/// closely only the sum of the two times shows: the second is for recordings that are sharp enough to tell it.
fn lagging(purpose: Purpose) -> Law {
    let after = "x/v";
    let rate = |law: Law, times: Vec<f64>| law.shape("tau_2", after, Grid::Values(times)).within(0.0, 10.0);
    let law = match purpose {
        Purpose::Screening => Law::separation("x - tau_2*v", "steady + w*(lag(ahead, tau_1) - steady)").weight(),
        Purpose::Form(Form::Finer) => Law::separation("x - tau_2*v", "lag(ahead, tau_1)"),
        Purpose::Refit | Purpose::Form(_) => Law::separation("x", "lag(ahead, tau_1)"),
    };
    let law = law.shape("tau_1", after, log_grid(0.02, 1.0, 4)).within(1e-6, 10.0);
    match purpose {
        Purpose::Screening => rate(law, vec![0.0, 0.1, 0.5]),
        Purpose::Form(Form::Finer) => rate(law, vec![0.02]),
        Purpose::Refit | Purpose::Form(_) => law,
    }
}

/// Elsewhere a separation is added: one whose lag vanishes in equilibrium, so that the steady curve stays the user's (`C_s`), or the whole of it, where
/// the user's curve is that of a flow that never separates (`C_l`).
fn beside_the_curve(purpose: Purpose) -> Law {
    let attached = "lag(1/(1 + exp((abs(x - tau_2*v) - a_s)/d_s)), tau_1)";
    let lagging = format!("C_s*sin(rad*x)*({attached} - 1/(1 + exp((abs(x) - a_s)/d_s)))");
    let whole = format!("C_l*sin(rad*x)*({attached} - 1)");
    let strong = |law: Law, name: &str| law.amplitude(name, "F", -20.0, 20.0);
    let law = match purpose {
        Purpose::Screening => {
            let each = Law::force(format!("{lagging} + {whole}")).with_amplitudes(Amplitudes::Apart);
            strong(strong(each, "C_s"), "C_l")
        }
        Purpose::Form(Form::Other) => strong(Law::force(whole), "C_l"),
        _ => strong(Law::force(lagging), "C_s"),
    };
    law.shape("a_s", "x", Grid::Quantiles("x", vec![0.5, 0.7, 0.85]))
        .shape("d_s", "x", Grid::Values(vec![0.1, 0.3]))
        .within(0.01, 3.0)
        .shape("tau_1", "x/v", log_grid(0.05, 1.0, 3))
        .within(0.005, 10.0)
        .shape("tau_2", "x/v", Grid::Values(vec![0.1, 0.5]))
        .within(0.0, 10.0)
}

/// Flow separation that lags behind the angle of attack.
pub static STALL_LAG: Mechanism = Mechanism {
    id: "stall_lag",
    family: Family::AeroMemory,
    block: Block::Hysteresis,
    places: &[Place::Force, Place::ForceLaw],
    applies: |slot| slot.has("x") && slot.has("v") && slot.has("rad"),
    already: &["lag(1/(1 + Z), P)"],
    law: |slot, purpose| match slot.separation() {
        Some(_) => lagging(purpose),
        None => beside_the_curve(purpose),
    },
    contains: &[],
    confusable: &["bouc_wen", "viscoelastic", "displacement_dependent_damping"],
    needs: &[Need::Turns(6)],
    sentence: "Separation lags behind the angle {place}: it follows with {tau_1}.",
    signature: "A loop only above the stall angle; it depends on the rate and turns the other way round at slow pitching.",
    reference: "M. Goman, A. Khrabrov, State-space representation of aerodynamic characteristics of an aircraft at high angles of attack, J. Aircraft 31 (1994) 1109-1115",
};

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mechanism::conformance::slot_where;

    #[test]
    fn where_the_flow_never_separates_the_whole_stall_may_be_missing() {
        let slot = slot_where(&STALL_LAG, |s| s.separation().is_none()).unwrap();
        let first = |name: &str| STALL_LAG.fitted_first(&slot, &[(name.to_owned(), 1.0)], &[]);
        assert_eq!([first("C_s"), first("C_l")], [Purpose::Refit, Purpose::Form(Form::Other)]);
    }
}
