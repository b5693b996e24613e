//! Values of functions, with their conventions.

/// -1, 0 or 1; `NaN` for `NaN`.
pub(crate) fn sign(x: f64) -> f64 {
    if x > 0.0 {
        1.0
    } else if x < 0.0 {
        -1.0
    } else {
        x * 0.0
    }
}
