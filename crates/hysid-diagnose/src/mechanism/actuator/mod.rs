//! Hysteresis of an actuator: sums of plays.

mod asymmetric_hysteresis;
mod plays;
mod prandtl_ishlinskii;
mod preisach;
mod rate_dependent_hysteresis;

pub use asymmetric_hysteresis::ASYMMETRIC_HYSTERESIS;
pub use prandtl_ishlinskii::PRANDTL_ISHLINSKII;
pub use preisach::PREISACH;
pub use rate_dependent_hysteresis::RATE_DEPENDENT_HYSTERESIS;
