//! From document to trajectories: the graph of all equations, the programs taken from it, and the integrator.

mod accuracy;
mod compile;
mod crossing;
mod differentiate;
mod drive;
mod events;
mod graph;
mod linearise;
mod lockstep;
mod machine;
mod many;
mod memory;
mod program;
mod run;
mod simulate;
mod sliding;
mod step;
mod surface;
mod trajectory;
mod vector;

pub(crate) use accuracy::MOST_STEPS;
pub use accuracy::StepCheck;
pub use compile::Compiled;
pub use drive::{DataError, Drive};
pub use linearise::Linearisation;
pub use run::{Direction, Injection, Observer, Response, Run, Sensitivity, Slot, Start};

pub(crate) use drive::column;
