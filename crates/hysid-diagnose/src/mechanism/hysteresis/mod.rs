//! Springs with a hysteresis loop.

mod asymmetric_bouc_wen;
mod bouc_wen;
mod degradation;
mod pinching;

use crate::slot::{Place, Slot};

/// For `Mechanism::applies`: beside no loop of the simulation, or in one.
fn beside_none_or_in_one(slot: &Slot) -> bool {
    slot.place == Place::Loop || (slot.has("x") && slot.has("v") && !slot.loops())
}

pub use asymmetric_bouc_wen::ASYMMETRIC_BOUC_WEN;
pub use bouc_wen::BOUC_WEN;
pub use degradation::DEGRADATION;
pub use pinching::PINCHING;
