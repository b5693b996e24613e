//! Dry friction that is purely elastic at first: no creep below breakaway.

use crate::mechanism::{Block, Family, Grid, Law, Mechanism, Need, log_grid};
use crate::slot::Place;

/// Dry friction that is purely elastic at first: no creep below breakaway.
pub static ELASTOPLASTIC_FRICTION: Mechanism = Mechanism {
    id: "elastoplastic_friction",
    family: Family::Presliding,
    block: Block::Hysteresis,
    places: &[Place::Force, Place::Connection, Place::ForceLaw],
    applies: |slot| slot.has("x") && slot.has("v") && !slot.loops(),
    already: &[],
    law: |_, _| {
        Law::force("F_c*z")
            .amplitude("F_c", "F", 0.0, 1.0)
            .shape("z_s", "x", log_grid(0.03, 1.0, 4))
            .elastic()
            .within(5e-4, 5.0)
            .at_least(0.03, "v*h")
            .shape("z_b", "1", Grid::Values(vec![0.3, 0.7]))
            .within(0.0, 0.95)
            .relaxing("z", "v - abs(v)*z*step(v*z)*(1 - cos(pi*max(0, min(1, (abs(z) - z_b)/(1 - z_b)))))/2", "z_s")
            .report("sigma_0", "F/x", "F_c/z_s")
    },
    contains: &["coulomb_friction"],
    confusable: &["dahl_friction", "bouc_wen"],
    needs: &[Need::Reversals("v", 6), Need::Levels("x", 1.5)],
    sentence: "Friction {place} of about {F_c} is elastic up to a share {z_b} of it and slides after {z_s}.",
    signature: "Dahl's loop without drift: below breakaway the displacement returns fully.",
    reference: "P. Dupont, V. Hayward, B. Armstrong, F. Altpeter, Single state elastoplastic friction models, IEEE Trans. Autom. Control 47 (2002) 787-792",
};
