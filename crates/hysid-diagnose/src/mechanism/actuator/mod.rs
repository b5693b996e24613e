//! Hysteresis of an actuator: sums of plays.

mod asymmetric_hysteresis;
mod prandtl_ishlinskii;
mod preisach;
mod rate_dependent_hysteresis;

pub use asymmetric_hysteresis::ASYMMETRIC_HYSTERESIS;
pub use prandtl_ishlinskii::PRANDTL_ISHLINSKII;
pub use preisach::PREISACH;
pub use rate_dependent_hysteresis::RATE_DEPENDENT_HYSTERESIS;

use super::{Grid, Law, Purpose};

/// Plays in a law: most recordings cannot tell more than three weights.
fn how_many(purpose: Purpose) -> usize {
    match purpose {
        Purpose::Screening | Purpose::Refit => 3,
        Purpose::Finer => 6,
    }
}

/// The radii of the plays as shares of half the input's range.
const RADII: [&[f64]; 2] = [&[0.1, 0.3, 0.6], &[0.06, 0.15, 0.28, 0.42, 0.58, 0.78]];

/// `+ p_i*(play(signal, r_i) - signal)` for each play: for large swings the gain stays what it was.
fn plays(signal: &str, count: usize) -> String {
    (1..=count).map(|i| format!(" + p_{i}*(play({signal}, r_{i}) - {signal})")).collect()
}

/// The weights and the fixed radii that [`plays`] names.
fn with_radii(mut law: Law, signal: &'static str, count: usize) -> Law {
    let radii = RADII.iter().find(|r| r.len() == count).copied().unwrap_or_default();
    for (i, share) in (1..).zip(radii) {
        law = law.amplitude(format!("p_{i}"), "1", -0.2, 1.0).constant(
            format!("r_{i}"),
            signal,
            Grid::Reach(signal, vec![*share]),
        );
    }
    law
}
