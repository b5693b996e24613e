//! What a selection returns.

/// A chosen column.
#[derive(Debug, Clone, PartialEq)]
pub struct Step {
    /// Its number.
    pub column: usize,
    /// Its error reduction ratio: the part of y'y that it explains beyond the columns before it.
    pub err: f64,
    /// The criterion with the columns up to this one; infinite where it is not defined.
    pub criterion: f64,
    /// Sum of squared residuals with the columns up to this one, relative to y'y.
    pub sse: f64,
    /// Exact leave-one-out sum of squares with the columns up to this one, relative to y'y.
    pub press: f64,
    /// Condition of the columns up to this one, scaled to unit length: the ratio of the extreme diagonal entries of R,
    /// a lower bound of the condition number.
    pub condition: f64,
}

/// The best subset found for one number of terms.
#[derive(Debug, Clone, PartialEq)]
pub struct CurvePoint {
    /// The subset.
    pub columns: Vec<usize>,
    /// The criterion.
    pub criterion: f64,
    /// Sum of squared residuals relative to y'y.
    pub sse: f64,
    /// Exact leave-one-out sum of squares relative to y'y.
    pub press: f64,
    /// What the search itself left unexplained, relative to y'y: for matching pursuit the residual of the pursuit, which is
    /// larger than the least-squares residual `sse`; otherwise the same but for rounding.
    pub search_sse: f64,
}

/// Why there are not more terms.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StopReason {
    /// The criterion has its minimum there, and more terms were tried.
    CriterionMinimum,
    /// The number of terms or the ERR tolerance that was asked for is reached.
    GoalReached,
    /// The criterion was still falling at the largest number of terms allowed.
    MaxTerms,
    /// What is left of the target is rounding.
    ResidualExhausted,
    /// No further candidate is independent of those chosen.
    NoCandidateLeft,
}

/// Why a candidate was passed over.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RejectedReason {
    /// The column is zero throughout.
    Zero,
    /// Of the column's energy only this part is left beside the chosen columns: it is (nearly) a combination of them.
    NearSingular(f64),
}

/// A candidate that was passed over.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rejected {
    /// Its number.
    pub column: usize,
    /// Number of columns chosen when it was passed over first.
    pub at_step: usize,
    /// Why.
    pub reason: RejectedReason,
}

/// Whether the arithmetic of the search was good enough.
///
/// The search works on inner products (whose errors grow with the square of the condition); the chosen columns are then
/// factored again from the samples by Householder QR. The two must agree.
#[derive(Debug, Clone, PartialEq)]
pub struct Precision {
    /// Largest difference between the error reduction ratios of the search and of the QR, relative to the larger of the
    /// two.
    pub err_deviation: f64,
    /// Smallest part of a chosen column's energy that was left beside those before it.
    pub smallest_pivot: f64,
    /// The first step, if any, at which rounding could have changed the choice: the order may differ from exact
    /// arithmetic from there on.
    pub doubtful_from: Option<usize>,
}

/// The outcome of a selection.
#[derive(Debug, Clone, PartialEq)]
pub struct Selection {
    /// The chosen columns, in order.
    pub terms: Vec<usize>,
    /// Their least-squares coefficients.
    pub theta: Vec<f64>,
    /// Diagonal of (A'A)^-1 of the chosen columns: times the residual variance, the variances of the coefficients.
    pub unscaled_variance: Vec<f64>,
    /// One entry for each chosen column.
    pub steps: Vec<Step>,
    /// The best subset for each number of terms tried, from one term on, beyond the chosen number too.
    pub curve: Vec<CurvePoint>,
    /// Why there are not more terms.
    pub stop: StopReason,
    /// Candidates that were passed over.
    pub rejected: Vec<Rejected>,
    /// Whether the arithmetic was good enough.
    pub precision: Precision,
    /// y'y, the energy that everything else is relative to.
    pub target_energy: f64,
    /// Number of samples.
    pub samples: usize,
}

impl Selection {
    /// Sum of squared residuals relative to y'y.
    pub fn sse(&self) -> f64 {
        self.steps.last().map_or(1.0, |s| s.sse)
    }

    /// Standard errors of the coefficients, for independent residuals of equal variance.
    pub fn standard_errors(&self) -> Vec<f64> {
        let free = self.samples.saturating_sub(self.terms.len()).max(1) as f64;
        let variance = self.sse() * self.target_energy / free;
        self.unscaled_variance.iter().map(|v| (v * variance).sqrt()).collect()
    }
}
