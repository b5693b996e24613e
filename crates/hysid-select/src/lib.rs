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

use hysid_linalg::Columns;

/// The columns of `phi` that explain `y`, found as `options` say.
///
/// # Errors
/// A target of another length than `phi` has rows, or all zero, or not finite; options out of range.
pub fn select<C: Columns + ?Sized>(phi: &C, y: &[f64], options: &Options) -> Result<Selection, SelectError> {
    options.check(phi.rows(), phi.cols(), y)?;
    let mut moments = moments::Moments::new(phi, y)?;
    let table = match options.search {
        Search::MatchingPursuit => {
            // A pursuit does not solve for its coefficients, so it may take more terms than there are samples.
            let longest = options::longest(options, usize::MAX, phi.cols());
            search::Table::of_pursuit(pursuit::pursue(&mut moments, &options.forced, longest), longest)
        }
        _ => search::search(phi, y, &mut moments, options),
    };
    Ok(finish::finish(phi, y, options, &mut moments, table))
}
