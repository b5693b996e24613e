//! Levenberg-Marquardt for whitened simulation errors, with bounds by an active set.
//!
//! The problem gives predictions and their derivatives in the unit of the outputs; whitening, weighting of rows and scaling of columns
//! happen here. A simulation that diverges is a rejected step, not an error. Columns are scaled by their norms, so the natural sizes of the
//! parameters do not matter.
//!
//! Reference: J. J. More (1978), the scaling; H. B. Nielsen (1999), the damping.

use nalgebra::{DMatrix, DVector};

use crate::evidence::{Layout, Whitener, dot, norm2};

/// A stack of predictions that depends on parameters.
pub trait Problem: Sync {
    /// Lower and upper bounds, one pair for each parameter.
    fn bounds(&self) -> &[(f64, f64)];
    /// The stacked residual recording - prediction; `None` where the simulation diverges.
    fn residual(&self, theta: &[f64]) -> Option<Vec<f64>>;
    /// The stacked residual and the derivatives of the *prediction*, one stack for each parameter.
    fn tangent(&self, theta: &[f64]) -> Option<(Vec<f64>, Vec<Vec<f64>>)>;
}

/// When to stop.
#[derive(Debug, Clone, Copy)]
pub struct LmOptions {
    /// Most iterations (each one tangent and one or more simulations).
    pub iterations: usize,
    /// Relative decrease of the cost below which the fit has converged.
    pub tolerance: f64,
}

impl Default for LmOptions {
    fn default() -> Self {
        Self { iterations: 30, tolerance: 1e-7 }
    }
}

/// The end of a fit.
#[derive(Debug, Clone)]
pub struct Fit {
    /// The parameters.
    pub theta: Vec<f64>,
    /// Sum of squares of the weighted whitened residual.
    pub cost: f64,
    /// The residual in the unit of the outputs.
    pub residual: Vec<f64>,
    /// Derivatives of the prediction, in the unit of the outputs.
    pub jacobian: Vec<Vec<f64>>,
    /// Whether a parameter stands at a bound.
    pub at_bound: Vec<bool>,
    /// Iterations used.
    pub iterations: usize,
    /// Whether the tolerance was met.
    pub converged: bool,
}

/// Applies row weights (1 where there are none).
fn weigh(rows: &mut [f64], weights: Option<&[f64]>) {
    if let Some(w) = weights {
        rows.iter_mut().zip(w).for_each(|(r, w)| *r *= w);
    }
}

/// Fits `theta` from `start`; `None` when the simulation diverges at the start.
///
/// `weights` multiply the whitened rows: 0 leaves a row out.
pub fn levenberg_marquardt(
    problem: &dyn Problem,
    start: &[f64],
    layout: &Layout,
    whitener: &Whitener,
    weights: Option<&[f64]>,
    options: LmOptions,
) -> Option<Fit> {
    let theta: Vec<f64> = start.iter().zip(problem.bounds()).map(|(x, b)| x.clamp(b.0, b.1)).collect();
    let first = problem.tangent(&theta)?;
    descend(problem, theta, first, layout, whitener, weights, options)
}

/// Goes on where a fit of the same problem ended, under another noise model, other weights or for longer: what was found of the
/// starting point is known already.
pub fn go_on(
    problem: &dyn Problem,
    fit: &Fit,
    layout: &Layout,
    whitener: &Whitener,
    weights: Option<&[f64]>,
    options: LmOptions,
) -> Option<Fit> {
    let first = (fit.residual.clone(), fit.jacobian.clone());
    descend(problem, fit.theta.clone(), first, layout, whitener, weights, options)
}

/// The fit from a point with its residual and tangents.
fn descend(
    problem: &dyn Problem,
    mut theta: Vec<f64>,
    (mut residual, mut jacobian): (Vec<f64>, Vec<Vec<f64>>),
    layout: &Layout,
    whitener: &Whitener,
    weights: Option<&[f64]>,
    options: LmOptions,
) -> Option<Fit> {
    let bounds = problem.bounds();
    let clamp = |i: usize, x: f64| x.clamp(bounds[i].0, bounds[i].1);
    let k = theta.len();
    let whiten = |stack: &[f64]| {
        let mut w = whitener.apply(layout, stack);
        weigh(&mut w, weights);
        w
    };
    let cost_of = |residual: &[f64]| {
        let c = norm2(&whiten(residual));
        if c.is_finite() { c } else { f64::INFINITY }
    };
    let mut white = whiten(&residual);
    let mut cost = norm2(&white);
    if !cost.is_finite() {
        return None;
    }
    let (mut mu, mut nu) = (1e-3, 2.0);
    let mut scale = vec![0.0f64; k];
    let mut converged = k == 0;
    let mut iterations = 0;
    let mut small_steps = 0;
    while iterations < options.iterations && !converged {
        iterations += 1;
        let columns: Vec<Vec<f64>> = jacobian.iter().map(|c| whiten(c)).collect();
        let gradient: Vec<f64> = columns.iter().map(|c| dot(c, &white)).collect();
        let span = |i: usize| {
            if bounds[i].0.is_finite() && bounds[i].1.is_finite() {
                bounds[i].1 - bounds[i].0
            } else {
                theta[i].abs().max(1e-12)
            }
        };
        let free: Vec<usize> = (0..k)
            .filter(|&i| {
                let edge = 1e-9 * span(i);
                let blocked = (theta[i] <= bounds[i].0 + edge && gradient[i] < 0.0)
                    || (theta[i] >= bounds[i].1 - edge && gradient[i] > 0.0);
                !blocked && norm2(&columns[i]) > 0.0 && columns[i].iter().all(|x| x.is_finite())
            })
            .collect();
        for &i in &free {
            scale[i] = scale[i].max(norm2(&columns[i]).sqrt());
        }
        let m = free.len();
        if m == 0 {
            converged = true;
            break;
        }
        let mut gram = DMatrix::zeros(m, m);
        for (a, &i) in free.iter().enumerate() {
            for (b, &j) in free.iter().enumerate().take(a + 1) {
                let g = dot(&columns[i], &columns[j]) / (scale[i] * scale[j]);
                gram[(a, b)] = g;
                gram[(b, a)] = g;
            }
        }
        let rhs = DVector::from_iterator(m, free.iter().map(|&i| gradient[i] / scale[i]));
        // Inner loop: raise the damping until a step lowers the cost.
        let mut accepted = false;
        for tries in 0..12 {
            let mut damped = gram.clone();
            for a in 0..m {
                damped[(a, a)] += mu * gram[(a, a)].max(1e-8) + 1e-13;
            }
            let Some(cholesky) = damped.cholesky() else {
                mu = (mu * nu).max(1e-10);
                nu *= 2.0;
                continue;
            };
            let step = cholesky.solve(&rhs);
            let mut trial = theta.clone();
            for (a, &i) in free.iter().enumerate() {
                trial[i] = clamp(i, theta[i] + step[a] / scale[i]);
            }
            let change: Vec<f64> = free.iter().map(|&i| (trial[i] - theta[i]) * scale[i]).collect();
            let length = norm2(&change);
            if length <= 1e-24 * cost.max(1e-300) {
                converged = true;
                break;
            }
            let d = DVector::from_column_slice(&change);
            let predicted = 2.0 * d.dot(&rhs) - (gram.clone() * &d).dot(&d);
            // The first step is accepted in nine cases of ten: tangents are needed then, and a run without them would be for nothing.
            let first = tries == 0;
            let mut ahead = if first { problem.tangent(&trial) } else { None };
            let trial_cost = match &ahead {
                Some((r, _)) => cost_of(r),
                None if first => f64::INFINITY,
                None => problem.residual(&trial).map_or(f64::INFINITY, |r| cost_of(&r)),
            };
            let gain = (cost - trial_cost) / predicted.max(1e-300);
            if trial_cost < cost && gain > 1e-4 {
                let drop = (cost - trial_cost) / cost.max(1e-300);
                let Some((r, j)) = ahead.take().or_else(|| problem.tangent(&trial)) else {
                    mu *= nu;
                    nu *= 2.0;
                    continue;
                };
                theta = trial;
                residual = r;
                jacobian = j;
                white = whiten(&residual);
                cost = norm2(&white);
                mu = (mu * (1.0 - (2.0 * gain - 1.0).powi(3)).max(1.0 / 5.0)).max(1e-12);
                nu = 2.0;
                accepted = true;
                small_steps = if drop < options.tolerance { small_steps + 1 } else { 0 };
                // One more step after a tiny gain: a valley's floor can be crooked.
                converged = small_steps >= 2 || drop < 1e-3 * options.tolerance;
                break;
            }
            if predicted <= options.tolerance * 1e-2 * cost {
                converged = true;
                break;
            }
            mu *= nu;
            nu *= 2.0;
        }
        if !accepted {
            converged = converged || mu > 1e10;
            break;
        }
    }
    let at_bound = (0..k)
        .map(|i| {
            let (lo, hi) = bounds[i];
            let span = if lo.is_finite() && hi.is_finite() { hi - lo } else { theta[i].abs() };
            (theta[i] - lo).abs() <= 1e-6 * span || (hi - theta[i]).abs() <= 1e-6 * span
        })
        .collect();
    Some(Fit { theta, cost, residual, jacobian, at_bound, iterations, converged })
}

impl Fit {
    /// Covariance of the parameters for a whitened noise of variance `variance`; parameters at a bound and unseen ones have zero rows.
    ///
    /// Column-major, `k` by `k`.
    pub fn covariance(&self, layout: &Layout, whitener: &Whitener, weights: Option<&[f64]>, variance: f64) -> Vec<f64> {
        let k = self.theta.len();
        let columns: Vec<Vec<f64>> = self
            .jacobian
            .iter()
            .map(|c| {
                let mut w = whitener.apply(layout, c);
                weigh(&mut w, weights);
                w
            })
            .collect();
        let scale: Vec<f64> = columns.iter().map(|c| norm2(c).sqrt()).collect();
        let free: Vec<usize> =
            (0..k).filter(|&i| scale[i] > 0.0 && scale[i].is_finite() && !self.at_bound[i]).collect();
        let m = free.len();
        let mut gram = DMatrix::zeros(m, m);
        for (a, &i) in free.iter().enumerate() {
            for (b, &j) in free.iter().enumerate() {
                gram[(a, b)] = dot(&columns[i], &columns[j]) / (scale[i] * scale[j]);
            }
            gram[(a, a)] += 1e-12;
        }
        let mut covariance = vec![0.0; k * k];
        if let Some(inverse) = gram.cholesky().map(|c| c.inverse()) {
            for (a, &i) in free.iter().enumerate() {
                for (b, &j) in free.iter().enumerate() {
                    covariance[i + k * j] = variance * inverse[(a, b)] / (scale[i] * scale[j]);
                }
            }
        }
        covariance
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evidence::{NoiseModel, Series};

    /// `y = a exp(-b t)`, exact derivatives; diverges for b < 0.
    struct Decay {
        y: Vec<f64>,
        bounds: Vec<(f64, f64)>,
    }

    impl Problem for Decay {
        fn bounds(&self) -> &[(f64, f64)] {
            &self.bounds
        }
        fn residual(&self, p: &[f64]) -> Option<Vec<f64>> {
            if p[1] < 0.0 {
                return None;
            }
            Some(self.y.iter().enumerate().map(|(n, y)| y - p[0] * (-p[1] * n as f64 * 0.1).exp()).collect())
        }
        fn tangent(&self, p: &[f64]) -> Option<(Vec<f64>, Vec<Vec<f64>>)> {
            let r = self.residual(p)?;
            let t = |n: usize| n as f64 * 0.1;
            let a = (0..r.len()).map(|n| (-p[1] * t(n)).exp()).collect();
            let b = (0..r.len()).map(|n| -p[0] * t(n) * (-p[1] * t(n)).exp()).collect();
            Some((r, vec![a, b]))
        }
    }

    fn fit(start: [f64; 2], bounds: Vec<(f64, f64)>) -> Fit {
        let n = 50;
        let problem = Decay { y: (0..n).map(|i| 3.0 * (-0.7 * i as f64 * 0.1).exp()).collect(), bounds };
        let layout = Layout { series: vec![Series { stretch: 0, output: 0, first: 0, rows: 0..n }], outputs: 1 };
        let whitener = Whitener { models: vec![NoiseModel::white(0.1)] };
        levenberg_marquardt(&problem, &start, &layout, &whitener, None, LmOptions::default()).unwrap()
    }

    #[test]
    fn a_decay_is_found_from_far_away() {
        for start in [[1.0, 0.1], [20.0, 5.0], [-1.0, 2.0]] {
            let f = fit(start, vec![(-100.0, 100.0), (-10.0, 10.0)]);
            assert!((f.theta[0] - 3.0).abs() < 1e-5 && (f.theta[1] - 0.7).abs() < 1e-5, "{:?}", f.theta);
            assert!(f.converged);
        }
    }

    #[test]
    fn a_fit_that_goes_on_is_the_fit_from_its_end() {
        let n = 50;
        let bounds = vec![(-100.0, 100.0), (-10.0, 10.0)];
        let problem = Decay { y: (0..n).map(|i| 3.0 * (-0.7 * i as f64 * 0.1).exp()).collect(), bounds };
        let layout = Layout { series: vec![Series { stretch: 0, output: 0, first: 0, rows: 0..n }], outputs: 1 };
        let whitener = Whitener { models: vec![NoiseModel::white(0.1)] };
        let weights: Vec<f64> = (0..n).map(|i| f64::from(u8::from(i % 3 > 0))).collect();
        for iterations in [0, 2, 30] {
            let options = LmOptions { iterations, ..LmOptions::default() };
            let begun = levenberg_marquardt(&problem, &[20.0, 5.0], &layout, &whitener, None, options).unwrap();
            let longer = LmOptions::default();
            let from_its_end =
                levenberg_marquardt(&problem, &begun.theta, &layout, &whitener, Some(&weights), longer).unwrap();
            let further = go_on(&problem, &begun, &layout, &whitener, Some(&weights), longer).unwrap();
            assert_eq!((further.theta, further.residual), (from_its_end.theta, from_its_end.residual));
        }
    }

    #[test]
    fn a_bound_holds_and_is_told() {
        let f = fit([1.0, 0.1], vec![(-100.0, 2.0), (0.0, 10.0)]);
        assert_eq!(f.theta[0], 2.0);
        assert_eq!(f.at_bound, vec![true, false]);
        // Given a = 2 the best b solves a one-dimensional problem: compare with a scan.
        let cost = |b: f64| {
            (0..50)
                .map(|i| {
                    let t = i as f64 * 0.1;
                    (3.0 * (-0.7 * t).exp() - 2.0 * (-b * t).exp()).powi(2)
                })
                .sum::<f64>()
        };
        let scan = (0..20_000).map(|i| i as f64 * 1e-4).min_by(|a, b| cost(*a).total_cmp(&cost(*b))).unwrap();
        assert!((f.theta[1] - scan).abs() < 2e-4, "{} {scan}", f.theta[1]);
    }

    #[test]
    fn the_covariance_is_that_of_the_linear_model() {
        let f = fit([1.0, 0.1], vec![(-100.0, 100.0), (-10.0, 10.0)]);
        let n = 50;
        let layout = Layout { series: vec![Series { stretch: 0, output: 0, first: 0, rows: 0..n }], outputs: 1 };
        let whitener = Whitener { models: vec![NoiseModel::white(0.1)] };
        let c = f.covariance(&layout, &whitener, None, 1.0);
        let (a, b) = (&f.jacobian[0], &f.jacobian[1]);
        let (aa, ab, bb) = (dot(a, a) / 0.01, dot(a, b) / 0.01, dot(b, b) / 0.01);
        let det = aa * bb - ab * ab;
        assert!(
            (c[0] - bb / det).abs() < 1e-6 * c[0]
                && (c[3] - aa / det).abs() < 1e-6 * c[3]
                && (c[1] + ab / det).abs() < 1e-6 * c[1].abs()
        );
    }
}
