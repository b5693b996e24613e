//! Regressors: lags, factors, terms as text, the dictionary of candidates and their one evaluator.
//!
//! The way through the crate:
//!
//! 1. [`Signals`] names the output and the inputs (symbol in equations, column in a file) and gives the threshold below
//!    which a difference counts as noise and not as a change of sign.
//! 2. [`Spec`] says which candidates there are: lags for each signal (`u[n]` has lag 0), degree, constant, differences
//!    and their signs, rules. [`Spec::build`] gives the [`Dictionary`]: its [`Term`]s and what was dropped as exactly
//!    collinear ([`Dropped`]).
//! 3. [`Design`] joins a dictionary and recordings ([`Record`]): one row for each sample that has all its lags inside
//!    one gap-free stretch. It is a [`hysid_linalg::Columns`], so `hysid-select` can pick from it, and it never stores
//!    the dictionary. [`Design::target`] is the target.
//!    Where the recordings do not fit into memory, [`GramSums`] adds up the Gram matrix of the dictionary from blocks of
//!    samples.
//! 4. [`Model`] is a list of terms with coefficients: one step ahead and free run.
//!
//! # Terms as text
//!
//! ```text
//! term    = "1" | factor { "*" factor }
//! factor  = atom [ "^" power ]
//! atom    = name "[" time "]"              a signal: y[n-1], u[n], u2[n-3]
//!         | "d" name "[" time "]"          its difference: du[n-1] = u[n-1] - u[n-2]
//!         | "sgn(d" name "[" time "])"     the sign of its difference: +1 or -1
//! name    = symbol | column | "`" column "`"
//! time    = "n" | "n-" lag                 (k or t may stand for n)
//! ```
//!
//! Factors are written output first, then the inputs in their order, then by lag; powers as `^`. Whitespace between
//! tokens is free. A column with other characters than letters, digits and `_` is written between backticks.
//!
//! # The sign of a difference
//!
//! It is +1 or -1 and never 0: a difference of at most the signal's threshold leaves the sign as it was, and before the
//! first larger difference of a stretch it is +1. Its square is therefore 1 exactly, and candidates that differ by
//! such a square are the same candidate.

mod accumulate;
mod collinear;
mod design;
mod dictionary;
mod distinct;
mod error;
mod kernel;
mod model;
mod record;
mod run;
mod signals;
mod spec;
mod sums;
mod term;
mod totals;
mod whole;

pub use accumulate::GramSums;
pub use design::Design;
pub use dictionary::{Dictionary, Dropped, DroppedReason};
pub use error::DictionaryError;
pub use model::{Model, Run};
pub use record::{FIRST_SIGN, Record, next_sign};
pub use signals::{SignalName, Signals};
pub use spec::{Constant, Rule, Spec};
pub use term::{Factor, Quantity, Signal, Term};
