//! What a calibration is asked, and what it answers.

use hysid_signal::Autoregression;

/// How far a calibration searches.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Effort {
    /// From several starts, with the homotopy.
    Global,
    /// From the given start only, in free run.
    Local,
}

/// Settings of a calibration; the default suits most records.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// How far to search.
    pub effort: Effort,
    /// Where the seeded design starts.
    pub seed: u64,
    /// Steps in each sampling period; none lets the step-halving check decide.
    pub substeps: Option<usize>,
    /// Relative change by which the step-halving check judges.
    pub step_tolerance: f64,
    /// Parameters to estimate by number; none means all that are not fixed.
    pub estimated: Option<Vec<usize>>,
    /// Parameters to start from; none means the document's.
    pub theta: Option<Vec<f64>>,
    /// Free initial states to start from, for each stretch; none lets the measurement decide.
    pub initial: Option<Vec<Vec<f64>>>,
    /// Highest order of the noise model; 0 is white noise.
    pub noise_order: usize,
    /// Rounds of generalised least squares; 0 leaves the plain sum of squares.
    pub gls_rounds: usize,
    /// Most evaluations in each local search.
    pub iterations: usize,
    /// Least relative decrease of the cost that counts.
    pub tolerance: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            effort: Effort::Global,
            seed: 1,
            substeps: None,
            step_tolerance: 1e-4,
            estimated: None,
            theta: None,
            initial: None,
            noise_order: 16,
            gls_rounds: 2,
            iterations: 60,
            tolerance: 1e-7,
        }
    }
}

impl Settings {
    /// A local search from these parameters.
    pub fn local(theta: Vec<f64>) -> Self {
        Self { effort: Effort::Local, theta: Some(theta), ..Self::default() }
    }
}

/// What is suspicious about an estimate: it may have absorbed physics that the simulation lacks.
#[derive(Debug, Clone, PartialEq)]
pub enum Flag {
    /// A parameter ended at its lower or upper bound.
    AtBound {
        /// Its number.
        parameter: usize,
        /// The bound.
        bound: f64,
    },
    /// A parameter moved by more than half of the user's value and more than 3 standard deviations.
    FarFromUser {
        /// Its number.
        parameter: usize,
        /// The user's value.
        user: f64,
    },
    /// The data say almost nothing about a parameter: its standard deviation exceeds its value and the user's.
    Undetermined {
        /// Its number.
        parameter: usize,
    },
}

/// A calibrated simulation.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// All parameters, in the document's order.
    pub theta: Vec<f64>,
    /// Numbers of the estimated parameters.
    pub estimated: Vec<usize>,
    /// Free initial states of each stretch, in the order of [`Data::free`].
    pub initial: Vec<Vec<f64>>,
    /// Covariance of the estimated parameters, by columns.
    pub covariance: Vec<f64>,
    /// Simulated outputs, `[stretch][output][sample]`.
    pub simulated: Vec<Vec<Vec<f64>>>,
    /// Measured minus simulated, `[stretch][output][sample]`; `NaN` where nothing was measured.
    pub residuals: Vec<Vec<Vec<f64>>>,
    /// Noise model of each output's residual.
    pub noise: Vec<Autoregression>,
    /// Free-run rms error of each output, over all stretches.
    pub rmse: Vec<f64>,
    /// What is suspicious.
    pub flags: Vec<Flag>,
    /// Steps in each sampling period, and the change on twice as many.
    pub steps: crate::engine::StepCheck,
    /// Simulations run (up to 8 derivatives come with each).
    pub simulations: usize,
    /// Whether the last search ended at a minimum (and not at its limit of evaluations).
    pub converged: bool,
}

impl Calibration {
    /// Standard deviation of each estimated parameter, in the order of `estimated`.
    pub fn standard_deviations(&self) -> Vec<f64> {
        let n = self.estimated.len();
        (0..n).map(|i| self.covariance.get(i * n + i).copied().unwrap_or(f64::NAN).max(0.0).sqrt()).collect()
    }

    /// The 95 % interval of a parameter by number; none where it is not estimated.
    pub fn interval(&self, parameter: usize) -> Option<(f64, f64)> {
        let i = self.estimated.iter().position(|e| *e == parameter)?;
        let value = self.theta.get(parameter)?;
        let half = 1.96 * self.standard_deviations().get(i)?;
        Some((value - half, value + half))
    }
}

/// Why a calibration has no result.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrationError {
    /// There is nothing to calibrate on.
    #[error("there is no data to calibrate on")]
    NoData,
    /// More unknowns than samples.
    #[error("{samples} measured samples cannot settle {unknowns} parameters and initial states")]
    TooFewSamples {
        /// Measured samples over all outputs and stretches.
        samples: usize,
        /// Estimated parameters and free initial states.
        unknowns: usize,
    },
    /// An output that does not move.
    #[error("output `{0}` is constant in the data: nothing can be learnt from it")]
    ConstantOutput(String),
    /// The simulation is not finite for any start.
    #[error("the simulation is not finite within the first {samples} samples from any start; {what}")]
    Diverged {
        /// Samples that were tried.
        samples: usize,
        /// What the user can look at.
        what: String,
    },
}
