//! A spring with a dashpot in series: stiffness that relaxes.

use crate::mechanism::{Block, Family, Grid, Law, Mechanism, Need};
use crate::slot::Place;

/// A spring with a dashpot in series: stiffness that relaxes.
pub static VISCOELASTIC: Mechanism = Mechanism {
    id: "viscoelastic",
    family: Family::LinearMemory,
    block: Block::Hysteresis,
    places: &[Place::Force, Place::Connection, Place::ForceLaw],
    applies: |slot| slot.has("x"),
    already: &["lag(x, P)"],
    law: |_, _| {
        Law::force("k_m*(x - lag(x, tau_m))").amplitude("k_m", "F/x", 0.0, 3.0).shape("tau_m", "t", Grid::Memory(6))
    },
    contains: &[],
    confusable: &["sensor_lag", "delay", "bouc_wen"],
    needs: &[Need::Band(3.0)],
    sentence: "A stiffness of {k_m} that relaxes within {tau_m} acts {place}; the simulation has none.",
    signature: "A loop that vanishes at very slow and very fast motion; linear in the amplitude.",
    reference: "R. Lakes, Viscoelastic Materials, Cambridge University Press (2009)",
};
