//! From document to trajectories: the graph of all equations, the programs taken from it, and the integrator.

mod compile;
mod differentiate;
mod graph;
mod integrate;
mod memory;
mod program;
mod run;
mod surface;

pub use compile::Compiled;
pub use run::{DataError, Direction, Drive, Injection, Observer, Response, Run, Sensitivity, Slot, Start};
