//! The dictionary: the list of candidate terms, and what was left out of it.

use crate::{DictionaryError, Signal, Signals, Term};

/// A candidate that was left out, and why.
#[derive(Debug, Clone, PartialEq)]
pub struct Dropped {
    /// The candidate as text.
    pub text: String,
    /// Why it was left out.
    pub reason: DroppedReason,
}

/// Why a candidate was left out.
#[derive(Debug, Clone, PartialEq)]
pub enum DroppedReason {
    /// It holds the square of a sign, which is 1.
    SignSquared {
        /// The candidate that it equals.
        same_as: String,
    },
    /// It is an exact linear combination of candidates that were kept (a difference beside both of its lags).
    Collinear {
        /// Those candidates.
        within: Vec<String>,
    },
}

/// The candidate terms of one system.
#[derive(Debug, Clone, PartialEq)]
pub struct Dictionary {
    signals: Signals,
    terms: Vec<Term>,
    dropped: Vec<Dropped>,
}

impl Dictionary {
    /// A dictionary of exactly these terms, in this order; repeated terms are kept once.
    ///
    /// # Errors
    /// No term, or a term of an input that there is not, or of the output at lag 0.
    pub fn from_terms(signals: Signals, terms: impl IntoIterator<Item = Term>) -> Result<Self, DictionaryError> {
        let mut kept: Vec<Term> = Vec::new();
        let mut seen = std::collections::HashSet::new();
        for term in terms {
            for f in term.factors() {
                match f.quantity.signal() {
                    Signal::Output if f.lag == 0 => return Err(DictionaryError::OutputLagZero),
                    Signal::Input(i) if i >= signals.inputs().len() => {
                        let expected = signals.inputs().len();
                        return Err(DictionaryError::InputCount { expected, found: i + 1 });
                    }
                    _ => {}
                }
            }
            if seen.insert(term.clone()) {
                kept.push(term);
            }
        }
        if kept.is_empty() {
            return Err(DictionaryError::Empty);
        }
        Ok(Self { signals, terms: kept, dropped: Vec::new() })
    }

    pub(crate) fn from_parts(signals: Signals, terms: Vec<Term>, dropped: Vec<Dropped>) -> Self {
        Self { signals, terms, dropped }
    }

    /// The signals.
    pub fn signals(&self) -> &Signals {
        &self.signals
    }

    /// The candidates.
    pub fn terms(&self) -> &[Term] {
        &self.terms
    }

    /// Number of candidates.
    pub fn len(&self) -> usize {
        self.terms.len()
    }

    /// Whether there is no candidate (there always is one).
    pub fn is_empty(&self) -> bool {
        self.terms.is_empty()
    }

    /// What was left out, and why.
    pub fn dropped(&self) -> &[Dropped] {
        &self.dropped
    }

    /// Candidate `j` as text.
    pub fn text(&self, j: usize) -> String {
        self.terms.get(j).map_or_else(String::new, |t| self.signals.format(t))
    }

    /// The number of this candidate.
    pub fn find(&self, term: &Term) -> Option<usize> {
        self.terms.iter().position(|t| t == term)
    }

    /// The number of samples that the candidates reach back.
    pub fn reach(&self) -> usize {
        self.terms.iter().map(Term::reach).max().unwrap_or(0)
    }
}
