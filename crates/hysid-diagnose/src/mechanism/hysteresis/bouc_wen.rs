//! A spring with a smooth rate-independent loop.

use crate::mechanism::{Block, Family, Grid, Law, Mechanism, Need, log_grid};
use crate::slot::Place;

/// A spring with a smooth rate-independent loop.
pub static BOUC_WEN: Mechanism = Mechanism {
    id: "bouc_wen",
    family: Family::HystereticSpring,
    block: Block::Hysteresis,
    places: &[Place::Force, Place::Connection, Place::ForceLaw],
    applies: |slot| slot.has("x") && slot.has("v") && !slot.loops(),
    already: &[],
    law: |_, purpose| {
        // Wen's law in its normalised form: |z| tends to 1, beta/(beta + gamma) = b.
        Law::force("F_h*z")
            .amplitude("F_h", "F", 0.0, 2.0)
            .shape("x_y", "x", log_grid(0.1, 3.0, 5))
            .within(0.02, 20.0)
            .at_least(0.2, "v*h")
            .shape("b", "1", Grid::Values(vec![0.5]))
            .within(0.3, 5.0)
            .detail(purpose, "n_z", "1", vec![1.0, 2.0], (1.0, 6.0))
            .relaxing("z", "v - abs(z)^(n_z - 1)*(b*abs(v)*z + (1 - b)*v*abs(z))", "x_y")
            .report("k_h", "F/x", "F_h/x_y")
            .report("gamma_over_beta", "1", "(1 - b)/b")
    },
    contains: &["dahl_friction"],
    confusable: &["dahl_friction", "viscoelastic", "cubic_stiffness"],
    needs: &[Need::Reversals("v", 6), Need::Levels("x", 1.5)],
    sentence: "A hysteretic spring acts {place}: it yields over {x_y} at {F_h}; the simulation has no such loop.",
    signature: "A loop that stays at any rate; softening; damping and stiffness depend on the amplitude.",
    reference: "Y.-K. Wen, Method for random vibration of hysteretic systems, J. Eng. Mech. Div. 102 (1976) 249-263; F. Ikhouane, J. Rodellar, Systems with Hysteresis, Wiley (2007)",
};
