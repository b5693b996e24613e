//! From a simulation and a recording to a verdict: mismatch test, mechanisms, evidence, composition, experiment.

pub mod answer;
pub mod evidence;
pub mod mechanism;
pub mod refit;
pub mod slot;
pub mod verdict;

mod calibration;
mod column;
mod data;
mod error;
mod experiment;
mod model;
mod openset;
mod pipeline;
mod random;
mod request;
mod search;

pub use answer::bootstrap::{Ratio, ratio_of_rms, rms};
pub use column::{StandIn, stand_in};
pub use data::{DataSet, Stretch, held_out_blocks};
pub use error::DiagnoseError;
pub use model::{Model, Outputs, Unknown, Values};
pub use pipeline::{Diagnosis, diagnose};
pub use request::{Hooks, Options, Question, Request};
