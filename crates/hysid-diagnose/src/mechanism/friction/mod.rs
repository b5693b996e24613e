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

/// Whether the simulation has dry friction at the slot already, smoothed or not: then only what it lacks is added.
fn is_there(slot: &Slot) -> bool {
    COULOMB_FRICTION.is_in(slot)
}
