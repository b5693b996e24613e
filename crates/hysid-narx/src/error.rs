//! What can be wrong with what a model is made of or run on.

use hysid_signal::tell::counted;

/// Bad input to a model.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NarxError {
    /// Terms, factors or records that the dictionary refuses.
    #[error(transparent)]
    Dictionary(#[from] hysid_dictionary::DictionaryError),
    /// A least-squares problem that has no solution.
    #[error("least squares: {0}")]
    LeastSquares(String),
    /// A derived input that is not possible.
    #[error("derived input `{symbol}`: {problem}")]
    BadDerived {
        /// Its symbol.
        symbol: String,
        /// What is wrong.
        problem: String,
    },
    /// Fewer samples than parameters.
    #[error(
        "{} {} fewer than the {parameters} parameters; give a longer recording or fewer terms",
        counted(*samples, "usable sample"),
        if *samples == 1 { "is" } else { "are" }
    )]
    TooFewSamples {
        /// Samples that have all their lags.
        samples: usize,
        /// Parameters to estimate.
        parameters: usize,
    },
    /// A record whose inputs or lengths are not the model's.
    #[error("record {record}: {problem}")]
    BadRecord {
        /// The record, from 0.
        record: usize,
        /// What is wrong.
        problem: String,
    },
    /// A model file that does not describe a model.
    #[error("model file: {0}")]
    BadFile(String),
}
