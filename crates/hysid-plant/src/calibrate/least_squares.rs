//! Nonlinear least squares within bounds: Levenberg-Marquardt on the free variables, steps projected onto the box.
//!
//! Works on the normal equations, so that no Jacobian is stored; the damping is scaled by their diagonal, which makes the
//! steps independent of the variables' units. A variable at a bound whose gradient points outwards is held for that step.
//! The damping follows Nielsen (1999), IMM-REP-1999-05. (The MINPACK port has no bounds, and transformations that put them in
//! flatten the objective near a bound, which is where calibrations with concealed physics end.)

use nalgebra::{DMatrix, DVector};

/// Half the sum of squares at a point, its gradient and its Gauss-Newton Hessian (by columns).
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Normal {
    pub cost: f64,
    pub gradient: Vec<f64>,
    pub hessian: Vec<f64>,
}

impl Normal {
    pub fn zero(n: usize) -> Self {
        Self { cost: 0.0, gradient: vec![0.0; n], hessian: vec![0.0; n * n] }
    }

    /// Adds residuals `e` whose derivatives by variable `index[k]` are `columns[k]`.
    pub fn add(&mut self, e: &[f64], columns: &[&[f64]], index: &[usize]) {
        let n = self.gradient.len();
        let dot = |a: &[f64], b: &[f64]| hysid_linalg::dot(a, b);
        self.cost += 0.5 * dot(e, e);
        for (k, (&i, a)) in index.iter().zip(columns).enumerate() {
            self.gradient[i] += dot(a, e);
            for (&j, b) in index.iter().zip(columns).take(k + 1) {
                let h = dot(a, b);
                self.hessian[i + j * n] += h;
                if i != j {
                    self.hessian[j + i * n] += h;
                }
            }
        }
    }
}

/// When to stop.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Limits {
    pub iterations: usize,
    /// Least relative decrease of the cost that counts.
    pub tolerance: f64,
}

/// Where a minimisation ended.
#[derive(Debug, Clone)]
pub(crate) struct Minimum {
    pub p: Vec<f64>,
    pub normal: Normal,
    pub converged: bool,
}

/// Minimises from `p` within `lower` and `upper`; `None` where the start cannot be evaluated.
pub(crate) fn minimise(
    p: &[f64],
    lower: &[f64],
    upper: &[f64],
    limits: Limits,
    mut evaluate: impl FnMut(&[f64]) -> Option<Normal>,
) -> Option<Minimum> {
    let n = p.len();
    let clamp = |p: &mut [f64]| {
        for ((p, lo), hi) in p.iter_mut().zip(lower).zip(upper) {
            *p = p.max(*lo).min(*hi);
        }
    };
    let mut p = p.to_vec();
    clamp(&mut p);
    let mut normal = evaluate(&p)?;
    let (mut damping, mut growth) = (1e-3, 2.0);
    let (mut evaluations, mut converged, mut quiet) = (1, n == 0, 0);
    while evaluations < limits.iterations && !converged {
        let free: Vec<usize> = (0..n)
            .filter(|&i| {
                let g = normal.gradient[i];
                !((p[i] <= lower[i] && g > 0.0) || (p[i] >= upper[i] && g < 0.0))
            })
            .collect();
        if free.is_empty() {
            converged = true;
            break;
        }
        let h = |i: usize, j: usize| normal.hessian[i + j * n];
        let scale: Vec<f64> = free.iter().map(|&i| if h(i, i) > 0.0 { h(i, i).sqrt() } else { 1.0 }).collect();
        let m = free.len();
        // Scaled to a unit diagonal.
        let system = DMatrix::from_fn(m, m, |a, b| {
            let value = h(free[a], free[b]) / (scale[a] * scale[b]);
            if a == b { value.max(1e-30) + damping } else { value }
        });
        let right = DVector::from_fn(m, |a, _| -normal.gradient[free[a]] / scale[a]);
        let step = system.cholesky().map(|c| c.solve(&right)).filter(|s| s.iter().all(|x| x.is_finite()));
        let mut tried = p.clone();
        let Some(step) = step else {
            damping = (damping * growth).max(1e-12);
            growth *= 2.0;
            evaluations += 1;
            continue;
        };
        for (a, &i) in free.iter().enumerate() {
            tried[i] += step[a] / scale[a];
        }
        clamp(&mut tried);
        let delta: Vec<f64> = tried.iter().zip(&p).map(|(t, p)| t - p).collect();
        let mut predicted = 0.0;
        for i in 0..n {
            predicted -= delta[i] * normal.gradient[i];
            for j in 0..n {
                predicted -= 0.5 * delta[i] * h(i, j) * delta[j];
            }
        }
        if predicted <= limits.tolerance * 1e-3 * normal.cost {
            converged = true;
            break;
        }
        let next = evaluate(&tried).filter(|n| n.cost.is_finite());
        evaluations += 1;
        match next {
            Some(next) if next.cost < normal.cost => {
                let gain = (normal.cost - next.cost) / predicted;
                let relative = (normal.cost - next.cost) / normal.cost.max(f64::MIN_POSITIVE);
                quiet = if relative < limits.tolerance { quiet + 1 } else { 0 };
                converged = quiet >= 2 || next.cost == 0.0;
                p = tried;
                normal = next;
                damping = (damping * (1.0 - (2.0 * gain - 1.0).powi(3)).clamp(0.1, 2.0)).max(1e-12);
                growth = 2.0;
            }
            _ => {
                if predicted < limits.tolerance * normal.cost || damping > 1e12 {
                    converged = true;
                }
                damping *= growth;
                growth *= 2.0;
            }
        }
    }
    Some(Minimum { p, normal, converged })
}
