//! Refitting by simulation error: the least-squares engine and what it is fed with.

mod lm;
mod normal;

pub use lm::{Fit, LmOptions, Problem, go_on, levenberg_marquardt};
