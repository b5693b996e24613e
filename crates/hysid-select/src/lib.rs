//! Term selection on any matrix and target: orthogonal forward regression, error reduction ratio, PRESS, criteria and stop reasons. Knows no signals.
//!
//! [`select`] picks columns of a matrix Phi (anything that is [`hysid_linalg::Columns`]: a stored matrix, or a dictionary
//! that makes its columns on the fly) that explain a target y, and says how it got there:
//!
//! - [`Options::search`]: how subsets are looked for ([`Search`]);
//! - [`Options::criterion`]: what decides their size ([`Criterion`]), leave-one-out PRESS with the price of the search unless told
//!   otherwise;
//! - [`Selection`]: the columns in order, coefficients, each [`Step`] with its error reduction ratio, the criterion
//!   against the number of terms ([`Selection::curve`]), why it stopped, what was rejected, and whether the arithmetic
//!   was good enough ([`Precision`]).
//!
//! ```
//! use hysid_linalg::Matrix;
//! use hysid_select::{Options, select};
//!
//! let t: Vec<f64> = (0..50).map(|i| i as f64 / 10.0).collect();
//! let columns = [vec![1.0; 50], t.clone(), t.iter().map(|t| t.sin()).collect(), t.iter().map(|t| t.cos()).collect()];
//! let y: Vec<f64> = t.iter().map(|t| 2.0 + 3.0 * t.sin()).collect();
//! let phi = Matrix::from_columns(&columns).unwrap();
//! let selection = select(&phi, &y, &Options::default()).unwrap();
//! let mut terms = selection.terms.clone();
//! terms.sort();
//! assert_eq!(terms, [0, 2]);
//! ```
//!
//! [`select_gram`] does the same from a Gram matrix, when the samples are gone.
//!
//! # Conventions
//!
//! Energies are relative to y'y. A column counts with unit length, so that scaling the columns changes nothing. All sums
//! over samples run in a fixed order: the result does not depend on the number of threads.
//!
//! # References
//!
//! Chen, Billings, Luo (1989), "Orthogonal least squares methods and their application to non-linear system
//! identification"; Hong, Sharkey, Warwick (2003), "Automatic nonlinear predictive model-construction algorithm using
//! forward regression and the PRESS statistic"; Zhang, Zhu, Gu (2017), whose equations are cited by their numbers.

mod criterion;
mod evidence;
mod finish;
mod forward;
mod moments;
mod options;
mod pursuit;
mod refit;
mod rescore;
mod result;
mod search;

pub use options::{Criterion, Options, PressForm, Search, SelectError};
pub use result::{CurvePoint, Precision, Rejected, RejectedReason, Selection, Step, StopReason};

use evidence::{Evidence, Samples};
use hysid_linalg::{Columns, Gram};

/// The columns of `phi` that explain `y`, found as `options` say.
///
/// # Errors
/// A target of another length than `phi` has rows, or all zero, or not finite; options out of range.
pub fn select<C: Columns + ?Sized>(phi: &C, y: &[f64], options: &Options) -> Result<Selection, SelectError> {
    options.check(phi.rows(), phi.cols(), y)?;
    find(&Samples::new(phi, y, options::columns_wanted(options, phi.rows(), phi.cols())), options)
}

/// The columns that explain the target, found from inner products alone: for data that do not fit into memory.
///
/// It is the search of [`select`]; what [`select`] takes from the samples is taken from the Gram matrix here, with these consequences:
///
/// - Coefficients lose twice the digits that the condition of the chosen columns costs ([`Step::condition`]).
/// - Near-ties are not decided from the samples: the better by inner products is taken, and [`Precision::doubtful_from`] says so.
///   [`Precision::err_deviation`] is a bound for what rounding may have done to an error reduction ratio.
/// - In place of the exact PRESS stands SSE / (1 - n/N)^2, from which it differs by a part of the order of n/N.
/// - Residuals below 1e-14 of y'y are rounding, and are reported as that.
///
/// # Errors
/// A matrix, products and target that do not fit each other; a target that is zero; values that are not finite; options out of range;
/// [`Criterion::Blocks`], which needs the samples.
pub fn select_gram(gram: &Gram, options: &Options) -> Result<Selection, SelectError> {
    options.check_gram(gram)?;
    find(gram, options)
}

fn find<E: Evidence>(evidence: &E, options: &Options) -> Result<Selection, SelectError> {
    let mut moments = moments::Moments::new(evidence)?;
    let table = match options.search {
        Search::MatchingPursuit => {
            // A pursuit does not solve for its coefficients, so it may take more terms than there are samples.
            let longest = options::longest(options, usize::MAX, evidence.candidates());
            search::Table::of_pursuit(pursuit::pursue(&mut moments, &options.forced, longest), longest)
        }
        _ => search::search(&mut moments, options),
    };
    Ok(finish::finish(options, &mut moments, table))
}
