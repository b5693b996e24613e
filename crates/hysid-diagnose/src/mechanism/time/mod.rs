//! What changes with the clock or with the heat.

use super::{Grid, Law};

mod abrupt_change;
mod dissipation_heating;
mod parameter_drift;
mod periodic_disturbance;

pub use abrupt_change::ABRUPT_CHANGE;
pub use dissipation_heating::DISSIPATION_HEATING;
pub use parameter_drift::PARAMETER_DRIFT;
pub use periodic_disturbance::PERIODIC_DISTURBANCE;

/// A drift that comes to an end: with the time constant `tau_d`.
pub(super) fn settling(law: Law) -> Law {
    law.shape("tau_d", "T", Grid::Values(vec![0.08, 0.25, 0.8])).within(0.02, 3.0)
}
