//! From a simulation and a recording to a verdict: mismatch test, mechanisms, evidence, composition, experiment.

pub mod evidence;
pub mod file;
pub mod mechanism;
pub mod picture;
mod random;
pub mod refit;
pub mod slot;
