//! What changes with the clock or with the heat.

mod abrupt_change;
mod dissipation_heating;
mod parameter_drift;
mod periodic_disturbance;

pub use abrupt_change::ABRUPT_CHANGE;
pub use dissipation_heating::DISSIPATION_HEATING;
pub use parameter_drift::PARAMETER_DRIFT;
pub use periodic_disturbance::PERIODIC_DISTURBANCE;
