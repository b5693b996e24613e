//! Which candidates there are: lags, degree, differences and signs, rules.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::ops::RangeInclusive;
use std::sync::Arc;

use crate::collinear::{Span, drop_collinear};
use crate::signals::LARGEST_LAG;
use crate::{Dictionary, DictionaryError, Dropped, DroppedReason, Factor, Signal, Signals, Term};

/// Candidates beyond this number are refused.
const LARGEST_DICTIONARY: usize = 200_000;

/// Whether the constant is a candidate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Constant {
    /// It competes like any other term.
    Candidate,
    /// It is left out.
    Omitted,
}

/// A rule that takes candidates out.
#[derive(Clone)]
pub enum Rule {
    /// Products of at least `from_degree` factors must carry equal lags throughout (`y[n-2]*u[n-2]^2`).
    EqualLags {
        /// The degree from which it holds.
        from_degree: usize,
    },
    /// Products of at least this degree must be powers of one factor.
    PurePowers {
        /// The degree from which it holds.
        from_degree: usize,
    },
    /// At most so many factors are made of this signal.
    AtMost {
        /// The signal.
        signal: Signal,
        /// The largest number of factors.
        factors: usize,
    },
    /// These terms are out.
    Exclude(Vec<Term>),
    /// Only terms for which the predicate holds stay.
    Keep(Arc<dyn Fn(&Term) -> bool + Send + Sync>),
}

impl fmt::Debug for Rule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::EqualLags { from_degree } => write!(f, "EqualLags {{ from_degree: {from_degree} }}"),
            Self::PurePowers { from_degree } => write!(f, "PurePowers {{ from_degree: {from_degree} }}"),
            Self::AtMost { signal, factors } => write!(f, "AtMost {{ {signal:?}, {factors} }}"),
            Self::Exclude(terms) => f.debug_tuple("Exclude").field(terms).finish(),
            Self::Keep(_) => f.write_str("Keep(..)"),
        }
    }
}

impl Rule {
    fn admits(&self, term: &Term) -> bool {
        let f = term.factors();
        match self {
            Self::EqualLags { from_degree } => f.len() < *from_degree || f.iter().all(|x| x.lag == f[0].lag),
            Self::PurePowers { from_degree } => f.len() < *from_degree || f.iter().all(|x| *x == f[0]),
            Self::AtMost { signal, factors } => f.iter().filter(|x| x.quantity.signal() == *signal).count() <= *factors,
            Self::Exclude(terms) => !terms.contains(term),
            Self::Keep(predicate) => predicate(term),
        }
    }
}

/// What the dictionary consists of. The fields are public; the constructors give the usual cases.
#[derive(Debug, Clone)]
pub struct Spec {
    /// The signals.
    pub signals: Signals,
    /// The single factors from which products are formed.
    pub factors: Vec<Factor>,
    /// The largest number of factors in a product, 1 to 9.
    pub degree: usize,
    /// Whether the constant is a candidate.
    pub constant: Constant,
    /// Rules; a candidate must pass all of them.
    pub rules: Vec<Rule>,
    /// Terms that are candidates whatever the rules say.
    pub include: Vec<Term>,
}

impl Spec {
    /// No factors yet: the constant only, degree 1.
    pub fn new(signals: Signals) -> Self {
        let (factors, rules, include) = (Vec::new(), Vec::new(), Vec::new());
        Self { signals, factors, degree: 1, constant: Constant::Candidate, rules, include }
    }

    /// Polynomial NARX: output lags 1 to `ny` and the lags `nu` of every input, products up to `degree`.
    ///
    /// `nu` may begin at 0 (`u[n]` allowed) or 1. With `ny = 0` it is a Volterra model, with `degree = 1` ARX, without
    /// inputs in `signals` NAR.
    pub fn narx(signals: Signals, ny: usize, nu: RangeInclusive<usize>, degree: usize) -> Self {
        let inputs = signals.inputs().len();
        let mut spec = Self::new(signals).lags(Signal::Output, 1..=ny);
        for i in 0..inputs {
            spec = spec.lags(Signal::Input(i), nu.clone());
        }
        spec.degree(degree)
    }

    /// The same with these lags of a signal added.
    #[must_use]
    pub fn lags(mut self, signal: Signal, lags: impl IntoIterator<Item = usize>) -> Self {
        // One lag beyond the limit is enough to be refused.
        self.factors.extend(lags.into_iter().take(LARGEST_LAG + 2).map(|l| Factor::value(signal, l)));
        self
    }

    /// The same with the hysteresis factors of a signal added at these lags: its difference and the sign of it.
    #[must_use]
    pub fn hysteresis(mut self, signal: Signal, lags: impl IntoIterator<Item = usize>) -> Self {
        for lag in lags.into_iter().take(LARGEST_LAG + 2) {
            self.factors.extend([Factor::difference(signal, lag), Factor::sign(signal, lag)]);
        }
        self
    }

    /// The same with the sign of a signal's difference added at these lags.
    #[must_use]
    pub fn signs(mut self, signal: Signal, lags: impl IntoIterator<Item = usize>) -> Self {
        self.factors.extend(lags.into_iter().take(LARGEST_LAG + 2).map(|l| Factor::sign(signal, l)));
        self
    }

    /// The same with this degree.
    #[must_use]
    pub fn degree(mut self, degree: usize) -> Self {
        self.degree = degree;
        self
    }

    /// The same with or without the constant.
    #[must_use]
    pub fn constant(mut self, constant: Constant) -> Self {
        self.constant = constant;
        self
    }

    /// The same with a further rule.
    #[must_use]
    pub fn rule(mut self, rule: Rule) -> Self {
        self.rules.push(rule);
        self
    }

    /// The dictionary: every product of the factors that passes the rules, in order of degree, without those that are
    /// exactly collinear with others.
    ///
    /// # Errors
    /// Lag 0 of the output, an input that there is not, a lag or degree or number of candidates beyond the limits, or
    /// no candidate at all.
    pub fn build(&self) -> Result<Dictionary, DictionaryError> {
        self.check()?;
        let factors: Vec<Factor> = self.factors.iter().copied().collect::<BTreeSet<_>>().into_iter().collect();
        let mut terms = BTreeSet::new();
        let mut dropped = Vec::new();
        if self.constant == Constant::Candidate {
            terms.insert(Term::constant());
        }
        let mut written = BTreeMap::new();
        let mut picks: Vec<usize> = Vec::new();
        for degree in 1..=self.degree {
            picks.clear();
            picks.resize(degree, 0);
            while !factors.is_empty() {
                let raw: Vec<Factor> = picks.iter().map(|&i| factors[i]).collect();
                let term = Term::new(raw.iter().copied());
                let reduced = term.degree() < degree;
                let counts = !(term.degree() == 0 && self.constant == Constant::Omitted);
                if reduced {
                    written.entry(text_of(&self.signals, &raw)).or_insert(term);
                } else if counts && self.rules.iter().all(|r| r.admits(&term)) {
                    terms.insert(term);
                }
                if terms.len() > LARGEST_DICTIONARY || written.len() > LARGEST_DICTIONARY {
                    return Err(DictionaryError::TooLarge { limit: LARGEST_DICTIONARY });
                }
                if !advance(&mut picks, factors.len()) {
                    break;
                }
            }
        }
        terms.extend(self.include.iter().cloned());
        for (text, same_as) in written {
            dropped
                .push(Dropped { text, reason: DroppedReason::SignSquared { same_as: self.signals.format(&same_as) } });
        }
        let Span { kept, collinear } = drop_collinear(terms.into_iter().collect());
        for (term, within) in collinear {
            let within = within.iter().map(|t| self.signals.format(t)).collect();
            dropped.push(Dropped { text: self.signals.format(&term), reason: DroppedReason::Collinear { within } });
        }
        if kept.is_empty() {
            return Err(DictionaryError::Empty);
        }
        Ok(Dictionary::from_parts(self.signals.clone(), kept, dropped))
    }

    fn check(&self) -> Result<(), DictionaryError> {
        if !(1..=9).contains(&self.degree) {
            return Err(DictionaryError::BadDegree(self.degree));
        }
        let inputs = self.signals.inputs().len();
        for f in self.factors.iter().chain(self.include.iter().flat_map(|t| t.factors())) {
            match f.quantity.signal() {
                Signal::Output if f.lag == 0 => return Err(DictionaryError::OutputLagZero),
                Signal::Input(i) if i >= inputs => {
                    return Err(DictionaryError::InputCount { expected: inputs, found: i + 1 });
                }
                _ => {}
            }
            if f.lag > LARGEST_LAG {
                return Err(DictionaryError::LagTooLarge { lag: f.lag, largest: LARGEST_LAG });
            }
        }
        Ok(())
    }
}

/// The product as it was written, before signs were reduced.
fn text_of(signals: &Signals, factors: &[Factor]) -> String {
    factors.iter().map(|&f| signals.format_factor(f)).collect::<Vec<_>>().join("*")
}

/// The next non-decreasing tuple of indices below `n`; false after the last.
fn advance(picks: &mut [usize], n: usize) -> bool {
    for i in (0..picks.len()).rev() {
        if picks[i] + 1 < n {
            let next = picks[i] + 1;
            picks[i..].fill(next);
            return true;
        }
    }
    false
}
