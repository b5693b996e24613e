//! From a simulation and a recording to a verdict: mismatch test, mechanisms, evidence, composition, experiment.
//!
//! `pipeline.rs` leads through the steps in their order; each room answers one question of its own.
//!
//! Rooms stand on those above them in this list and know nothing of those below (`xtask/layers.toml`; a test holds it).
//!
//! | room | the question that it answers |
//! |---|---|
//! | `file` | What stands in `diagnosis.json`? |
//! | `slot` | Where in the equations can something be missing? |
//! | `evidence` | How much does a signal explain of what is left, and how much of that is chance? |
//! | `refit` | Which values of the unknowns leave the least? |
//! | `mechanism` | What could be missing there, and how is it written into the simulation? |
//! | `request`, `budget` | What is asked, and how long may it take? |
//! | `data` | What was recorded, and which part of it is fitted? |
//! | `model` | What does a simulation answer on the data, what does it leave of them, and what is a set of effects in it worth? |
//! | `calibration` | How well can the simulation do as it is? |
//! | `openset` | Is it something that no mechanism explains, and what does that look like? |
//! | `search` | Which sets of effects explain what is left? |
//! | `verdict` | How likely is each set, what remains of it, and what may be said firmly? |
//! | `experiment` | What would settle it, and what is lost if it is settled wrongly? |
//! | `answer` | What is the user told? |
//! | `column` | What stands for a simulator that is known by its output only? |

pub mod answer;
pub mod evidence;
pub mod file;
pub mod mechanism;
pub mod refit;
pub mod slot;
pub mod verdict;

mod budget;
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
mod text;

#[cfg(test)]
#[path = "../tests/diagnose/oscillator.rs"]
mod oscillator;

pub use answer::bootstrap::{Ratio, ratio_of_rms, rms};
pub use column::{StandIn, stand_in};
pub use data::{DataSet, Stretch, held_out_blocks};
pub use error::DiagnoseError;
pub use model::base::Interval;
pub use model::{Model, Outputs, Unknown, Values};
pub use pipeline::{Diagnosis, diagnose};
pub use request::{Hooks, Options, Question, Request};
