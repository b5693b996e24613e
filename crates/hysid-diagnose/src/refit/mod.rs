//! Refitting by simulation error: the least-squares engine and what it is fed with.

mod lm;

pub use lm::{Fit, LmOptions, Problem, go_on, levenberg_marquardt};
