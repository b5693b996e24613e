//! Plants and noises that the tests of process noise share.

use nalgebra::DVector;
use rand_distr::{Distribution, StandardNormal};

use super::ForcePath;

pub const PERIOD: f64 = 0.02;
/// Natural frequency in rad/s, damping ratio.
pub const PLANT: (f64, f64) = (12.0, 0.05);

/// `x' = v`, `v' = -w^2 x - 2 z w v + force`, `y = x`, and a state that nothing sees.
pub fn oscillator() -> ForcePath {
    let (w, z) = PLANT;
    let a = [0.0, 1.0, 0.0, -w * w, -2.0 * z * w, 0.0, 0.0, 1.0, 0.0];
    ForcePath::held(&a, 1, &[1.0, 0.0, 0.0], PERIOD).unwrap()
}

pub fn integrator() -> ForcePath {
    ForcePath::held(&[0.0, 1.0, 0.0, -0.5], 1, &[1.0, 0.0], PERIOD).unwrap()
}

pub fn white(n: usize, seed: u64) -> Vec<f64> {
    let mut rng = crate::random::generator(seed, 11);
    (0..n).map(|_| StandardNormal.sample(&mut rng)).collect()
}

/// Process noise as the path's own equations make it, beside white noise of unit variance.
pub fn simulated(path: &ForcePath, force: &[f64], size: f64, seed: u64) -> Vec<f64> {
    let mut x = DVector::zeros(path.c.len());
    let sensor = white(force.len(), seed);
    force
        .iter()
        .zip(sensor)
        .map(|(w, e)| {
            let y = path.c.dot(&x) + e;
            x = &path.a * &x + &path.b * (size * w);
            y
        })
        .collect()
}

pub fn autoregressive(n: usize, pole: f64, seed: u64) -> Vec<f64> {
    let mut last = 0.0;
    white(n, seed)
        .into_iter()
        .map(|e| {
            last = pole * last + (1.0f64 - pole * pole).sqrt() * e;
            last
        })
        .collect()
}
