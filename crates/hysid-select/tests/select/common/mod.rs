//! The known systems that selection is tried on: an 11-term polynomial NARX model and an oversampled Bouc-Wen oscillator.

use std::ops::Range;

use hysid_dictionary::{Design, Signals, Term};
use hysid_linalg::{Columns, Gram, Matrix, Start};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// The terms of the known system.
pub const TRUTH: [(f64, &str); 11] = [
    (0.05, "1"),
    (0.55, "y[n-1]"),
    (-0.20, "y[n-2]"),
    (0.60, "u[n-1]"),
    (0.25, "u[n-2]"),
    (0.15, "u[n-1]^2"),
    (-0.20, "y[n-1]*u[n-2]"),
    (0.12, "u[n-1]*u[n-3]"),
    (-0.10, "y[n-1]^3"),
    (0.18, "y[n-2]*u[n-1]*u[n-2]"),
    (-0.15, "u[n-2]^2*u[n-3]"),
];

/// The terms of the known system as terms, sorted.
pub fn true_terms() -> Vec<Term> {
    let mut terms: Vec<Term> = TRUTH.iter().map(|(_, t)| Signals::siso().parse(t).unwrap()).collect();
    terms.sort();
    terms
}

/// Input (white, uniform on -1 to 1) and output of the known system, with equation noise of this standard deviation.
pub fn narx(n: usize, seed: u64, noise: f64) -> (Vec<f64>, Vec<f64>) {
    let mut rng = Pcg64::seed_from_u64(seed);
    let u: Vec<f64> = (0..n).map(|_| rng.random_range(-1.0..1.0)).collect();
    let mut y = vec![0.0; n];
    for k in 3..n {
        let (y1, y2, u1, u2, u3) = (y[k - 1], y[k - 2], u[k - 1], u[k - 2], u[k - 3]);
        // The sum of twelve uniforms is normal enough for a test.
        let e: f64 = (0..12).map(|_| rng.random_range(-0.5..0.5)).sum();
        y[k] = 0.05 + 0.55 * y1 - 0.20 * y2 + 0.60 * u1 + 0.25 * u2 + 0.15 * u1 * u1 - 0.20 * y1 * u2 + 0.12 * u1 * u3
            - 0.10 * y1 * y1 * y1
            + 0.18 * u1 * u2 * y2
            - 0.15 * u2 * u2 * u3
            + noise * e;
    }
    (u, y)
}

/// Input and output of a Bouc-Wen hysteresis sampled at 1 ms: columns so alike that their condition number is near 1e14.
pub fn boucwen(n: usize) -> (Vec<f64>, Vec<f64>) {
    let (d, a, b, g, dt) = (1.6, 0.9, 0.08, 0.02, 1e-3);
    let sines = [(1.3, 0.2), (2.9, 1.1), (4.7, 2.5), (6.1, 4.0), (7.7, 5.2)];
    let input = |t: f64| {
        let envelope = 1.0 + 0.6 * (2.0 * std::f64::consts::PI * 0.17 * t).sin();
        5.0 * envelope * sines.iter().map(|(f, p)| (2.0 * std::f64::consts::PI * f * t + p).sin()).sum::<f64>()
    };
    let rate = |t: f64| (input(t + 1e-5) - input(t - 1e-5)) / 2e-5;
    let slope = |v: f64, z: f64| a * v - b * v.abs() * z - g * v * z.abs();
    let (mut h, mut u, mut y) = (0.0, Vec::new(), Vec::new());
    for k in 0..n {
        let t = k as f64 * dt;
        u.push(input(t));
        y.push(d * input(t) - h);
        let (v0, vm, v1) = (rate(t), rate(t + dt / 2.0), rate(t + dt));
        let k1 = slope(v0, h);
        let k2 = slope(vm, h + dt / 2.0 * k1);
        let k3 = slope(vm, h + dt / 2.0 * k2);
        let k4 = slope(v1, h + dt * k3);
        h += dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
    }
    (u, y)
}

/// How a design gives its inner products, whatever would be cheaper.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Way {
    /// Columns of the Gram matrix as they are asked for.
    Apart,
    /// All in one pass.
    Whole,
}

/// A design that gives its inner products in one way.
pub struct By<'a>(pub Way, pub &'a Design<'a>);

impl Columns for By<'_> {
    fn rows(&self) -> usize {
        self.1.rows()
    }

    fn cols(&self) -> usize {
        self.1.cols()
    }

    fn fill(&self, j: usize, rows: Range<usize>, out: &mut [f64]) {
        self.1.fill(j, rows, out);
    }

    fn start(&self, y: &[f64]) -> Start {
        assert_eq!(self.0, Way::Apart);
        self.1.start(y)
    }

    fn gram_columns(&self, which: &[usize]) -> Matrix {
        assert_eq!(self.0, Way::Apart);
        self.1.gram_columns(which)
    }

    fn gram(&self, y: &[f64], _: usize) -> Option<Gram> {
        match self.0 {
            Way::Apart => None,
            Way::Whole => self.1.gram(y, usize::MAX),
        }
    }
}
