//! A term: a product of factors, each a lagged signal, difference or sign of a difference.

/// Which signal.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Signal {
    /// The output `y`.
    Output,
    /// The input of this number, from 0.
    Input(usize),
}

/// What of a signal.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Quantity {
    /// The signal itself.
    Value(Signal),
    /// The signal minus itself one sample earlier.
    Difference(Signal),
    /// The sign of that difference, +1 or -1, held where the difference is within the signal's threshold.
    Sign(Signal),
}

impl Quantity {
    /// The signal it is made of.
    pub fn signal(self) -> Signal {
        match self {
            Self::Value(s) | Self::Difference(s) | Self::Sign(s) => s,
        }
    }

    /// Whether its square is 1.
    pub fn is_sign(self) -> bool {
        matches!(self, Self::Sign(_))
    }
}

/// A quantity some samples ago.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Factor {
    /// The quantity.
    pub quantity: Quantity,
    /// How many samples ago; 0 is the sample that is being explained.
    pub lag: usize,
}

impl Factor {
    /// `signal[n-lag]`.
    pub fn value(signal: Signal, lag: usize) -> Self {
        Self { quantity: Quantity::Value(signal), lag }
    }

    /// `signal[n-lag] - signal[n-lag-1]`.
    pub fn difference(signal: Signal, lag: usize) -> Self {
        Self { quantity: Quantity::Difference(signal), lag }
    }

    /// The sign of `signal[n-lag] - signal[n-lag-1]`.
    pub fn sign(signal: Signal, lag: usize) -> Self {
        Self { quantity: Quantity::Sign(signal), lag }
    }

    /// The number of samples it reaches back.
    pub fn reach(self) -> usize {
        self.lag + usize::from(!matches!(self.quantity, Quantity::Value(_)))
    }
}

impl Ord for Factor {
    /// By signal, then value before difference before sign, then by lag.
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        let key = |f: &Self| {
            let kind = match f.quantity {
                Quantity::Value(_) => 0,
                Quantity::Difference(_) => 1,
                Quantity::Sign(_) => 2,
            };
            (f.quantity.signal(), kind, f.lag)
        };
        key(self).cmp(&key(other))
    }
}

impl PartialOrd for Factor {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

/// A product of factors in canonical order; without factors it is the constant 1.
///
/// Terms are ordered by degree, then by their factors.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Default)]
pub struct Term {
    factors: Vec<Factor>,
}

impl Term {
    /// The product of these factors, in any order; signs are reduced, since the square of a sign is 1.
    pub fn new(factors: impl IntoIterator<Item = Factor>) -> Self {
        let mut sorted: Vec<Factor> = factors.into_iter().collect();
        sorted.sort();
        let mut reduced: Vec<Factor> = Vec::with_capacity(sorted.len());
        for f in sorted {
            if f.quantity.is_sign() && reduced.last() == Some(&f) {
                reduced.pop();
            } else {
                reduced.push(f);
            }
        }
        Self { factors: reduced }
    }

    /// The constant 1.
    pub fn constant() -> Self {
        Self::default()
    }

    /// The factors in canonical order, a power as repetition.
    pub fn factors(&self) -> &[Factor] {
        &self.factors
    }

    /// Number of factors.
    pub fn degree(&self) -> usize {
        self.factors.len()
    }

    /// The number of samples it reaches back.
    pub fn reach(&self) -> usize {
        self.factors.iter().map(|f| f.reach()).max().unwrap_or(0)
    }

    /// Whether a factor is made of the output.
    pub fn uses_output(&self) -> bool {
        self.factors.iter().any(|f| f.quantity.signal() == Signal::Output)
    }

    /// The product of the factors' values, taken from the left: the one evaluator of a term.
    ///
    /// `value(factor)` is a sample or, lane by lane, a stretch of samples.
    pub fn evaluate(&self, mut value: impl FnMut(Factor) -> f64) -> f64 {
        let mut factors = self.factors.iter();
        let Some(&first) = factors.next() else { return 1.0 };
        factors.fold(value(first), |product, &f| product * value(f))
    }
}

impl Ord for Term {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.degree().cmp(&other.degree()).then_with(|| self.factors.cmp(&other.factors))
    }
}

impl PartialOrd for Term {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}
