//! A force that is periodic in the position, as of magnet poles or gear teeth.

use crate::mechanism::{Block, Family, Grid, Law, Mechanism, Need, log_steps};
use crate::slot::Place;

/// A force that is periodic in the position, as of magnet poles or gear teeth.
pub static COGGING: Mechanism = Mechanism {
    id: "cogging",
    family: Family::PositionRipple,
    block: Block::Restoring,
    places: &[Place::Force, Place::ForceLaw],
    applies: |slot| slot.coordinate().is_some(),
    already: &["sin(2*pi*x/P)", "sin(2*pi/P*x)", "sin(P*x)", "sin(P*x + Q)"],
    law: |slot, _| {
        let x = slot.coordinate().unwrap_or("x");
        Law::force(format!("A_s*sin(2*pi*{x}/p_x) + A_c*cos(2*pi*{x}/p_x)"))
            .amplitude("A_s", "F", -1.0, 1.0)
            .silent()
            .amplitude("A_c", "F", -1.0, 1.0)
            .silent()
            .shape("p_x", x, Grid::Turns(x, log_steps(0.05, 1.0, 40)))
            // Three standard deviations are about the whole travel: a longer period is a curved spring and no ripple.
            .within(2e-4, 3.0)
            .searched()
            .report("A", "F", "sqrt(A_s^2 + A_c^2)")
            .report("phi", "1", "atan2(A_c, A_s)")
    },
    contains: &["gravity"],
    confusable: &["stribeck_friction", "cubic_stiffness"],
    needs: &[Need::Varies("v")],
    sentence: "A force of {A} repeats every {p_x} of travel {place}; the simulation has none.",
    signature: "Lines whose frequency follows the speed; periodic in the position.",
    reference: "T. M. Jahns, W. L. Soong, Pulsating torque minimization techniques for permanent magnet AC motor drives, IEEE Trans. Ind. Electron. 43 (1996) 321-330",
};
