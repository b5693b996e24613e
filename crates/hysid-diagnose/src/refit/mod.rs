//! Refitting by simulation error: the least-squares engine and what it is fed with.

mod held;
mod lm;
mod normal;
mod options;

pub use held::Held;
pub use lm::{Fit, Problem, go_on, levenberg_marquardt};
pub use options::LmOptions;
