//! The observer that the homotopy from prediction to free run rests on: a stationary Kalman gain for the linear model.
//!
//! The disturbance is taken to enter where the inputs do (where there is none, in every state's derivative), with `strength`
//! times their rms; the measurement's noise is taken as 1 % of the outputs' rms. Strength 1 follows the measurement
//! closely (like an equation error), 0 is the free run.

use nalgebra::DMatrix;

use super::Data;
use crate::engine::Compiled;

pub(crate) fn rms_about_mean(series: &[f64]) -> f64 {
    let (mut n, mut sum, mut squares) = (0.0, 0.0, 0.0);
    for x in series.iter().filter(|x| x.is_finite()) {
        n += 1.0;
        sum += x;
        squares += x * x;
    }
    if n == 0.0 { 0.0 } else { (squares / n - (sum / n) * (sum / n)).max(0.0).sqrt() }
}

impl Compiled {
    /// The gain for [`crate::Observer`], state by output, for parameters `theta` beside states `x`.
    ///
    /// Zero where the Riccati recursion does not settle on finite numbers.
    pub fn observer_gain(&self, data: &Data, theta: &[f64], x: &[f64], strength: f64) -> Vec<f64> {
        let (m, n, p) = self.sizes();
        let zero = vec![0.0; n * p];
        if n == 0 || strength <= 0.0 {
            return zero;
        }
        let period = data.drive.period_s();
        let mean = |s: &Vec<f64>| s.iter().sum::<f64>() / s.len().max(1) as f64;
        let u: Vec<f64> = data.drive.inputs().iter().map(mean).collect();
        let linear = self.linearise(theta, x, &u);
        let matrix = |rows: usize, columns: usize, values: &[f64]| DMatrix::from_row_slice(rows, columns, values);
        let (a, c) = (matrix(n, n, &linear.a) * period, matrix(p, n, &linear.c));
        if a.iter().chain(c.iter()).any(|x| !x.is_finite()) || a.norm() > 1e4 {
            return zero;
        }
        let a = a.exp();
        let mut g = matrix(n, m, &linear.b);
        for (j, series) in data.drive.inputs().iter().enumerate() {
            let mut column = g.column_mut(j);
            column *= rms_about_mean(series) * period * strength;
        }
        let mut q = &g * g.transpose();
        if q.norm() == 0.0 {
            q = DMatrix::identity(n, n) * (period * strength).powi(2);
        }
        q += DMatrix::identity(n, n) * (1e-12 * q.norm() / n as f64);
        let mut r = DMatrix::zeros(p, p);
        for (j, series) in data.measured.iter().enumerate() {
            r[(j, j)] = (0.01 * rms_about_mean(series)).powi(2).max(f64::MIN_POSITIVE);
        }
        let mut covariance = q.clone();
        let mut gain = DMatrix::zeros(n, p);
        for _ in 0..500 {
            let predicted = &a * &covariance * a.transpose() + &q;
            let Some(inverse) = (&c * &predicted * c.transpose() + &r).try_inverse() else { return zero };
            let next = &predicted * c.transpose() * inverse;
            let change = (&next - &gain).norm();
            covariance = &predicted - &next * &c * &predicted;
            covariance = (&covariance + covariance.transpose()) * 0.5;
            gain = next;
            if change <= 1e-6 * gain.norm() {
                break;
            }
        }
        if gain.iter().any(|x| !x.is_finite()) {
            return zero;
        }
        gain.transpose().as_slice().to_vec()
    }
}
