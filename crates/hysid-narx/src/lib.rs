//! The identified model: estimate, one-step, k-step and free run, uncertainty, noise model, equilibria, export.
//!
//! [`NarxModel`] is what identification returns and `model.json` holds: terms with coefficients, immutable. [`Trainer`] is
//! where it comes from: recordings made ready, least squares, simulation-error refinement, and the search for the next term
//! by what it would do to the *free run*. A [`Derived`] input is computed from a recorded one (an operator with memory, a
//! filter, a soft threshold) before the polynomial sees it. A free run that diverges is a result, not an error.

mod bank;
mod derived;
mod error;
mod export;
mod file;
mod grow;
mod model;
mod noise;
mod normal;
mod poles;
mod program;
mod refine;
mod rest;
mod run;
mod trainer;

pub use bank::{Bank, mean_over_step};
pub use derived::{Derived, Law, Past};
pub use error::NarxError;
pub use file::{LoadError, MODEL_FORMAT, MODEL_VERSION};
pub use grow::{Evaluate, Gain};
pub use model::{Coefficient, NarxModel, NoiseTerm, Parts, Prediction};
pub use noise::Narmax;
pub use poles::{multiply_factors, pole_factors};
pub use rest::{Equilibrium, StaticLoop};
pub use run::Window;
pub use trainer::{Fit, Refine, RunError, Trainer};
