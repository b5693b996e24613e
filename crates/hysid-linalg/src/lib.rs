//! Dense least squares on plain column-major `f64`: QR, Cholesky, Gram states, orthogonalisation kernels. The only crate that names faer.
//!
//! [`Columns`] is a matrix known by what one can ask of its columns; the dictionary of regressors implements it without
//! ever storing itself, [`Matrix`] implements it by storage. [`lstsq`] solves a tall least-squares problem by
//! Householder QR with equilibrated columns. No type of a linear-algebra crate appears in a signature.

mod columns;
pub mod lanes;
mod lstsq;
mod matrix;
mod tall;
mod vector;

pub use columns::{Columns, Gram, Start, map_blocks, sum_over_blocks};
pub use lstsq::{LinalgError, Lstsq, lstsq, solve_factor};
pub use matrix::Matrix;
pub use tall::TallQr;
pub use vector::{
    Stored, all_finite, axpy, dot, leave_one_out_sum, multiply_by, product, product_of_rows, take_out, turn,
};
