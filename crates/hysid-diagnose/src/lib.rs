//! From a simulation and a recording to a verdict: mismatch test, mechanisms, evidence, composition, experiment.
//!
//! `pipeline.rs` leads through the steps in their order; each room answers one question of its own.
//!
//! | room | the question that it answers |
//! |---|---|
//! | `data` | What was recorded, and which part of it is fitted? |
//! | `slot` | Where in the equations can something be missing? |
//! | `mechanism` | What could be missing there, and how is it written into the simulation? |
//! | `model` | What does a simulation answer on the data, and what does it leave of them? |
//! | `refit` | Which values of the unknowns leave the least? |
//! | `evidence` | How much does a signal explain of what is left, and how much of that is chance? |
//! | `calibration` | How well can the simulation do as it is? |
//! | `column` | What stands for a simulator that is known by its output only? |
//! | `search` | Which sets of effects explain what is left? |
//! | `openset` | Is it something that no mechanism explains, and what does that look like? |
//! | `verdict` | How likely is each set, and what may be said firmly? |
//! | `experiment` | What would settle it, and what is lost if it is settled wrongly? |
//! | `answer` | What is the user told? |

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
pub use model::base::Interval;
pub use model::{Model, Outputs, Unknown, Values};
pub use pipeline::{Diagnosis, diagnose};
pub use request::{Hooks, Options, Question, Request};
