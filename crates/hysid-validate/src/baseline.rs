//! What every model must beat: the last value again, and the best linear difference equation.

use hysid_linalg::{LinalgError, Matrix, lstsq};

/// The prediction `steps` samples ahead that says "as now": y(n - steps), `NaN` for the first samples.
pub fn persistence(y: &[f64], steps: usize) -> Vec<f64> {
    let past = steps.min(y.len());
    std::iter::repeat_n(f64::NAN, past).chain(y[..y.len() - past].iter().copied()).collect()
}

/// One stretch without a gap to estimate a linear model on.
#[derive(Debug, Clone, Copy)]
pub struct ArxRecord<'a> {
    /// Each input, as long as the output.
    pub inputs: &'a [&'a [f64]],
    /// The output.
    pub output: &'a [f64],
}

/// What can be wrong with the estimation of a baseline.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BaselineError {
    /// Records with different numbers of inputs, or none.
    #[error("every record must have the same number of inputs (the first has {expected}, one has {found})")]
    Inputs {
        /// Inputs of the first record.
        expected: usize,
        /// Inputs of the record at fault.
        found: usize,
    },
    /// An input that is shorter or longer than the output.
    #[error("an input has {found} samples where the output has {expected}")]
    UnequalLengths {
        /// Samples of the output.
        expected: usize,
        /// Samples of the input.
        found: usize,
    },
    /// The least-squares problem has no answer.
    #[error(transparent)]
    LeastSquares(#[from] LinalgError),
}

/// A linear difference equation with a constant,
/// y(n) = c + sum a_i y(n-i) + sum over inputs and j >= 0 of b_j u(n-j), for i = 1 to na and j = 0 to nb.
#[derive(Debug, Clone, PartialEq)]
pub struct LinearArx {
    constant: f64,
    a: Vec<f64>,
    b: Vec<Vec<f64>>,
}

impl LinearArx {
    /// The least-squares estimate of the one-step error on all records, with `na` past outputs and `nb` past values of each input beside
    /// the present one.
    ///
    /// # Errors
    /// Records that do not fit together, fewer rows than parameters, samples that are not finite.
    pub fn estimate(records: &[ArxRecord<'_>], na: usize, nb: usize) -> Result<Self, BaselineError> {
        let inputs = records.first().map_or(0, |r| r.inputs.len());
        for r in records {
            if r.inputs.len() != inputs {
                return Err(BaselineError::Inputs { expected: inputs, found: r.inputs.len() });
            }
            if let Some(u) = r.inputs.iter().find(|u| u.len() != r.output.len()) {
                return Err(BaselineError::UnequalLengths { expected: r.output.len(), found: u.len() });
            }
        }
        let past = na.max(nb);
        let rows = || records.iter().flat_map(|r| (past..r.output.len()).map(move |n| (r, n)));
        let mut columns: Vec<Vec<f64>> = vec![rows().map(|_| 1.0).collect()];
        for i in 1..=na {
            columns.push(rows().map(|(r, n)| r.output[n - i]).collect());
        }
        for k in 0..inputs {
            for j in 0..=nb {
                columns.push(rows().map(|(r, n)| r.inputs[k][n - j]).collect());
            }
        }
        let target: Vec<f64> = rows().map(|(r, n)| r.output[n]).collect();
        let shape = LinalgError::TooFewRows { rows: target.len(), cols: columns.len() };
        let matrix = Matrix::from_columns(&columns).ok_or(shape)?;
        let theta = lstsq(&matrix, &target)?.theta;
        let b = (0..inputs).map(|k| theta[1 + na + k * (nb + 1)..][..nb + 1].to_vec()).collect();
        Ok(Self { constant: theta[0], a: theta[1..=na].to_vec(), b })
    }

    /// The coefficients: the constant, those of the past outputs, those of each input from the present one back.
    pub fn coefficients(&self) -> (f64, &[f64], &[Vec<f64>]) {
        (self.constant, &self.a, &self.b)
    }

    /// The prediction of each sample from the measured past; `NaN` where a needed sample is missing.
    pub fn one_step(&self, inputs: &[&[f64]], y: &[f64]) -> Vec<f64> {
        let past = self.past();
        (0..y.len()).map(|n| if n < past { f64::NAN } else { self.next(inputs, y, n) }).collect()
    }

    /// The free run from the first measured samples (as many as the model looks back; `NaN` there), on its own output alone afterwards.
    ///
    /// `y` need not be longer than these first samples; the run is as long as the shortest input (or `y`, without inputs).
    pub fn free_run(&self, inputs: &[&[f64]], y: &[f64]) -> Vec<f64> {
        let past = self.past();
        let length = inputs.iter().map(|u| u.len()).min().unwrap_or(y.len());
        let mut run: Vec<f64> = y.iter().copied().take(past.min(length)).collect();
        run.resize(past.min(length), f64::NAN);
        for n in past..length {
            run.push(self.next(inputs, &run, n));
        }
        run.iter_mut().take(past).for_each(|x| *x = f64::NAN);
        run
    }

    fn past(&self) -> usize {
        self.b.iter().map(|b| b.len().saturating_sub(1)).fold(self.a.len(), usize::max)
    }

    fn next(&self, inputs: &[&[f64]], y: &[f64], n: usize) -> f64 {
        let outputs: f64 = self.a.iter().enumerate().map(|(i, a)| a * y[n - 1 - i]).sum();
        let forced: f64 =
            inputs.iter().zip(&self.b).flat_map(|(u, b)| b.iter().enumerate().map(move |(j, b)| b * u[n - j])).sum();
        self.constant + outputs + forced
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn system(n: usize) -> (Vec<f64>, Vec<f64>) {
        let u: Vec<f64> = (0..n).map(|k| (0.7 * k as f64).sin() + (0.13 * (k * k % 97) as f64).cos()).collect();
        let mut y = vec![0.3, -0.2];
        for k in 2..n {
            y.push(0.5 + 1.2 * y[k - 1] - 0.5 * y[k - 2] + 0.4 * u[k] - 0.1 * u[k - 1]);
        }
        (u, y)
    }

    #[test]
    fn a_linear_system_is_found_and_runs_free() {
        let (u, y) = system(300);
        let records = [
            ArxRecord { inputs: &[&u[..120]], output: &y[..120] },
            ArxRecord { inputs: &[&u[120..]], output: &y[120..] },
        ];
        let arx = LinearArx::estimate(&records, 2, 1).unwrap();
        let (c, a, b) = arx.coefficients();
        for (found, truth) in [(c, 0.5), (a[0], 1.2), (a[1], -0.5), (b[0][0], 0.4), (b[0][1], -0.1)] {
            assert!((found - truth).abs() < 1e-10);
        }
        for run in [arx.free_run(&[&u], &y[..2]), arx.one_step(&[&u], &y)] {
            assert!(run[..2].iter().all(|x| x.is_nan()));
            assert!(run[2..].iter().zip(&y[2..]).all(|(a, b)| (a - b).abs() < 1e-8));
        }
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let (u, y) = system(10);
        let e =
            |inputs: &[&[f64]], y: &[f64]| LinearArx::estimate(&[ArxRecord { inputs, output: y }], 2, 1).unwrap_err();
        assert!(matches!(e(&[&u[..9]], &y), BaselineError::UnequalLengths { .. }));
        assert!(matches!(e(&[&u[..5]], &y[..5]), BaselineError::LeastSquares(_)));
        assert!(matches!(e(&[&u[..1]], &y[..1]), BaselineError::LeastSquares(_)));
        let two = [ArxRecord { inputs: &[&u], output: &y }, ArxRecord { inputs: &[], output: &y }];
        assert!(matches!(LinearArx::estimate(&two, 1, 1), Err(BaselineError::Inputs { .. })));
    }

    #[test]
    fn persistence_is_the_past() {
        assert_eq!(persistence(&[1.0, 2.0, 3.0], 1)[1..], [1.0, 2.0]);
        assert!(persistence(&[1.0], 5).iter().all(|x| x.is_nan()));
    }
}
