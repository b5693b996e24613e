//! From document to trajectories: the graph of all equations, the programs taken from it, and the integrator.

mod accuracy;
mod compile;
mod differentiate;
mod graph;
mod integrate;
mod linearise;
mod many;
mod memory;
mod program;
mod run;
mod surface;

pub use accuracy::StepCheck;
pub use compile::Compiled;
pub use linearise::Linearisation;
pub use run::{DataError, Direction, Drive, Injection, Observer, Response, Run, Sensitivity, Slot, Start};

pub(crate) use run::column;
