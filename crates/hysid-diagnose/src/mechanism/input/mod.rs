//! Input characteristics without memory.

mod dead_zone;
mod polynomial;
mod saturation;

pub use dead_zone::DEAD_ZONE;
pub use polynomial::INPUT_POLYNOMIAL;
pub use saturation::INPUT_SATURATION;
