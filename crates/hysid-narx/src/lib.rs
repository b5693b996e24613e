//! The identified model: estimate, one-step, k-step and free run, uncertainty, noise model, equilibria, export.
