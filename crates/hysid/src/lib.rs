//! The facade: recipes that identify a model from recordings and diagnose a simulation against one.

pub mod identify;
pub mod stream;
