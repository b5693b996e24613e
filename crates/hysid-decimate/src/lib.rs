//! The paper's sampling-rate reduction: decimators, MRD, MRE, the admissible factors, a recommendation.
//!
//! An oversampled recording ruins term selection: neighbouring samples are alike, so every term that repeats the last output seems to explain
//! everything, and the least-squares problem is ill conditioned. Zhang, Zhu and Gu (2017) keep every L-th sample and bound L from both sides:
//! neighbours must differ (MRD above 1 - alpha) and straight lines between the samples kept must still follow the recording (MRE below 1 - alpha).
//!
//! * [`Decimator`] keeps every L-th sample, plainly or after a zero-phase low-pass; [`reduce`] does so for a recording with gaps.
//! * [`mean_relative_difference`] and [`interpolation_error`] are the two measures, each as printed and in a form that survives y = 0.
//! * [`examine`] makes the table of factors, and [`recommend`] says which one to take and why.
//!
//! (In other papers SRR stands for the simulation error reduction ratio. That is not meant here.)

mod chebyshev;
mod decimator;
mod kaiser;
mod measures;
mod recommend;
mod reduce;
mod zero_phase;

pub use decimator::{DecimateError, Decimator, Phase};
pub use measures::{Ratio, aliased_share, interpolation_error, mean_relative_difference};
pub use recommend::{FactorRow, Recommendation, examine, recommend};
pub use reduce::{Reduced, reduce};
