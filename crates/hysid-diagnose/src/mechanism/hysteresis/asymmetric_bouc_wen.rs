//! A hysteretic spring whose two branches differ.

use crate::mechanism::{Block, Family, Form, Grid, Law, Mechanism, Need, Purpose, log_grid};
use crate::slot::Place;

/// A hysteretic spring whose two branches differ.
pub static ASYMMETRIC_BOUC_WEN: Mechanism = Mechanism {
    id: "asymmetric_bouc_wen",
    family: Family::HystereticSpring,
    block: Block::Hysteresis,
    places: &[Place::Force, Place::Connection, Place::ForceLaw, Place::Loop],
    applies: super::beside_none_or_in_one,
    already: &[],
    law: |slot, purpose| {
        if slot.place == Place::Loop {
            return of_the_loop(purpose);
        }
        // The share a makes z tend to 1/(1 + 2 a)^(1/n) upwards and to 1/(1 - 2 a)^(1/n) downwards.
        Law::force("F_h*z")
            .amplitude("F_h", "F", 0.0, 2.0)
            .shape("x_y", "x", log_grid(0.1, 3.0, 4))
            .elastic()
            .within(0.02, 20.0)
            .at_least(0.2, "v*h")
            .detail(purpose, "b", "1", vec![0.5], (0.3, 5.0))
            .detail(purpose, "n_z", "1", vec![1.0], (1.0, 6.0))
            .shape("a_z", "1", Grid::Values(vec![-0.15, 0.15]))
            .within(-0.45, 0.45)
            .relaxing("z", "v - abs(z)^(n_z - 1)*(b*abs(v)*z + (1 - b)*v*abs(z) + a_z*(v*z + abs(v)*abs(z)))", "x_y")
            .report("k_h", "F/x", "F_h/x_y")
            .report("gamma_over_beta", "1", "(1 - b)/b")
    },
    contains: &["bouc_wen", "dahl_friction"],
    confusable: &["bouc_wen", "quadratic_stiffness"],
    needs: &[Need::Reversals("v", 6), Need::BothSides("x"), Need::Levels("x", 1.5)],
    sentence: "A hysteretic spring with unequal branches acts {place}[: it yields over {x_y} at {F_h}], the branches differing by twice {a_z}.",
    signature: "Unequal upper and lower branches; even harmonics together with a loop.",
    reference: "C.-H. Wang, Y.-K. Wen, Evaluation of pre-Northridge low-rise steel buildings I: modeling, J. Struct. Eng. 126 (2000) 1151-1160",
};

/// A loop of the simulation whose branches differ: by the signs of both the velocity and the loop, or by one of them.
fn of_the_loop(purpose: Purpose) -> Law {
    let law = match purpose {
        Purpose::Form(Form::Other) => "a_z*v*z",
        Purpose::Form(Form::Few) => "a_z*abs(v)*abs(z)",
        _ => "a_z*(v*z + abs(v)*abs(z))",
    };
    Law::force(law).amplitude("a_z", "F/(v*z)", -1.0, 1.0)
}
