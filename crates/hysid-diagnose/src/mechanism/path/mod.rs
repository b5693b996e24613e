//! Delay and lag of the signal path: one family, for on a linear plant nothing tells them apart.

mod actuator_lag;
mod delay;
mod sensor_lag;

pub use actuator_lag::ACTUATOR_LAG;
pub use delay::DELAY;
pub use sensor_lag::SENSOR_LAG;
