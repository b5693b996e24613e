//! Unsteady aerodynamics.

mod stall_lag;

pub use stall_lag::STALL_LAG;
