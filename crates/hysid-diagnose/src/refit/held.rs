//! Some parameters of a fit held where they are.

use super::lm::Problem;

/// A problem of which some parameters stay: their bounds are where they stand.
pub struct Held<'a> {
    problem: &'a dyn Problem,
    bounds: Vec<(f64, f64)>,
}

impl<'a> Held<'a> {
    /// Of these parameters, those at these places stay at their values.
    pub fn at(problem: &'a dyn Problem, theta: &[f64], places: &[usize]) -> Self {
        let mut bounds = problem.bounds().to_vec();
        for &i in places {
            bounds[i] = (theta[i], theta[i]);
        }
        Self { problem, bounds }
    }
}

impl Problem for Held<'_> {
    fn bounds(&self) -> &[(f64, f64)] {
        &self.bounds
    }

    fn residual(&self, theta: &[f64]) -> Option<Vec<f64>> {
        self.problem.residual(theta)
    }

    fn tangent(&self, theta: &[f64]) -> Option<(Vec<f64>, Vec<Vec<f64>>)> {
        self.problem.tangent(theta)
    }
}

#[cfg(test)]
mod tests {
    use super::super::{LmOptions, levenberg_marquardt};
    use super::*;
    use crate::evidence::{Layout, NoiseModel, Series, Whitener};

    /// `y = a + b n`.
    struct Line {
        y: Vec<f64>,
        bounds: [(f64, f64); 2],
    }

    impl Problem for Line {
        fn bounds(&self) -> &[(f64, f64)] {
            &self.bounds
        }
        fn residual(&self, p: &[f64]) -> Option<Vec<f64>> {
            Some(self.y.iter().enumerate().map(|(n, y)| y - p[0] - p[1] * n as f64).collect())
        }
        fn tangent(&self, p: &[f64]) -> Option<(Vec<f64>, Vec<Vec<f64>>)> {
            let n = self.y.len();
            Some((self.residual(p)?, vec![vec![1.0; n], (0..n).map(|n| n as f64).collect()]))
        }
    }

    #[test]
    fn what_is_held_stays_and_the_others_follow_it() {
        let n = 40;
        let y: Vec<f64> = (0..n).map(|i| 2.0 + 0.5 * f64::from(i)).collect();
        let line = Line { y: y.clone(), bounds: [(-100.0, 100.0), (-10.0, 10.0)] };
        let layout = Layout { series: vec![Series { stretch: 0, output: 0, first: 0, rows: 0..y.len() }], outputs: 1 };
        let whitener = Whitener::of(vec![NoiseModel::white(0.1)]);
        let start = [0.0, 0.3];
        let held = Held::at(&line, &start, &[1]);
        let fit = levenberg_marquardt(&held, &start, &layout, &whitener, None, LmOptions::default()).unwrap();
        // The mean of what the slope that is held leaves.
        let mean = y.iter().enumerate().map(|(i, y)| y - 0.3 * i as f64).sum::<f64>() / y.len() as f64;
        assert!(fit.theta[1] == 0.3 && (fit.theta[0] - mean).abs() < 1e-4, "{:?} {mean}", fit.theta);
    }
}
