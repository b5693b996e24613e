//! Levenberg-Marquardt for whitened simulation errors, with bounds by an active set.
//!
//! The problem gives predictions and their derivatives in the unit of the outputs; whitening, weighting of rows and scaling of columns
//! happen here. A simulation that diverges is a rejected step, not an error. Columns are scaled by their norms, so the natural sizes of the
//! parameters do not matter.
//!
//! Reference: J. J. More (1978), the scaling; H. B. Nielsen (1999), the damping.

use hysid_linalg::dot;
use nalgebra::DMatrix;

use super::normal::{System, Weighting};
use super::options::LmOptions;
use crate::evidence::{Layout, Whitener, norm2};

/// A stack of predictions that depends on parameters.
pub trait Problem: Sync {
    /// Lower and upper bounds, one pair for each parameter.
    fn bounds(&self) -> &[(f64, f64)];
    /// The stacked residual recording - prediction; `None` where the simulation diverges.
    fn residual(&self, theta: &[f64]) -> Option<Vec<f64>>;
    /// The stacked residual and the derivatives of the *prediction*, one stack for each parameter.
    fn tangent(&self, theta: &[f64]) -> Option<(Vec<f64>, Vec<Vec<f64>>)>;
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
    descend(problem, theta, first, Weighting { layout, whitener, weights }, options)
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
    descend(problem, fit.theta.clone(), first, Weighting { layout, whitener, weights }, options)
}

/// The fit from a point with its residual and tangents.
fn descend(
    problem: &dyn Problem,
    theta: Vec<f64>,
    (residual, jacobian): (Vec<f64>, Vec<Vec<f64>>),
    weighting: Weighting<'_>,
    options: LmOptions,
) -> Option<Fit> {
    let point = Point::new(theta, residual, jacobian, weighting);
    if !point.cost.is_finite() {
        return None;
    }
    let bounds = problem.bounds();
    let scale = vec![0.0; point.theta.len()];
    let mut descent = Descent { problem, weighting, point, scale, mu: DAMPING, nu: 2.0 };
    let mut converged = descent.scale.is_empty();
    let (mut iterations, mut small_steps) = (0, 0);
    while iterations < options.iterations && !converged {
        iterations += 1;
        match descent.improve(options.tolerance) {
            Outcome::Lower(drop) => {
                small_steps = if drop < options.tolerance { small_steps + 1 } else { 0 };
                // One more step after a tiny gain: a valley's floor can be crooked.
                converged = small_steps >= 2 || drop < 1e-3 * options.tolerance;
            }
            Outcome::Ended => converged = true,
            Outcome::Stuck => {
                converged = descent.mu > 1e10;
                break;
            }
        }
    }
    let Point { theta, residual, jacobian, cost, .. } = descent.point;
    let at_bound = (theta.iter().zip(bounds))
        .map(|(x, &(lo, hi))| {
            let span = if lo.is_finite() && hi.is_finite() { hi - lo } else { x.abs() };
            (x - lo).abs() <= 1e-6 * span || (hi - x).abs() <= 1e-6 * span
        })
        .collect();
    Some(Fit { theta, cost, residual, jacobian, at_bound, iterations, converged })
}

/// A point with all that is known of it.
struct Point {
    theta: Vec<f64>,
    residual: Vec<f64>,
    jacobian: Vec<Vec<f64>>,
    /// The weighted residual.
    white: Vec<f64>,
    cost: f64,
}

impl Point {
    fn new(theta: Vec<f64>, residual: Vec<f64>, jacobian: Vec<Vec<f64>>, weighting: Weighting<'_>) -> Self {
        let white = weighting.apply(&residual);
        let cost = norm2(&white);
        Self { theta, residual, jacobian, white, cost }
    }
}

/// What an iteration came to.
enum Outcome {
    /// A point that is lower by this share of the cost.
    Lower(f64),
    /// There is nothing to gain.
    Ended,
    /// No step led down.
    Stuck,
}

/// Steps that an iteration tries, each damped more than the one before.
const TRIES: usize = 12;
/// Share of the predicted gain that a step must bring.
const WORTH: f64 = 1e-4;
/// Damping at the start, and the least after a step that failed: under less the next would be the same one again.
const DAMPING: f64 = 1e-3;

/// A fit under way.
struct Descent<'a> {
    problem: &'a dyn Problem,
    weighting: Weighting<'a>,
    point: Point,
    /// Largest norm that each column has had.
    scale: Vec<f64>,
    /// The damping, and by what it grows when a step fails.
    mu: f64,
    nu: f64,
}

impl Descent<'_> {
    /// One iteration: the damping is raised until a step lowers the cost.
    fn improve(&mut self, tolerance: f64) -> Outcome {
        let columns: Vec<Vec<f64>> = self.point.jacobian.iter().map(|c| self.weighting.apply(c)).collect();
        let gradient: Vec<f64> = columns.iter().map(|c| dot(c, &self.point.white)).collect();
        let free = self.free(&columns, &gradient);
        for &i in &free {
            self.scale[i] = self.scale[i].max(norm2(&columns[i]).sqrt());
        }
        if free.is_empty() {
            return Outcome::Ended;
        }
        let system = System::new(&columns, &gradient, &free, &self.scale);
        let cost = self.point.cost;
        // Told beforehand, the last step of a fit, whose gain is nothing, is not simulated.
        if system.step(0.0).is_some_and(|whole| system.predicted(&whole) <= tolerance * cost) {
            return Outcome::Ended;
        }
        for tries in 0..TRIES {
            let Some(step) = system.step(self.mu) else {
                self.dampen();
                continue;
            };
            let trial = self.moved(&free, &step);
            let change: Vec<f64> = free.iter().map(|&i| (trial[i] - self.point.theta[i]) * self.scale[i]).collect();
            if norm2(&change) <= 1e-24 * cost.max(1e-300) {
                return Outcome::Ended;
            }
            let predicted = system.predicted(&change);
            // The first step is accepted in nine cases of ten: tangents are needed then, and a run without them would be for nothing.
            let first = tries == 0;
            let mut ahead = if first { self.problem.tangent(&trial) } else { None };
            let trial_cost = match &ahead {
                Some((r, _)) => self.weighting.cost(r),
                None if first => f64::INFINITY,
                None => self.problem.residual(&trial).map_or(f64::INFINITY, |r| self.weighting.cost(&r)),
            };
            let gain = (cost - trial_cost) / predicted.max(1e-300);
            if trial_cost < cost && gain > WORTH {
                let Some((r, j)) = ahead.take().or_else(|| self.problem.tangent(&trial)) else {
                    self.dampen();
                    continue;
                };
                self.point = Point::new(trial, r, j, self.weighting);
                self.mu = (self.mu * (1.0 - (2.0 * gain - 1.0).powi(3)).max(1.0 / 5.0)).max(1e-12);
                self.nu = 2.0;
                return Outcome::Lower((cost - trial_cost) / cost.max(1e-300));
            }
            if predicted <= tolerance * 1e-2 * cost {
                return Outcome::Ended;
            }
            self.dampen();
        }
        Outcome::Stuck
    }

    fn dampen(&mut self) {
        self.mu = (self.mu * self.nu).max(DAMPING);
        self.nu *= 2.0;
    }

    /// The parameters that can move: seen by the recording, and not pushed against a bound.
    fn free(&self, columns: &[Vec<f64>], gradient: &[f64]) -> Vec<usize> {
        let bounds = self.problem.bounds();
        let can_move = |&i: &usize| {
            let (x, (lo, hi)) = (self.point.theta[i], bounds[i]);
            let span = if lo.is_finite() && hi.is_finite() { hi - lo } else { x.abs().max(1e-12) };
            let edge = 1e-9 * span;
            let blocked = (x <= lo + edge && gradient[i] < 0.0) || (x >= hi - edge && gradient[i] > 0.0);
            !blocked && norm2(&columns[i]) > 0.0 && columns[i].iter().all(|x| x.is_finite())
        };
        (0..self.point.theta.len()).filter(can_move).collect()
    }

    /// The parameters after a scaled step of those that are free, within the bounds.
    fn moved(&self, free: &[usize], step: &[f64]) -> Vec<f64> {
        let bounds = self.problem.bounds();
        let mut trial = self.point.theta.clone();
        for (&i, s) in free.iter().zip(step) {
            trial[i] = (trial[i] + s / self.scale[i]).clamp(bounds[i].0, bounds[i].1);
        }
        trial
    }
}

impl Fit {
    /// Covariance of the parameters for a whitened noise of variance `variance`; parameters at a bound and unseen ones have zero rows.
    ///
    /// Column-major, `k` by `k`.
    pub fn covariance(&self, layout: &Layout, whitener: &Whitener, weights: Option<&[f64]>, variance: f64) -> Vec<f64> {
        let k = self.theta.len();
        let weighting = Weighting { layout, whitener, weights };
        let columns: Vec<Vec<f64>> = self.jacobian.iter().map(|c| weighting.apply(c)).collect();
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
        let whitener = Whitener::of(vec![NoiseModel::white(0.1)]);
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
        let whitener = Whitener::of(vec![NoiseModel::white(0.1)]);
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
        let whitener = Whitener::of(vec![NoiseModel::white(0.1)]);
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
