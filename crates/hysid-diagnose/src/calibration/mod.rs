//! Calibration: the simulation as it is, fitted before anything is added to it, and once more where a search teaches something of it.

pub mod fair;
pub mod global;
pub mod lesson;
pub mod unfold;
