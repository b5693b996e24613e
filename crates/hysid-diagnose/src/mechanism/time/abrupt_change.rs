//! A parameter that jumps at one moment.

use crate::mechanism::{Block, Family, Grid, Law, Mechanism, Need, anywhere};
use crate::slot::Place;

/// A parameter that jumps at one moment.
pub static ABRUPT_CHANGE: Mechanism = Mechanism {
    id: "abrupt_change",
    family: Family::TimeVariation,
    block: Block::TimeVariation,
    places: &[Place::Parameter, Place::Sensor],
    applies: anywhere,
    already: &["p*(1 + P*max(0, min(1, (t - Q)/R)))", "p*(1 + P*step(t - Q))"],
    law: |slot, _| {
        // A sensor's gain under a name of its own: a sentence of its own tells it.
        let (signal, share) = if slot.place == Place::Sensor { ("y", "delta_y") } else { ("p", "delta") };
        // The jump takes two samples, so that the response moves smoothly with its moment and the moment can be fitted.
        Law::replace(format!("{signal}*(1 + {share}*max(0, min(1, (t - t_0)/h_0)))"))
            .amplitude(share, "1", -0.95, 3.0)
            .shape("t_0", "t", Grid::Times(24))
            .searched()
            .constant("h_0", "h", Grid::Values(vec![2.0]))
            .silent()
    },
    contains: &[],
    confusable: &["parameter_drift"],
    needs: &[Need::EarlyAndLate("y")],
    sentence: "[{parameter} jumps by the share {delta}][The sensor's gain jumps by the share {delta_y} {place}] at {t_0}; the simulation holds it constant.",
    signature: "The residual begins at one moment; the cumulated scores have a kink there.",
    reference: "M. Basseville, I. V. Nikiforov, Detection of Abrupt Changes: Theory and Application, Prentice-Hall (1993)",
};
