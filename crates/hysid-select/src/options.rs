//! How to search, what decides the size, and the limits.

use std::ops::Range;

use hysid_linalg::{Gram, dot};

/// How subsets of columns are looked for.
#[derive(Debug, Clone, PartialEq)]
pub enum Search {
    /// Equations (8) to (10) of Zhang, Zhu, Gu (2017) as printed: the column with the largest squared inner product with
    /// the residual per squared norm, raw columns throughout, no orthogonalisation and no refit inside the loop
    /// (plain matching pursuit).
    MatchingPursuit,
    /// Classical orthogonal forward regression: every candidate is orthogonalised against the columns chosen so far, and
    /// the one with the largest error reduction ratio is taken.
    Greedy,
    /// Greedy, and again from each of the `starts` best single columns as the first (iterative OFR); for each number of
    /// terms the best of these paths counts.
    Iterative {
        /// How many first columns are tried.
        starts: usize,
    },
    /// The `width` best subsets of each size are kept and grown; then the moves of [`Search::Floating`].
    Beam {
        /// How many subsets are kept.
        width: usize,
    },
    /// The default. A greedy path that goes [`Options::patience`] terms beyond the criterion's minimum; then, for every
    /// number of terms at once, moves of one term: exchange one, take the best further one, give back the one that is missed
    /// least, until the best subset of no size can be bettered by a move. A term that the greedy path took too early
    /// is given back that way, and where the path contains all terms of an exact model, exactly these remain.
    Floating,
}

/// The form of the leave-one-out criterion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PressForm {
    /// Equation (15): the sum of squared leave-one-out errors e_t / (1 - h_tt).
    Exact,
    /// Equation (18) as printed: SSE / (1 - n/N).
    AsPrinted,
    /// Equation (18) with the square that it lacks: SSE / (1 - n/N)^2.
    Squared,
}

/// What decides the number of terms.
#[derive(Debug, Clone, PartialEq)]
pub enum Criterion {
    /// So many terms.
    Terms(usize),
    /// Equation (11): as many terms as leave at most this part of y'y unexplained (1 - sum of ERR).
    ErrTolerance(f64),
    /// The smallest leave-one-out error.
    Press(PressForm),
    /// The smallest leave-one-out error with the price of the search: PRESS + 2 n (ln M - 1) SSE / (N - n) for n terms out of M
    /// candidates. The default.
    ///
    /// PRESS asks of a term that it pays for one coefficient, about 2 sigma^2. The best of M columns that have nothing to do
    /// with the target takes out about 2 ln(M) sigma^2 all the same, so that PRESS lets chance in where there are many
    /// candidates. This is the risk inflation criterion (Foster and George, *Ann. Statist.* 22 (1994) 1947) on PRESS.
    /// Without noise it is PRESS.
    SearchedPress,
    /// The smallest sum of squared errors on blocks of rows that the coefficients were not fitted to, each block left
    /// out once. For time series, whose neighbouring samples are no independent witnesses; blocks may be whole recordings.
    /// Rows in no block always take part in the fit.
    Blocks(Vec<Range<usize>>),
    /// The smallest Akaike criterion, N ln(SSE/N) + 2 n.
    Aic,
    /// The smallest Bayes criterion, N ln(SSE/N) + n ln N.
    Bic,
}

/// How to select.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// How subsets are looked for.
    pub search: Search,
    /// What decides the number of terms.
    pub criterion: Criterion,
    /// The largest number of terms that is tried.
    pub max_terms: usize,
    /// Columns that are taken first, in this order.
    pub forced: Vec<usize>,
    /// A candidate of which less than this part of its energy is left beside the chosen columns is passed over and
    /// reported.
    pub pivot_guard: f64,
    /// How many terms a path goes on beyond the criterion's minimum before it is believed.
    pub patience: usize,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            search: Search::Floating,
            criterion: Criterion::SearchedPress,
            max_terms: 30,
            forced: Vec::new(),
            pivot_guard: 1e-11,
            patience: 8,
        }
    }
}

/// Bad input to a selection.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SelectError {
    /// The target has another length than the matrix has rows.
    #[error("the matrix has {rows} rows, the target {found}")]
    Shape {
        /// Rows of the matrix.
        rows: usize,
        /// Length of the target.
        found: usize,
    },
    /// There is nothing to choose from, or no sample.
    #[error("a matrix of {rows} rows and {cols} columns leaves nothing to select")]
    Empty {
        /// Rows of the matrix.
        rows: usize,
        /// Columns of the matrix.
        cols: usize,
    },
    /// The target is zero throughout.
    #[error("the target is zero throughout: there is nothing to explain")]
    ZeroTarget,
    /// The target or a column holds a value that is not finite.
    #[error("{0} holds a value that is not finite (or too large to be squared)")]
    NotFinite(String),
    /// An option is out of range.
    #[error("option {option} is {given}; allowed: {allowed}")]
    Option {
        /// The option.
        option: &'static str,
        /// What was given.
        given: String,
        /// What is allowed.
        allowed: String,
    },
}

impl Criterion {
    /// Whether it has a minimum to stop at.
    pub(crate) fn has_minimum(&self) -> bool {
        !matches!(self, Self::Terms(_) | Self::ErrTolerance(_))
    }
}

/// How many terms a search must look at.
pub(crate) fn longest(options: &Options, rows: usize, cols: usize) -> usize {
    options.max_terms_allowed().max(options.forced.len()).min(cols).min(rows.saturating_sub(1).max(1))
}

/// Terms that a search takes which ends at the minimum of its criterion or at a tolerance, where more are allowed; a guess.
const TAKEN: usize = 20;

/// About how many columns of the Gram matrix a search asks for, by what it took on the systems that are measured: a third more than terms,
/// for columns made on a guess, and as many again for exchanges.
pub(crate) fn columns_wanted(options: &Options, rows: usize, cols: usize) -> usize {
    let most = longest(options, rows, cols);
    let terms = match options.criterion {
        Criterion::Terms(_) => most,
        _ => most.min(TAKEN.max(options.forced.len())),
    };
    let wanted = match options.search {
        Search::Greedy | Search::MatchingPursuit => terms + terms / 3,
        Search::Iterative { .. } => terms + terms / 2,
        Search::Floating | Search::Beam { .. } => 2 * terms,
    };
    wanted.min(cols)
}

impl Options {
    /// The largest number of terms that may be chosen.
    pub(crate) fn max_terms_allowed(&self) -> usize {
        match self.criterion {
            Criterion::Terms(n) => n,
            _ => self.max_terms,
        }
    }

    pub(crate) fn check(&self, rows: usize, cols: usize, y: &[f64]) -> Result<(), SelectError> {
        if y.len() != rows {
            return Err(SelectError::Shape { rows, found: y.len() });
        }
        if rows == 0 || cols == 0 {
            return Err(SelectError::Empty { rows, cols });
        }
        // One look at the sum of squares, and at each only where that is not finite.
        if !dot(y, y).is_finite() && y.iter().any(|v| !(v * v).is_finite()) {
            return Err(SelectError::NotFinite("the target".into()));
        }
        if y.iter().all(|v| *v == 0.0) {
            return Err(SelectError::ZeroTarget);
        }
        self.check_options(rows, cols)
    }

    /// The same for a selection from inner products.
    pub(crate) fn check_gram(&self, gram: &Gram) -> Result<(), SelectError> {
        let (rows, cols) = (gram.rows, gram.matrix.cols());
        for found in [gram.cross.len(), gram.matrix.rows()] {
            if found != cols {
                return Err(SelectError::Shape { rows: cols, found });
            }
        }
        if rows == 0 || cols == 0 {
            return Err(SelectError::Empty { rows, cols });
        }
        if !gram.target.is_finite() || gram.target < 0.0 {
            return Err(SelectError::NotFinite("the target".into()));
        }
        if gram.target == 0.0 {
            return Err(SelectError::ZeroTarget);
        }
        self.check_without_samples(cols)
    }

    /// Whether these options serve for a selection from the inner products of `cols` columns; to be asked before long data are read.
    ///
    /// # Errors
    /// An option out of range; [`Criterion::Blocks`], which needs the samples.
    pub fn check_without_samples(&self, cols: usize) -> Result<(), SelectError> {
        if let Criterion::Blocks(_) = self.criterion {
            let (given, allowed) = ("left-out blocks".into(), "a criterion that needs no samples".into());
            return Err(SelectError::Option { option: "criterion", given, allowed });
        }
        self.check_options(usize::MAX, cols)
    }

    fn check_options(&self, rows: usize, cols: usize) -> Result<(), SelectError> {
        let option =
            |option, given: String, allowed: &str| Err(SelectError::Option { option, given, allowed: allowed.into() });
        if self.max_terms == 0 {
            return option("max_terms", "0".into(), "1 or more");
        }
        if !(self.pivot_guard >= 0.0 && self.pivot_guard < 1.0) {
            return option("pivot_guard", self.pivot_guard.to_string(), "0 up to 1");
        }
        match self.search {
            Search::Iterative { starts: 0 } => return option("search", "0 starts".into(), "1 or more"),
            Search::Beam { width: 0 } => return option("search", "a beam of width 0".into(), "1 or more"),
            _ => {}
        }
        for (i, j) in self.forced.iter().enumerate() {
            if *j >= cols || self.forced[..i].contains(j) {
                return option("forced", format!("{:?}", self.forced), &format!("different columns below {cols}"));
            }
        }
        match &self.criterion {
            Criterion::Terms(0) => option("criterion", "0 terms".into(), "1 term or more"),
            Criterion::ErrTolerance(rho) if !(*rho > 0.0 && *rho < 1.0) => {
                option("criterion", format!("ERR tolerance {rho}"), "above 0 and below 1")
            }
            Criterion::Blocks(blocks) => {
                let mut sorted: Vec<&Range<usize>> = blocks.iter().filter(|b| !b.is_empty()).collect();
                sorted.sort_by_key(|b| b.start);
                let overlap = sorted.windows(2).any(|w| w[0].end > w[1].start);
                if sorted.len() < 2 || overlap || sorted.last().is_some_and(|b| b.end > rows) {
                    return option(
                        "criterion",
                        format!("blocks {blocks:?}"),
                        &format!("two or more blocks of rows below {rows} that do not overlap"),
                    );
                }
                Ok(())
            }
            _ => Ok(()),
        }
    }
}
