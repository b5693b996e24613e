//! From a simulation and a recording to a verdict: mismatch test, mechanisms, evidence, composition, experiment.

pub mod evidence;
pub mod file;
mod left;
mod locate;
pub mod mechanism;
pub mod picture;
pub mod refit;
pub mod reliability;
pub mod slot;
pub mod verdict;

mod assemble;
mod base;
mod bootstrap;
mod budget;
mod calibrate;
mod column;
mod compose;
mod data;
mod draw;
mod error;
mod experiment;
mod finer;
mod firmness;
mod fitting;
mod force;
mod fresh;
mod hold;
mod hypothesis;
mod intake;
mod joint;
mod model;
mod numerics_check;
mod openset;
mod peaks;
mod pipeline;
mod random;
mod records;
mod region;
mod rehearsal;
mod report_values;
mod screen;
mod search;
mod second_look;
mod text;
mod thinning;
mod unfold;
mod weigh;

pub use bootstrap::{Ratio, ratio_of_rms, rms};
pub use column::{StandIn, stand_in};
pub use data::{DataSet, Stretch, held_out_blocks};
pub use error::DiagnoseError;
pub use model::{Model, Outputs, Unknown, Values};

pub use pipeline::{Diagnosis, Hooks, Options, Question, Request, diagnose};
