//! The criteria as numbers, from what a refit knows of one subset.

use crate::{Criterion, PressForm};

/// What is known of one subset.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Facts {
    pub terms: usize,
    pub samples: usize,
    /// Columns that it was chosen from.
    pub candidates: usize,
    /// Sum of squared residuals relative to y'y.
    pub sse: f64,
    /// Exact leave-one-out sum of squares relative to y'y.
    pub press: f64,
    /// Sum of squared errors on left-out blocks relative to y'y; NaN when not asked for.
    pub blocks: f64,
}

/// Sums of squares below this part of y'y are rounding, not misfit.
pub(crate) const ROUNDING: f64 = 1e-26;

/// The criterion's value; the smallest is the best.
pub(crate) fn value(criterion: &Criterion, f: Facts) -> f64 {
    let (n, samples) = (f.terms as f64, f.samples as f64);
    let share = 1.0 - n / samples;
    match criterion {
        Criterion::Terms(_) | Criterion::ErrTolerance(_) => f.sse,
        Criterion::Press(_) | Criterion::SearchedPress if share <= 0.0 => f64::INFINITY,
        Criterion::SearchedPress => {
            let price = ((f.candidates as f64).ln() - 1.0).max(0.0);
            f.press + 2.0 * n * price * f.sse / (samples - n)
        }
        Criterion::Press(PressForm::Exact) => f.press,
        Criterion::Press(PressForm::AsPrinted) => f.sse / share,
        Criterion::Press(PressForm::Squared) => f.sse / (share * share),
        Criterion::Blocks(_) => f.blocks,
        Criterion::Aic => samples * (f.sse.max(ROUNDING) / samples).ln() + 2.0 * n,
        Criterion::Bic => samples * (f.sse.max(ROUNDING) / samples).ln() + n * samples.ln(),
    }
}

/// The number of terms to keep, given the criterion for 1, 2, ... terms; and whether it is an inner minimum.
///
/// Values at the level of rounding count as equal, and of equal values the fewest terms win.
pub(crate) fn choose(criterion: &Criterion, values: &[f64], sse: &[f64]) -> usize {
    match criterion {
        Criterion::Terms(n) => (*n).min(values.len()),
        Criterion::ErrTolerance(rho) => sse.iter().position(|s| s <= rho).map_or(values.len(), |i| i + 1),
        Criterion::Aic | Criterion::Bic => smallest(values, f64::NEG_INFINITY),
        Criterion::Press(_) | Criterion::SearchedPress | Criterion::Blocks(_) => smallest(values, ROUNDING),
    }
}

fn smallest(values: &[f64], floor: f64) -> usize {
    let mut best = 0;
    for (i, v) in values.iter().enumerate() {
        if v.max(floor) < values[best].max(floor) {
            best = i;
        }
    }
    (best + 1).min(values.len())
}
