//! Losses of a store.

mod leakage;
mod overflow;

pub use leakage::LEAKAGE;
pub use overflow::OVERFLOW;
