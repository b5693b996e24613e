//! What a sensor does to the output.

mod output_saturation;
mod quantisation;
mod rectified_output;
mod sensor_drift;

pub use output_saturation::OUTPUT_SATURATION;
pub use quantisation::QUANTISATION;
pub use rectified_output::RECTIFIED_OUTPUT;
pub use sensor_drift::SENSOR_DRIFT;
