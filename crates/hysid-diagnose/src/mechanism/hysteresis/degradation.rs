//! A hysteretic spring that weakens with the energy it has dissipated.

use crate::mechanism::{Amplitudes, Block, Family, Form, Grid, Law, Mechanism, Need, Purpose, log_grid};
use crate::slot::Place;

/// A hysteretic spring that weakens with the energy it has dissipated.
pub static DEGRADATION: Mechanism = Mechanism {
    id: "degradation",
    family: Family::HystereticSpring,
    block: Block::Hysteresis,
    places: &[Place::Force, Place::Connection, Place::ForceLaw, Place::Loop],
    applies: super::beside_none_or_in_one,
    already: &[],
    law: |slot, purpose| {
        if slot.place == Place::Loop {
            return of_the_loop(purpose);
        }
        Law::force("F_h*z")
            .amplitude("F_h", "F", 0.0, 2.0)
            .shape("x_y", "x", log_grid(0.1, 2.0, 4))
            .elastic()
            .within(0.02, 20.0)
            .at_least(0.2, "v*h")
            .shape("d_A", "x/(v*T)", Grid::Values(vec![0.5]))
            .within(0.0, 20.0)
            .detail(purpose, "d_nu", "x/(v*T)", vec![0.0, 0.5], (0.0, 20.0))
            .detail(purpose, "d_eta", "x/(v*T)", vec![0.0, 0.5], (0.0, 20.0))
            .detail(purpose, "b", "1", vec![0.5], (0.3, 5.0))
            .relaxing("z", "max(1 - d_A*e, 0.05)*v - (1 + d_nu*e)*(b*abs(v)*z + (1 - b)*v*abs(z))", "(1 + d_eta*e)*x_y")
            .state("e", "1", "z*v/x_y")
            .report("k_h", "F/x", "F_h/x_y")
    },
    contains: &["bouc_wen", "dahl_friction"],
    confusable: &["parameter_drift", "dissipation_heating"],
    needs: &[Need::Reversals("v", 6), Need::EarlyAndLate("x")],
    sentence: "A hysteretic spring that weakens as it works acts {place}[: it yields over {x_y} at {F_h} at first].",
    signature: "A change in one direction that follows the dissipated energy, not the clock.",
    reference: "T. T. Baber, Y.-K. Wen, Random vibration of hysteretic degrading systems, J. Eng. Mech. Div. 107 (1981) 1069-1087",
};

/// A loop of the simulation that wears out: what drives it weakens (`d_A`), what bends it grows (`d_nu`), all of it slows down (`d_eta`), with the
/// energy that it has dissipated. One of them until the recording tells more.
fn of_the_loop(purpose: Purpose) -> Law {
    let measured = |law: Law, name: &str| law.amplitude(name, "1/(z*v*T)", 0.0, 20.0);
    let law = match purpose {
        Purpose::Form(Form::Other) => measured(Law::force("d_eta*e/(1 + d_eta*e)*rate"), "d_eta"),
        Purpose::Form(Form::Few) => measured(Law::force("-d_nu*e*(rate - drive)"), "d_nu"),
        Purpose::Screening => {
            let parts =
                Law::force("d_A*e*drive - d_nu*e*(rate - drive) + d_eta*e*rate").with_amplitudes(Amplitudes::Apart);
            ["d_A", "d_nu", "d_eta"].into_iter().fold(parts, measured)
        }
        Purpose::Form(Form::Finer) => {
            let worn = "((1 - min(d_A*e, 0.95))*drive + (1 + d_nu*e)*(rate - drive))/(1 + d_eta*e)";
            ["d_A", "d_nu", "d_eta"].into_iter().fold(Law::force(format!("rate - {worn}")), measured)
        }
        _ => measured(Law::force("min(d_A*e, 0.95)*drive"), "d_A"),
    };
    law.state("e", "z*v*T", "z*v")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mechanism::conformance::slot_where;

    #[test]
    fn of_the_ways_in_which_a_loop_wears_the_one_that_explains_most_is_fitted_first() {
        let slot = slot_where(&DEGRADATION, |s| s.place == Place::Loop).unwrap();
        for name in ["d_A", "d_nu", "d_eta"] {
            let first = DEGRADATION.law_at(&slot, DEGRADATION.fitted_first(&slot, &[(name.to_owned(), 1.0)], &[]));
            let names: Vec<&str> = first.parameters.iter().map(|p| p.name.as_str()).collect();
            assert_eq!(names, [name]);
        }
    }
}
