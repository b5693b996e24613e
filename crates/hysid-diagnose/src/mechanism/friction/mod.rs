//! Dry friction: forces of the sign of the velocity.

mod asymmetric;
mod coulomb;
mod load_dependent;
mod stribeck;

use crate::slot::Slot;

pub use asymmetric::ASYMMETRIC_FRICTION;
pub use coulomb::COULOMB_FRICTION;
pub use load_dependent::LOAD_DEPENDENT_FRICTION;
pub use stribeck::STRIBECK_FRICTION;

/// The sign of the velocity in a law beside the simulation's own friction, as that has it: sharp or smoothed.
fn sign(slot: &Slot) -> &'static str {
    if slot.has("own_sign") { "own_sign" } else { "sign(v)" }
}

/// Whether the simulation has dry friction at the slot already, smoothed or not: then only what it lacks is added.
fn is_there(slot: &Slot) -> bool {
    COULOMB_FRICTION.is_in(slot)
}
