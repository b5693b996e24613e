//! Dry friction of bristles: elastic before sliding, larger at small speed, lagging.

use crate::mechanism::{Block, Family, Grid, Law, Mechanism, Need, log_grid};
use crate::slot::Place;

/// Dry friction of bristles: elastic before sliding, larger at small speed, lagging.
pub static LUGRE_FRICTION: Mechanism = Mechanism {
    id: "lugre_friction",
    family: Family::Presliding,
    block: Block::Hysteresis,
    places: &[Place::Force, Place::Connection, Place::ForceLaw],
    applies: |slot| slot.has("x") && slot.has("v") && !slot.loops(),
    already: &[],
    law: |_, _| {
        Law::force("F_c*(z + t_1*(v - abs(v)*z/(1 + r_s*exp(-(v/v_s)^2)))/max(z_s, s_h*abs(v)))")
            .amplitude("F_c", "F", 0.0, 1.0)
            .shape("z_s", "x", log_grid(0.03, 0.5, 3))
            .elastic()
            .within(5e-4, 5.0)
            .at_least(0.03, "v*h")
            .shape("v_s", "v", log_grid(0.03, 0.5, 2))
            .within(0.005, 5.0)
            .shape("r_s", "1", Grid::Values(vec![0.5]))
            .within(-0.5, 3.0)
            .silent()
            .shape("t_1", "x/v", Grid::Values(vec![0.02]))
            .within(0.0, 1.0)
            .silent()
            .relaxing("z", "v - abs(v)*z/(1 + r_s*exp(-(v/v_s)^2))", "z_s")
            .report("F_s", "F", "F_c*(1 + r_s)")
            .report("sigma_0", "F/x", "F_c/z_s")
            .report("sigma_1", "F*t/x", "F_c*t_1/z_s")
    },
    contains: &["dahl_friction", "coulomb_friction", "stribeck_friction"],
    confusable: &["dahl_friction", "stribeck_friction"],
    needs: &[Need::Reversals("v", 6), Need::Levels("x", 1.5), Need::Slow("v")],
    sentence: "Friction {place} of about {F_c} ({F_s} at breakaway) gives way elastically over {z_s} before it slides.",
    signature: "Dahl's loop, a friction that falls with speed, and a lag between them.",
    reference: "C. Canudas de Wit, H. Olsson, K. J. Åström, P. Lischinsky, A new model for control of systems with friction, IEEE Trans. Autom. Control 40 (1995) 419-425",
};
