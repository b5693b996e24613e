//! Backlash.

mod backlash;

pub use backlash::BACKLASH;
