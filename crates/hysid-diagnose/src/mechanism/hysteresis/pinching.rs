//! A hysteretic spring that slips near the middle.

use crate::mechanism::{Block, Family, Form, Grid, Law, Mechanism, Need, Purpose, log_grid};
use crate::slot::Place;

/// A hysteretic spring that slips near the middle.
pub static PINCHING: Mechanism = Mechanism {
    id: "pinching",
    family: Family::HystereticSpring,
    block: Block::Hysteresis,
    places: &[Place::Force, Place::Connection, Place::ForceLaw, Place::Loop],
    applies: super::beside_none_or_in_one,
    already: &[],
    law: |slot, purpose| {
        if slot.place == Place::Loop {
            // A loop that had to follow a pinched one is bent until a slip in its middle explains nothing: a slip aside of it is screened, too.
            return Law::force("zeta_1*exp(-((z*sign(v)/z_u - q_z)/zeta_2)^2)*rate")
                .amplitude("zeta_1", "1", 0.0, 0.97)
                .shape("zeta_2", "1", log_grid(0.1, 0.6, 3))
                .within(0.02, 2.0)
                .shape("q_z", "1", Grid::Values(vec![0.1, 0.35]))
                .within(-0.5, 0.9)
                .constant("z_u", "z", Grid::Reach("z", vec![1.0]))
                .silent();
        }
        // Slip about one place of the motion, as of a nail in the hole that it has worn, where the other form slips wherever the force turns.
        if purpose == Purpose::Form(Form::Other) {
            return Law::force("F_h*z*(1 - zeta_1*exp(-(x/x_p)^2))")
                .amplitude("F_h", "F", 0.0, 2.0)
                .shape("x_y", "x", log_grid(0.1, 2.0, 4))
                .elastic()
                .within(0.02, 20.0)
                .at_least(0.2, "v*h")
                .shape("zeta_1", "1", Grid::Values(vec![0.6]))
                .within(0.0, 1.0)
                .shape("x_p", "x", log_grid(0.2, 1.5, 3))
                .within(0.02, 5.0)
                .shape("b", "1", Grid::Values(vec![0.5]))
                .within(0.3, 5.0)
                .relaxing("z", "v - b*abs(v)*z - (1 - b)*v*abs(z)", "x_y")
                .report("k_h", "F/x", "F_h/x_y");
        }
        Law::force("F_h*z")
            .amplitude("F_h", "F", 0.0, 2.0)
            .shape("x_y", "x", log_grid(0.1, 2.0, 4))
            .elastic()
            .within(0.02, 20.0)
            .at_least(0.2, "v*h")
            .shape("zeta_1", "1", Grid::Values(vec![0.6]))
            .within(0.0, 0.97)
            .detail(purpose, "zeta_2", "1", vec![0.3, 0.5], (0.02, 2.0))
            .detail(purpose, "q_z", "1", vec![0.1], (-0.5, 0.9))
            .detail(purpose, "b", "1", vec![0.5], (0.3, 5.0))
            .relaxing("z", "(1 - zeta_1*exp(-((z*sign(v) - q_z)/zeta_2)^2))*(v - b*abs(v)*z - (1 - b)*v*abs(z))", "x_y")
            .report("k_h", "F/x", "F_h/x_y")
    },
    contains: &["bouc_wen", "dahl_friction"],
    confusable: &["spring_clearance", "displacement_dependent_damping", "bouc_wen"],
    needs: &[Need::Reversals("v", 6), Need::Levels("x", 1.5)],
    sentence: "A hysteretic spring that pinches acts {place}[: it yields over {x_y} at {F_h}] and slips near the middle (slip {zeta_1}).",
    signature: "A pinched loop: little stiffness near the middle after sliding.",
    reference: "T. T. Baber, M. N. Noori, Random vibration of degrading, pinching systems, J. Eng. Mech. 111 (1985) 1010-1026",
};
