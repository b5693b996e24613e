//! Judging a model on a recording: error measures with a named normaliser, residual tests, loop areas, errors by branch, baselines.
//!
//! * [`measure`] says how far a prediction is from the measurement; nothing is normalised without the normaliser's name.
//! * [`residual_tests`] asks whether the residual still holds what a better model could have explained (Billings and Voon).
//! * [`loop_areas`] and [`by_branch`] look at what hysteresis is about: the loop, and the two ways through it.
//! * [`persistence`] and [`LinearArx`] are what every model must beat.
//!
//! A sample that is missing (`NaN`) in the measurement or in the prediction is left out and counted; nothing else is.

mod baseline;
mod branch;
mod correlation;
mod loops;
mod measure;

pub use baseline::{ArxRecord, BaselineError, LinearArx, persistence};
pub use branch::{BranchErrors, Direction, branches, by_branch};
pub use correlation::{CorrelationTest, ResidualRecord, residual_tests};
pub use loops::{Loop, loop_areas};
pub use measure::{Errors, Normaliser, measure};
