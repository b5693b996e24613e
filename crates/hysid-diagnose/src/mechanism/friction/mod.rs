//! Dry friction: forces of the sign of the velocity.

mod asymmetric;
mod coulomb;
mod load_dependent;
mod stribeck;

pub use asymmetric::ASYMMETRIC_FRICTION;
pub use coulomb::COULOMB_FRICTION;
pub use load_dependent::LOAD_DEPENDENT_FRICTION;
pub use stribeck::STRIBECK_FRICTION;
