//! `identify`: from recordings a compact NARX model whose free run is good and stable.
//!
//! A tiny one-step error proves nothing: on densely sampled data "the next sample is like the last" has one. So everything
//! here is judged by the free run, on blocks of the estimation recordings that are held out:
//!
//! 1. Linear models of several lags, refined on their free run; the best lags start the rest.
//! 2. Families of candidates compete: products of lags; the magnitude and sign of differences; operators with memory on the
//!    inputs; a filter and a threshold (block structure). Each grows from its linear model: the next term is the one that
//!    would lower the *free-run* error most ([`hysid_narx::Trainer::next_terms`]), then all coefficients are refined.
//! 3. The best families grow on; the stage with the lowest held-out error, or the shortest one close to it, is the model.
//! 4. It is refined on all estimation samples, and checked: does it still run, does it stay, how far does it hold.

mod blocks;
mod coloured;
mod compete;
mod criterion;
mod data;
mod desk;
mod families;
mod family;
mod growth;
mod linear;
mod options;
mod path;
mod plays;
mod rates;
mod recipe;
mod report;
mod split;
mod verify;

pub use options::{Criterion, Decimate, Factors, LARGEST_DEGREE, LARGEST_LAG, LARGEST_TERMS, Options};
pub use path::PathPoint;
pub use recipe::{Identified, Progress, Source, Stop, identify, identify_until};
pub use report::{
    Columns, ErrorLine, FitReport, FitSummary, Horizon, Lags, NoiseLine, Role, Series, TermLine, every, same_rate,
};

use hysid_narx::NarxError;
use hysid_signal::tell::{brief, counted, digits};

/// Bad input to an identification.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum IdentifyError {
    /// An option out of its range.
    #[error("{0}")]
    Option(String),
    /// No recording, no input.
    #[error("there is no {0} to learn from")]
    Nothing(&'static str),
    /// A column that a recording lacks.
    #[error("{recording}: there is no column `{column}`")]
    MissingColumn {
        /// The recording.
        recording: String,
        /// The column.
        column: String,
    },
    /// A signal without a single sample.
    #[error("column `{0}` has no sample")]
    Empty(String),
    /// A signal that never changes.
    #[error("column `{}` is constant ({}): there is nothing to learn from it", brief(column), digits(*value, 4))]
    Constant {
        /// The column.
        column: String,
        /// Its value.
        value: f64,
    },
    /// Too short for the lags and parameters asked for.
    #[error(
        "the recordings have {} in a row at most; {needed} are needed for these lags and parameters",
        counted(*samples, "usable sample")
    )]
    TooShort {
        /// Samples of the longest gap-free stretch.
        samples: usize,
        /// Samples needed.
        needed: usize,
    },
    /// A signal named twice.
    #[error("column `{0}` is given twice")]
    Twice(String),
    /// The caller wanted no more of it.
    #[error("it was stopped before it was done")]
    Stopped,
    /// The model's own refusal.
    #[error(transparent)]
    Narx(#[from] NarxError),
}
