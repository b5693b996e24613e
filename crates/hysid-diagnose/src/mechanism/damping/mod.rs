//! Damping that is not proportional to the velocity.

mod displacement_dependent;
mod power_law;
mod quadratic;

pub use displacement_dependent::DISPLACEMENT_DEPENDENT_DAMPING;
pub use power_law::POWER_LAW_DAMPING;
pub use quadratic::QUADRATIC_DAMPING;
