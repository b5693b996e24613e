//! From a simulation and a recording to a verdict: mismatch test, mechanisms, evidence, composition, experiment.

pub mod evidence;
pub mod file;
pub mod mechanism;
mod random;
pub mod refit;
pub mod slot;
