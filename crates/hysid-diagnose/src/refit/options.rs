//! When a fit ends.

/// When to stop.
#[derive(Debug, Clone, Copy)]
pub struct LmOptions {
    /// Most iterations (each one tangent and one or more simulations).
    pub iterations: usize,
    /// Relative decrease of the cost below which the fit has converged: that of a step, or of all that are left if predictions were linear.
    pub tolerance: f64,
}

/// Log likelihood, in nats, that a fit need not go on for: a fifth of a standard deviation of one unknown.
const NEGLIGIBLE: f64 = 2e-2;

impl LmOptions {
    /// At most so many iterations on so many rows of unknown noise: to within [`NEGLIGIBLE`] of the likeliest.
    pub fn within(iterations: usize, rows: usize) -> Self {
        Self { iterations, tolerance: 2.0 * NEGLIGIBLE / rows.max(1) as f64 }
    }
}

impl Default for LmOptions {
    fn default() -> Self {
        Self { iterations: 30, tolerance: 1e-7 }
    }
}
