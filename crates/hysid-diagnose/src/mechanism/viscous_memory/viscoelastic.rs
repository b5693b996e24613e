//! A spring with a dashpot in series: stiffness that relaxes.

use crate::mechanism::{Block, Family, Form, Grid, Law, Mechanism, Need, Purpose};
use crate::slot::Place;

/// A spring with a dashpot in series: stiffness that relaxes.
pub static VISCOELASTIC: Mechanism = Mechanism {
    id: "viscoelastic",
    family: Family::LinearMemory,
    block: Block::Hysteresis,
    places: &[Place::Force, Place::Connection, Place::ForceLaw],
    applies: |slot| slot.has("x"),
    already: &["lag(x, P)"],
    law: |_, purpose| {
        // What came before the recording may not have relaxed yet.
        let settled = purpose != Purpose::Form(Form::Unsettled);
        let force = if settled { "k_m*(x - lag(x, tau_m))" } else { "k_m*(x - x_m)" };
        let law = Law::force(force).amplitude("k_m", "F/x", 0.0, 3.0).shape("tau_m", "t", Grid::Memory(6));
        if settled { law } else { law.state("x_m", "x", "(x - x_m)/tau_m").starting_free() }
    },
    contains: &[],
    confusable: &["sensor_lag", "delay", "bouc_wen"],
    needs: &[Need::Band(3.0)],
    sentence: "A stiffness of {k_m} that relaxes within {tau_m} acts {place}; the simulation has none.",
    signature: "A loop that vanishes at very slow and very fast motion; linear in the amplitude.",
    reference: "R. Lakes, Viscoelastic Materials, Cambridge University Press (2009)",
};
