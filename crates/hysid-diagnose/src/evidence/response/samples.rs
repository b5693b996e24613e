//! Plants and noises that the tests of process noise share.

use nalgebra::{DMatrix, DVector};
use rand_distr::{Distribution, StandardNormal};

use super::{Colours, Course, ForcePath};

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

/// An oscillator whose stiffness, drive and output go up and down, through `n` rows.
pub fn swaying(n: usize) -> Course {
    let rows = (0..n).flat_map(|k| {
        let s = (0.3 * k as f64).sin();
        [0.9, 0.2 + 0.1 * s, -0.3 - 0.2 * s, 0.85, 0.02, 0.1 + 0.08 * s, 1.0 + 0.7 * s, 0.1]
    });
    Course::new(2, vec![rows.collect()]).unwrap()
}

/// The mean of that.
pub fn still() -> ForcePath {
    let (a, b) = (DMatrix::from_row_slice(2, 2, &[0.9, 0.2, -0.3, 0.85]), DVector::from_vec(vec![0.02, 0.1]));
    ForcePath { entry: 1, a, b, c: DVector::from_vec(vec![1.0, 0.1]), course: None }
}

/// How each of `n` rows of the output answers to a unit force at each.
pub fn answers(path: &ForcePath, n: usize) -> DMatrix<f64> {
    let steps: Vec<(DMatrix<f64>, DVector<f64>, DVector<f64>)> = match &path.course {
        Some(course) => {
            let m = course.states;
            let matrices = course.steps(0).map(|(a, b, c)| {
                (DMatrix::from_row_slice(m, m, a), DVector::from_row_slice(b), DVector::from_row_slice(c))
            });
            matrices.collect()
        }
        None => vec![(path.a.clone(), path.b.clone(), path.c.clone()); n],
    };
    let mut all = DMatrix::zeros(n, n);
    for at in 0..n {
        let mut x = DVector::zeros(steps[0].1.len());
        for (row, (a, b, c)) in steps.iter().enumerate() {
            all[(row, at)] = c.dot(&x);
            x = a * x + b * if row == at { 1.0 } else { 0.0 };
        }
    }
    all
}

/// The covariance of `n` rows, written down: a force of this variance, whose answers these are, beside noise of the sensor with innovations of unit variance.
pub fn covariance(answers: &DMatrix<f64>, variance: f64, colours: Colours) -> DMatrix<f64> {
    let n = answers.nrows();
    let remembered =
        |pole: f64| {
            DMatrix::from_fn(n, n, |i, j| {
                if pole == 0.0 { f64::from(u8::from(i == j)) } else { pole.powi(i.abs_diff(j) as i32) }
            })
        };
    let sensor = remembered(colours.sensor) / (1.0 - colours.sensor * colours.sensor);
    sensor + answers * remembered(colours.force) * answers.transpose() * variance
}
