//! Free play inside a spring: no force within a gap.

use crate::mechanism::play::in_a_coupling;
use crate::mechanism::{Block, Family, Grid, Law, Mechanism, Need, Purpose};
use crate::slot::Place;

/// Free play inside a spring: no force within a gap.
pub static SPRING_CLEARANCE: Mechanism = Mechanism {
    id: "spring_clearance",
    family: Family::Clearance,
    block: Block::Restoring,
    places: &[Place::Force, Place::ForceLaw, Place::Connection],
    // Free play between two parts that turn is backlash.
    applies: |slot| slot.has("x") && slot.has("k") && !(slot.place == Place::Connection && slot.turns()),
    already: &["max(min(x, P), Q)", "min(max(x, P), Q)"],
    law: |slot, purpose| {
        if slot.place == Place::Connection {
            return in_a_coupling(slot, purpose, "g");
        }
        let gap = Grid::Quantiles("x", vec![0.1, 0.2, 0.35, 0.5, 0.7]);
        match purpose {
            Purpose::Screening => Law::force("-w*k*max(min(x, g), -g)").weight().shape("g", "x", gap),
            Purpose::Refit | Purpose::Form(_) => {
                Law::force("-k*max(min(x, g), -g)").shape("g", "x", gap).within(0.0, 3.0).neutral(0.0)
            }
        }
    },
    contains: &[],
    confusable: &["backlash", "cubic_stiffness", "gap_stop"],
    needs: &[Need::Levels("x", 1.5)],
    sentence: "The spring {place} has free play: within {g} of the middle it gives no force.",
    signature: "Hardly any stiffness near zero: small oscillations are sloppy, large ones are not.",
    reference: "C. Padmanabhan, R. Singh, Spectral coupling issues in a two-degree-of-freedom system with clearance non-linearities, J. Sound Vib. 155 (1992) 209-230",
};
