//! Refined instrumental variables against transfer functions that are known.

use hysid_signal::{Excitation, autoregressive_noise, white_noise};
use nalgebra::Complex;

use super::estimate::{Model, Record};
use super::filter::{Source, cascade, polynomial, roots};
use super::from_starts;
use super::structure::Structure;
use crate::document::Hold;

/// `s^2 + 2 zeta w s + w^2` and `gain w^2`, as a structure with the user's poles a factor off.
fn resonant(off: f64) -> Structure {
    let pole = Complex::new(-0.05, 1.0) * (8.0 * off);
    Structure { states: vec![0, 1], order: 2, integrators: 0, degrees: vec![Some(0)], poles: vec![pole, pole.conj()] }
}

fn steps(n: usize, seed: u64) -> Vec<f64> {
    Excitation::Steps { hold: 13 }.signal(n, 0.01, 1.0, seed).expect("valid")
}

/// The response of `b/a` to a series, by a fine Runge-Kutta of its own.
fn respond(a: &[f64], b: &[f64], u: &[f64], hold: Hold, period: f64, initial: &[f64]) -> Vec<f64> {
    let n = a.len();
    let mut x = initial.to_vec();
    let fine = 40;
    let h = period / f64::from(fine);
    let rate = |x: &[f64], u: f64| -> Vec<f64> {
        let last = u - a.iter().zip(x).map(|(a, x)| a * x).sum::<f64>();
        (0..n).map(|i| if i + 1 < n { x[i + 1] } else { last }).collect()
    };
    let mut y = Vec::new();
    for (k, now) in u.iter().enumerate() {
        y.push(b.iter().zip(&x).map(|(b, x)| b * x).sum());
        let slope = match hold {
            Hold::Zero => 0.0,
            Hold::Linear => (u.get(k + 1).unwrap_or(now) - now) / period,
        };
        for s in 0..fine {
            let at = |t: f64| now + slope * (h * f64::from(s) + t);
            let ahead = |k: &[f64], t: f64| -> Vec<f64> { x.iter().zip(k).map(|(x, k)| x + t * k).collect() };
            let k1 = rate(&x, at(0.0));
            let k2 = rate(&ahead(&k1, 0.5 * h), at(0.5 * h));
            let k3 = rate(&ahead(&k2, 0.5 * h), at(0.5 * h));
            let k4 = rate(&ahead(&k3, h), at(h));
            for i in 0..n {
                x[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
            }
        }
    }
    y
}

#[test]
fn filters_are_exact_under_both_holds() {
    let (a, b) = ([32.0, 17.2, 2.6], [3.0, 2.0, 0.5]);
    let u = steps(300, 4);
    for hold in [Hold::Zero, Hold::Linear] {
        let exact = respond(&a, &b, &u, hold, 0.05, &[0.0; 3]);
        let found = cascade(&a, &b, Source::Series(&u, hold), u.len(), 0.05).expect("finite");
        let behind = respond(&a, &[0.0, 1.0, 0.0], &u, hold, 0.05, &[0.0; 3]);
        for k in 0..u.len() {
            assert!((found.response[k] - exact[k]).abs() < 1e-7, "{hold:?} {k}");
            assert!((found.states[1][k] - behind[k]).abs() < 1e-7, "{hold:?} {k}");
        }
    }
}

#[test]
fn roots_and_polynomials_are_inverse() {
    let given = [Complex::new(-2.0, 0.0), Complex::new(-0.1, 3.0), Complex::new(-0.1, -3.0)];
    let a = polynomial(&given);
    assert!((a[0] - 18.02).abs() < 1e-12 && (a[2] - 2.2).abs() < 1e-12, "{a:?}");
    let found = roots(&a).expect("found");
    assert!(given.iter().all(|g| found.iter().any(|f| (f - g).norm() < 1e-9)), "{found:?}");
}

#[test]
fn a_clean_record_gives_the_coefficients() {
    let (a, b) = ([64.0, 0.8], [32.0]);
    for hold in [Hold::Zero, Hold::Linear] {
        for (off, initial) in [(1.0, [0.0, 0.0]), (10.0, [0.02, -0.1]), (0.1, [0.0, 0.0])] {
            let u = steps(400, 4);
            let mut y = respond(&a, &b, &u, hold, 0.03, &initial);
            // An offset, which the constant takes.
            y.iter_mut().for_each(|y| *y += 0.3);
            let record = Record { inputs: std::slice::from_ref(&u), output: &y, hold, period: 0.03 };
            let model = from_starts(&resonant(off), record).expect("identified");
            let found = [model.a[0], model.a[1], model.b[0][0]];
            for (found, truth) in found.iter().zip([64.0, 0.8, 32.0]) {
                assert!((found / truth - 1.0).abs() < 1e-6, "{hold:?}, start {off} off: {found} for {truth}");
            }
        }
    }
}

#[test]
fn an_integrating_plant_keeps_its_integrator() {
    let (a, b) = ([0.0, 2.5], [4.0]);
    let structure = Structure {
        states: vec![0, 1],
        order: 2,
        integrators: 1,
        degrees: vec![Some(0)],
        poles: vec![Complex::new(-20.0, 0.0)],
    };
    let u = steps(250, 8);
    let y = respond(&a, &b, &u, Hold::Zero, 0.02, &[0.4, 0.1]);
    let record = Record { inputs: std::slice::from_ref(&u), output: &y, hold: Hold::Zero, period: 0.02 };
    let model = from_starts(&structure, record).expect("identified");
    assert_eq!(model.a[0], 0.0);
    assert!((model.a[1] / 2.5 - 1.0).abs() < 1e-6 && (model.b[0][0] / 4.0 - 1.0).abs() < 1e-6, "{model:?}");
}

#[test]
fn two_inputs_with_a_feedthrough_are_told_apart() {
    let a = [9.0, 1.2];
    let structure = Structure { degrees: vec![Some(1), Some(2)], ..resonant(1.0) };
    let (u, v) = (steps(400, 3), white_noise(400, 1.0, 5).expect("valid"));
    let first = respond(&a, &[2.0, 5.0], &u, Hold::Zero, 0.05, &[0.0; 2]);
    // (s^2 + 3)/A = 1 + (3 - 9 - 1.2 s)/A.
    let second = respond(&a, &[-6.0, -1.2], &v, Hold::Zero, 0.05, &[0.0; 2]);
    let y: Vec<f64> = first.iter().zip(&second).zip(&v).map(|((a, b), v)| a + b + v).collect();
    let inputs = [u, v];
    let record = Record { inputs: &inputs, output: &y, hold: Hold::Zero, period: 0.05 };
    let model = from_starts(&structure, record).expect("identified");
    let found: Vec<f64> = model.a.iter().chain(model.b.iter().flatten()).copied().collect();
    for (found, truth) in found.iter().zip([9.0, 1.2, 2.0, 5.0, 3.0, 0.0, 1.0]) {
        assert!((found - truth).abs() < 1e-6, "{model:?}");
    }
}

/// Mean and standard error of a sample.
fn mean(all: &[f64]) -> (f64, f64) {
    let n = all.len() as f64;
    let mean = all.iter().sum::<f64>() / n;
    let variance = all.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean, (variance / n).sqrt())
}

#[test]
fn coloured_noise_leaves_no_bias_where_least_squares_have_one() {
    const SAMPLES: usize = 1500;
    let (a, b) = ([64.0, 1.6], [64.0]);
    let structure = resonant(1.0);
    let truth = Model::new(&structure, &structure.poles, true);
    let (mut refined, mut squares) = (Vec::new(), Vec::new());
    for seed in 0..40 {
        let u = steps(SAMPLES, 100 + seed);
        let mut y = respond(&a, &b, &u, Hold::Zero, 0.03, &[0.0; 2]);
        let power = y.iter().map(|y| y * y).sum::<f64>() / SAMPLES as f64;
        let noise = autoregressive_noise(&[0.8], SAMPLES, 0.1 * power, 500 + seed).expect("valid");
        y.iter_mut().zip(&noise).for_each(|(y, e)| *y += e);
        let record = Record { inputs: std::slice::from_ref(&u), output: &y, hold: Hold::Zero, period: 0.03 };
        let model = truth.refined(record, 30).expect("identified");
        refined.push(model.a[1]);
        // Least squares with the same filters, from the model that the instruments found.
        let (step, _) = model.regression(record).expect("finite").step(false).expect("solved");
        squares.push(model.a[1] + step[1]);
    }
    let ((refined, deviation), (squares, of_squares)) = (mean(&refined), mean(&squares));
    assert!((refined - 1.6).abs() < 3.0 * deviation, "{refined} +- {deviation}");
    assert!((squares - 1.6).abs() > 5.0 * of_squares, "{squares} +- {of_squares}");
}
