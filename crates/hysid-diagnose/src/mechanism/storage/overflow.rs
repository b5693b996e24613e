//! A store that spills what exceeds its brim.

use crate::mechanism::{Block, Family, Grid, Law, Mechanism};
use crate::slot::Place;

/// A store that spills what exceeds its brim.
pub static OVERFLOW: Mechanism = Mechanism {
    id: "overflow",
    family: Family::Storage,
    block: Block::Restoring,
    places: &[Place::Store],
    // Heat has no brim: what leaves it faster when it is hot is another law.
    applies: |slot| !slot.is_thermal(),
    already: &["max(s - P, 0)", "min(s, P)"],
    law: |_, _| {
        Law::outflow("c_o*max(s - s_max, 0)")
            .amplitude("c_o", "F/s", 0.0, 20.0)
            .shape("s_max", "s", Grid::SignedQuantiles("s", vec![0.6, 0.75, 0.85, 0.92, 0.97, 0.99]))
            .searched()
    },
    contains: &[],
    confusable: &["output_saturation", "leakage"],
    needs: &[],
    sentence: "The store {place} overflows above {s_max}; the simulation lets it rise.",
    signature: "One-sided, only when nearly full.",
    reference: "M. Schoukens, P. Mattsson, T. Wigren, J.-P. Noël, Cascaded tanks benchmark combining soft and hard nonlinearities, Workshop on Nonlinear System Identification Benchmarks (2016)",
};
