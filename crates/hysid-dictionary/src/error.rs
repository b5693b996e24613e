//! What can be wrong with a term, a specification or the data given to a dictionary.

/// Bad input to the dictionary.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DictionaryError {
    /// A term's text does not follow the grammar.
    #[error("`{text}` is not a term: {problem} at character {at}; a term looks like `y[n-1]^2*u[n]`")]
    BadTerm {
        /// The text as given.
        text: String,
        /// What is wrong.
        problem: String,
        /// Where, in characters from 1.
        at: usize,
    },
    /// Two signals cannot be told apart in text.
    #[error("the name `{0}` stands for two signals")]
    AmbiguousName(String),
    /// A name that cannot be written in a term.
    #[error(
        "`{0}` cannot name a signal: a symbol is a letter followed by letters, digits and `_`, and no name holds a backtick"
    )]
    BadName(String),
    /// The output at lag 0 cannot explain itself.
    #[error("lag 0 of the output is the target itself; output lags start at 1")]
    OutputLagZero,
    /// A lag beyond what is sensible.
    #[error("lag {lag} is beyond the largest allowed, {largest}")]
    LagTooLarge {
        /// The lag asked for.
        lag: usize,
        /// The largest allowed.
        largest: usize,
    },
    /// Degree 0 leaves no candidates.
    #[error("degree {0} is not allowed; it must be 1 to 9")]
    BadDegree(usize),
    /// Lags were given for another number of inputs than there are.
    #[error("lags are given for {found} inputs; there are {expected}")]
    InputCount {
        /// Inputs that there are.
        expected: usize,
        /// Inputs that were given.
        found: usize,
    },
    /// The specification has too many candidates.
    #[error("the dictionary would have more than {limit} candidates; take fewer lags or a lower degree")]
    TooLarge {
        /// The largest number allowed.
        limit: usize,
    },
    /// No candidate is left.
    #[error("no candidate is left: give lags, the constant, or gentler rules")]
    Empty,
    /// A record's inputs and output differ in length, or in number from the dictionary's.
    #[error("record {record}: {problem}")]
    BadRecord {
        /// The record, from 0.
        record: usize,
        /// What is wrong.
        problem: String,
    },
    /// No sample has all its lags.
    #[error(
        "no sample has all its lags inside one gap-free stretch: the longest stretch has {longest} samples, the largest lag is {lag}"
    )]
    TooShort {
        /// Length of the longest stretch.
        longest: usize,
        /// The largest lag.
        lag: usize,
    },
    /// Terms and coefficients differ in number.
    #[error("{terms} terms and {theta} coefficients")]
    CoefficientCount {
        /// Number of terms.
        terms: usize,
        /// Number of coefficients.
        theta: usize,
    },
}
