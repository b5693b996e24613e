//! What the user may decide instead of the data.

/// How often the output is sampled for the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Decimate {
    /// The recording's own rate, unless a lower one makes the free run clearly better.
    #[default]
    Auto,
    /// The recording's own rate.
    None,
    /// Every sample of this number.
    By(usize),
}

/// Which factors terms are made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Factors {
    /// Lags of the signals only.
    Polynomial,
    /// Lags, the magnitude and the sign of differences, operators with memory.
    Hysteresis,
    /// Whatever makes the free run best, block structures (a filter, a threshold) included.
    #[default]
    Auto,
}

/// What decides the number of terms where the user has not.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Criterion {
    /// The free run on held-out blocks.
    #[default]
    FreeRun,
    /// Leave-one-out error of one step ahead, with the price of the search ([`hysid_select::Criterion::SearchedPress`]).
    Press,
    /// Akaike's criterion, one step ahead.
    Aic,
    /// The Bayesian criterion, one step ahead.
    Bic,
    /// Error reduction ratio: stop when less than this share is left.
    Err(f64),
}

/// Options of an identification. `None` leaves the decision to the data.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Options {
    /// Output lags, 1 to this.
    pub lags_output: Option<usize>,
    /// Input lags, up to this.
    pub lags_input: Option<usize>,
    /// The first input lag, 0 or 1: whether u\[n\] is a candidate.
    pub input_delay: Option<usize>,
    /// Largest number of factors in a term.
    pub degree: Option<usize>,
    /// Sampling-rate reduction.
    pub decimate: Decimate,
    /// Which factors.
    pub factors: Factors,
    /// Number of terms.
    pub terms: Option<usize>,
    /// What decides the number of terms.
    pub criterion: Criterion,
    /// Seed of whatever is random.
    pub seed: u64,
}

/// The largest lag that may be asked for.
pub const LARGEST_LAG: usize = 500;
/// The largest degree that may be asked for.
pub const LARGEST_DEGREE: usize = 7;
/// The largest number of terms that may be asked for.
pub const LARGEST_TERMS: usize = 200;

impl Options {
    /// What is wrong with them, in the words of the command line.
    pub fn problem(&self) -> Option<String> {
        let beyond = |what: &str, v: Option<usize>, low: usize, high: usize| {
            v.filter(|v| !(low..=high).contains(v)).map(|v| format!("{what} is {v}; it must be {low} to {high}"))
        };
        beyond("--lags-output", self.lags_output, 0, LARGEST_LAG)
            .or_else(|| beyond("--lags-input", self.lags_input, 0, LARGEST_LAG))
            .or_else(|| beyond("--input-delay", self.input_delay, 0, 1))
            .or_else(|| beyond("--degree", self.degree, 1, LARGEST_DEGREE))
            .or_else(|| beyond("--terms", self.terms, 1, LARGEST_TERMS))
            .or_else(|| match self.decimate {
                Decimate::By(l) => beyond("--decimate", Some(l), 1, 1000),
                _ => None,
            })
            .or_else(|| match self.criterion {
                Criterion::Err(e) if !(e > 0.0 && e < 1.0) => {
                    Some(format!("--criterion err:{e} is not allowed; the tolerance must lie between 0 and 1"))
                }
                _ => None,
            })
            .or_else(|| match (self.input_delay, self.lags_input) {
                (Some(d), Some(l)) if l < d => Some(format!("--lags-input is {l}, less than --input-delay {d}")),
                _ => None,
            })
    }
}
