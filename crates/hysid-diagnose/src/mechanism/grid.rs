//! The values of a parameter that are tried.

/// The values that a shape parameter is tried at.
#[derive(Debug, Clone, PartialEq)]
pub enum Grid {
    /// These multiples of the measure.
    Values(Vec<f64>),
    /// These shares of half the range of a slot's signal.
    Reach(&'static str, Vec<f64>),
    /// The same, and the periods over that signal to which the residual points.
    Turns(&'static str, Vec<f64>),
    /// These multiples of the measure, as many waves over an angle, and so few that its size is this many radians in one: there a wave is a power.
    Waves(&'static str, Vec<f64>, f64),
    /// Quantiles of the absolute value of a slot's signal.
    Quantiles(&'static str, Vec<f64>),
    /// Quantiles of a slot's signal.
    SignedQuantiles(&'static str, Vec<f64>),
    /// That many points inside the recording's duration, in seconds.
    Times(usize),
    /// That many frequencies over the excited band, in Hz, logarithmic, and those of the largest peaks of the residual: what rings on after a sweep has
    /// passed is sharper than any grid.
    Band(usize),
    /// That many time constants from the excited band's fastest to a quarter of the recording, in seconds, logarithmic.
    Memory(usize),
    /// Frequencies of the largest peaks of the residual, else that many over the whole band, in Hz.
    Peaks(usize),
    /// The smallest step between the recorded values of the slot's output.
    Resolution,
}

/// `count` logarithmic steps from `low` to `high`.
pub(crate) fn log_steps(low: f64, high: f64, count: usize) -> Vec<f64> {
    let last = count.saturating_sub(1).max(1) as f64;
    (0..count).map(|i| low * (high / low).powf(i as f64 / last)).collect()
}

/// A grid of `count` logarithmic multiples of the measure.
pub(crate) fn log_grid(low: f64, high: f64, count: usize) -> Grid {
    Grid::Values(log_steps(low, high, count))
}
