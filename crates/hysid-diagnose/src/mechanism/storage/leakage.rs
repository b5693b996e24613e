//! A store that loses what it holds.

use crate::mechanism::{Block, Family, Form, Grid, Law, Mechanism, Need, Purpose};
use crate::slot::Place;

/// A store that loses what it holds.
pub static LEAKAGE: Mechanism = Mechanism {
    id: "leakage",
    family: Family::Storage,
    block: Block::Damping,
    places: &[Place::Store],
    applies: |slot| !(slot.has("k") && slot.shows_root("s")),
    already: &[],
    law: |slot, purpose| {
        // A loss in proportion would be a change of a parameter where the baseline has one.
        if slot.has("k") || purpose == Purpose::Form(Form::Other) {
            // Torricelli's law; the reference level keeps the unit of q_l that of a flow.
            Law::outflow("q_l*sqrt(max(s, 0)/s_r)").amplitude("q_l", "F", 0.0, 2.0).constant(
                "s_r",
                "s",
                Grid::Reach("s", vec![1.0]),
            )
        } else {
            Law::outflow("q_l*s/s_r").amplitude("q_l", "F", 0.0, 2.0).constant("s_r", "s", Grid::Reach("s", vec![1.0]))
        }
    },
    contains: &[],
    confusable: &["overflow", "input_offset"],
    needs: &[Need::Levels("s", 1.2)],
    sentence: "The store {place} leaks {q_l} at {s_r}; the simulation keeps what it has.",
    signature: "It drains faster than the simulation, more so when full.",
    reference: "M. Schoukens, P. Mattsson, T. Wigren, J.-P. Noël, Cascaded tanks benchmark combining soft and hard nonlinearities, Workshop on Nonlinear System Identification Benchmarks (2016)",
};
