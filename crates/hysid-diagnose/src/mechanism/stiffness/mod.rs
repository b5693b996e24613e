//! Forces of the position alone: stiffening, unequal sides, clearance, weight, ripple.

mod bilinear;
mod cogging;
mod cubic;
mod gap_stop;
mod gravity;
mod quadratic;
mod quintic;
mod spring_clearance;

pub use bilinear::BILINEAR_STIFFNESS;
pub use cogging::COGGING;
pub use cubic::CUBIC_STIFFNESS;
pub use gap_stop::GAP_STOP;
pub use gravity::GRAVITY;
pub use quadratic::QUADRATIC_STIFFNESS;
pub use quintic::QUINTIC_STIFFNESS;
pub use spring_clearance::SPRING_CLEARANCE;
