//! Dry friction with an elastic part before it slides.

use crate::mechanism::{Block, Family, Law, Mechanism, Need, log_grid};
use crate::slot::Place;

/// Dry friction with an elastic part before it slides.
pub static DAHL_FRICTION: Mechanism = Mechanism {
    id: "dahl_friction",
    family: Family::Presliding,
    block: Block::Hysteresis,
    places: &[Place::Force, Place::Connection, Place::ForceLaw],
    applies: |slot| slot.has("x") && slot.has("v") && !slot.loops(),
    already: &[],
    law: |_, _| {
        Law::force("F_c*z")
            .amplitude("F_c", "F", 0.0, 1.0)
            .shape("z_s", "x", log_grid(0.02, 1.0, 5))
            .elastic()
            .within(5e-4, 5.0)
            .at_least(0.03, "v*h")
            .relaxing("z", "v - abs(v)*z", "z_s")
            .report("sigma_0", "F/x", "F_c/z_s")
    },
    contains: &["coulomb_friction"],
    confusable: &["bouc_wen", "coulomb_friction", "viscoelastic"],
    needs: &[Need::Reversals("v", 6), Need::Levels("x", 1.5)],
    sentence: "Friction {place} of about {F_c} gives way elastically over {z_s} before it slides; the simulation has none.",
    signature: "A loop at rest in the displacement: stiffness F_c/z_s below breakaway, frequency depends on the amplitude.",
    reference: "P. R. Dahl, A solid friction model, Aerospace Corporation TOR-0158(3107-18)-1 (1968)",
};
