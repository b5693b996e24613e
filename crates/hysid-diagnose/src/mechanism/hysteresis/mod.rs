//! Springs with a hysteresis loop.

mod asymmetric_bouc_wen;
mod bouc_wen;
mod degradation;
mod pinching;

pub use asymmetric_bouc_wen::ASYMMETRIC_BOUC_WEN;
pub use bouc_wen::BOUC_WEN;
pub use degradation::DEGRADATION;
pub use pinching::PINCHING;
