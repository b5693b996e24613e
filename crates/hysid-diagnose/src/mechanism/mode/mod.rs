//! Missing inertia: a further mode, a mass that is not constant.

mod position_dependent_inertia;
mod unmodelled_mode;

pub use position_dependent_inertia::POSITION_DEPENDENT_INERTIA;
pub use unmodelled_mode::UNMODELLED_MODE;
