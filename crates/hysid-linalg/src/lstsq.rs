//! Least squares by column-equilibrated Householder QR.

use crate::{Matrix, TallQr};

/// What can be wrong with a least-squares problem.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LinalgError {
    /// The right-hand side has another length than the matrix has rows.
    #[error("the matrix has {rows} rows, the right-hand side {found}")]
    Shape {
        /// Rows of the matrix.
        rows: usize,
        /// Length of the right-hand side.
        found: usize,
    },
    /// Fewer rows than columns: no unique solution.
    #[error("{rows} rows cannot determine {cols} parameters")]
    TooFewRows {
        /// Rows of the matrix.
        rows: usize,
        /// Columns of the matrix.
        cols: usize,
    },
    /// A value that is not finite.
    #[error("the data hold a value that is not finite")]
    NotFinite,
}

/// A least-squares solution.
#[derive(Debug, Clone, PartialEq)]
pub struct Lstsq {
    /// The parameters.
    pub theta: Vec<f64>,
    /// Sum of squared residuals.
    pub sse: f64,
    /// Diagonal of (A'A)^-1: times the residual variance, the parameters' variances. Infinite where singular.
    pub unscaled_variance: Vec<f64>,
    /// Ratio of the largest to the smallest diagonal entry of R of the equilibrated columns: a lower bound of the
    /// condition number.
    pub condition: f64,
    /// Columns that were set aside because they lie in the span of those before them; their parameter is 0.
    pub dependent: Vec<usize>,
}

/// Relative size of a pivot below which a column counts as dependent on those before it.
const PIVOT: f64 = 1e-13;

/// The parameters theta that minimise |a theta - b|.
///
/// # Errors
/// Lengths that do not match, fewer rows than columns, values that are not finite.
pub fn lstsq(a: &Matrix, b: &[f64]) -> Result<Lstsq, LinalgError> {
    let (rows, n) = (a.rows(), a.cols());
    if b.len() != rows {
        return Err(LinalgError::Shape { rows, found: b.len() });
    }
    if rows < n {
        return Err(LinalgError::TooFewRows { rows, cols: n });
    }
    let mut tile = a.as_slice().to_vec();
    tile.extend_from_slice(b);
    if tile.iter().any(|v| !v.is_finite()) {
        return Err(LinalgError::NotFinite);
    }
    let mut qr = TallQr::new(n + 1);
    qr.push(rows, &mut tile);
    Ok(solve_factor(&qr.into_factor(), n))
}

/// The solution from the factor R of the matrix `[A b]` (column-major, `n + 1` square).
pub fn solve_factor(r: &[f64], n: usize) -> Lstsq {
    let w = n + 1;
    let norm = |j: usize| (0..=j).map(|i| r[j * w + i] * r[j * w + i]).sum::<f64>().sqrt();
    let mut dependent = Vec::new();
    let (mut largest, mut smallest) = (0.0f64, f64::INFINITY);
    for j in 0..n {
        let relative = if norm(j) > 0.0 { r[j * w + j].abs() / norm(j) } else { 0.0 };
        if relative <= PIVOT {
            dependent.push(j);
        } else {
            largest = largest.max(relative);
            smallest = smallest.min(relative);
        }
    }
    // A dependent column has only rounding on its diagonal: its rotation still holds a part of `b`, which is residual.
    let free: Vec<usize> = (0..n).filter(|j| !dependent.contains(j)).collect();
    let mut theta = vec![0.0; n];
    for &i in free.iter().rev() {
        let known: f64 = free.iter().filter(|&&j| j > i).map(|&j| r[j * w + i] * theta[j]).sum();
        theta[i] = (r[n * w + i] - known) / r[i * w + i];
    }
    let mut sse = r[n * w + n] * r[n * w + n];
    for &d in &dependent {
        let left: f64 = r[n * w + d] - free.iter().filter(|&&j| j > d).map(|&j| r[j * w + d] * theta[j]).sum::<f64>();
        sse += left * left;
    }
    let mut unscaled_variance = vec![f64::INFINITY; n];
    // Rows of R^-1 restricted to the free columns: solve R z = e_k, variance_i = sum_k z_i^2.
    let mut sums = vec![0.0; n];
    for &k in &free {
        let mut z = vec![0.0; n];
        for &i in free.iter().rev().filter(|&&i| i <= k) {
            let known: f64 = free.iter().filter(|&&j| j > i && j <= k).map(|&j| r[j * w + i] * z[j]).sum();
            z[i] = (f64::from(u8::from(i == k)) - known) / r[i * w + i];
            sums[i] += z[i] * z[i];
        }
    }
    for &i in &free {
        unscaled_variance[i] = sums[i];
    }
    let condition = if !dependent.is_empty() {
        f64::INFINITY
    } else if n == 0 {
        1.0
    } else {
        largest / smallest
    };
    Lstsq { theta, sse, unscaled_variance, condition, dependent }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_through_points() {
        let a = Matrix::from_columns(&[vec![1.0; 4], vec![0.0, 1.0, 2.0, 3.0]]).unwrap();
        let fit = lstsq(&a, &[1.0, 3.0, 5.0, 7.5]).unwrap();
        // Normal equations by hand: slope 10.75 / 5, intercept 16.5 / 4 - 1.5 slope.
        approx::assert_relative_eq!(fit.theta[1], 2.15, epsilon = 1e-13);
        approx::assert_relative_eq!(fit.theta[0], 0.9, epsilon = 1e-13);
        approx::assert_relative_eq!(fit.unscaled_variance[1], 0.2, epsilon = 1e-13);
        approx::assert_relative_eq!(fit.unscaled_variance[0], 0.7, epsilon = 1e-13);
        approx::assert_relative_eq!(fit.sse, 0.075, epsilon = 1e-12);
    }

    #[test]
    fn a_repeated_column_is_set_aside() {
        let a = Matrix::from_columns(&[vec![1.0, 2.0, 4.0], vec![2.0, 4.0, 8.0]]).unwrap();
        let fit = lstsq(&a, &[1.0, 2.0, 4.0]).unwrap();
        assert_eq!(fit.dependent, vec![1]);
        assert_eq!(fit.theta[1], 0.0);
        approx::assert_relative_eq!(fit.theta[0], 1.0, epsilon = 1e-14);
    }

    #[test]
    fn bad_shapes_are_told() {
        let a = Matrix::zeros(2, 3);
        assert_eq!(lstsq(&a, &[0.0]).unwrap_err(), LinalgError::Shape { rows: 2, found: 1 });
        assert_eq!(lstsq(&a, &[0.0; 2]).unwrap_err(), LinalgError::TooFewRows { rows: 2, cols: 3 });
    }
}
