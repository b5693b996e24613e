//! Estimation against known truth: refinement, growth, extended least squares, resting points.

use crate::common::coefficients;
use hysid_dictionary::{Record, Signals, Term};
use hysid_narx::{Evaluate, Fit, NarxModel, Parts, Refine, Trainer, Window};

fn noise(n: usize, seed: u64) -> Vec<f64> {
    let mut x = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    let mut uniform = move || {
        x ^= x << 13;
        x ^= x >> 7;
        x ^= x << 17;
        (x >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    };
    // Sum of twelve: near enough to normal, variance 1.
    (0..n).map(|_| (0..12).map(|_| uniform()).sum()).collect()
}

fn terms(signals: &Signals, texts: &[&str]) -> Vec<Term> {
    texts.iter().map(|t| signals.parse(t).unwrap()).collect()
}

fn all(n: usize) -> Vec<Window> {
    vec![Window { record: 0, range: 0..n }]
}

/// A Duffing-like system, clean.
fn duffing(u: &[f64]) -> Vec<f64> {
    let mut y = vec![0.0f64; u.len()];
    for n in 2..u.len() {
        y[n] = 1.5 * y[n - 1] - 0.9 * y[n - 2] - 0.1 * y[n - 1].powi(3) + 0.2 * u[n - 1];
    }
    y
}

#[test]
fn refinement_undoes_the_bias_of_least_squares_under_output_noise() {
    let n = 3000;
    let u = noise(n, 1);
    let y: Vec<f64> = duffing(&u).iter().zip(noise(n, 2)).map(|(y, e)| y + 0.1 * e).collect();
    let signals = Signals::siso();
    let list = terms(&signals, &["y[n-1]", "y[n-2]", "y[n-1]^3", "u[n-1]"]);
    let mut trainer = Trainer::new(signals, vec![], &[Record::siso(&u, &y)], 2, 100.0).unwrap();
    let ls = trainer.least_squares(&list, &all(n)).unwrap();
    let truth = [1.5, -0.9, -0.1, 0.2];
    let off = |theta: &[f64]| theta.iter().zip(truth).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let (fit, error) = trainer.refine(ls.clone(), &all(n), 30, Refine::Coefficients).unwrap();
    assert!(off(&ls.theta) > 0.04, "{:?}", ls.theta);
    assert!(off(&fit.theta) < 0.02 && off(&fit.theta) < 0.4 * off(&ls.theta), "{:?} {:?}", fit.theta, ls.theta);
    assert!((error.rmse - 0.1).abs() < 0.005, "{}", error.rmse);
    // The standard errors cover the truth.
    let se = trainer.standard_errors(&fit, &all(n)).unwrap();
    for ((t, b), s) in fit.theta.iter().zip(truth).zip(se) {
        assert!((t - b).abs() < 4.0 * s && s < 0.05, "{t} {b} {s}");
    }
}

#[test]
fn the_next_term_is_the_one_that_is_missing() {
    let n = 2000;
    let u = noise(n, 3);
    let y = duffing(&u);
    let signals = Signals::siso();
    let start = terms(&signals, &["1", "y[n-1]", "y[n-2]", "u[n-1]"]);
    let candidates = terms(
        &signals,
        &["y[n-1]^2", "y[n-2]^3", "y[n-1]^3", "u[n-1]^3", "y[n-1]*u[n-1]", "y[n-1]^2*u[n-1]", "u[n-2]"],
    );
    let mut trainer = Trainer::new(signals, vec![], &[Record::siso(&u, &y)], 2, 100.0).unwrap();
    let fit = trainer.least_squares(&start, &all(n)).unwrap();
    let (fit, before) = trainer.refine(fit, &all(n), 30, Refine::Coefficients).unwrap();
    let gains = trainer.next_terms(&fit, &candidates, &all(n), 2, Evaluate::Recorded).unwrap();
    assert_eq!(gains[0].candidate, 2, "{gains:?}");
    let mut longer = fit;
    longer.terms.push(candidates[2].clone());
    longer.theta.push(0.0);
    let (longer, after) = trainer.refine(longer, &all(n), 50, Refine::Coefficients).unwrap();
    assert!(after.rmse < 1e-6 && before.rmse > 0.01, "{} {}", before.rmse, after.rmse);
    // The constant is what it can do without; the cube is not.
    let need = trainer.need_of_terms(&longer, &all(n)).unwrap();
    assert!(need[4] > 1e3 * need[0].abs(), "{need:?}");
    // ERR sums to the explained share.
    let err = trainer.error_reduction(&longer.terms, &all(n)).unwrap();
    assert!((err.iter().sum::<f64>() - 1.0).abs() < 1e-9, "{err:?}");
}

#[test]
fn noise_terms_beside_a_fixed_process_find_the_colour_of_its_residual() {
    // White noise on the output of a linear system: the one-step residual is e[n] - 0.8 e[n-1].
    let n = 20_000;
    let (u, e) = (noise(n, 15), noise(n, 16));
    let mut clean = vec![0.0; n];
    for k in 1..n {
        clean[k] = 0.8 * clean[k - 1] + u[k];
    }
    let y: Vec<f64> = clean.iter().zip(&e).map(|(y, e)| y + 0.5 * e).collect();
    let signals = Signals::siso();
    let fit = Fit { terms: terms(&signals, &["y[n-1]", "u[n]"]), theta: vec![0.8, 1.0], derived: vec![] };
    let mut trainer = Trainer::new(signals.clone(), vec![], &[Record::siso(&u, &y)], 1, 1e3).unwrap();
    let found = trainer.noise_terms(&fit, &[(Term::constant(), 1), (Term::constant(), 2)], &all(n)).unwrap();
    assert!((found[0].theta + 0.8).abs() < 0.03 && found[1].theta.abs() < 0.03, "{found:?}");
}

#[test]
fn extended_least_squares_finds_the_colour_of_the_noise() {
    let n = 20_000;
    let (u, e) = (noise(n, 5), noise(n, 6));
    let mut y = vec![0.0; n];
    for i in 1..n {
        y[i] = 0.8 * y[i - 1] + u[i - 1] + 0.3 * (e[i] + 0.7 * e[i - 1]);
    }
    let signals = Signals::siso();
    let list = terms(&signals, &["y[n-1]", "u[n-1]"]);
    let trainer = Trainer::new(signals, vec![], &[Record::siso(&u, &y)], 2, 1e6).unwrap();
    let plain = trainer.least_squares(&list, &all(n)).unwrap();
    let found = trainer.extended_least_squares(&list, &[(Term::constant(), 1)], &all(n)).unwrap();
    assert!((plain.theta[0] - 0.8).abs() > 0.015, "{:?}", plain.theta);
    assert!((found.fit.theta[0] - 0.8).abs() < 0.006, "{:?}", found.fit.theta);
    assert!((found.noise[0].theta - 0.7).abs() < 0.03, "{:?}", found.noise);
    assert!((found.variance / 0.09 - 1.0).abs() < 0.05, "{}", found.variance);
    assert!(found.settled);
    assert!(trainer.extended_least_squares(&list, &[(Term::constant(), 0)], &all(n)).is_err());
}

fn model(texts: &[(&str, f64)]) -> NarxModel {
    let signals = Signals::siso();
    let coefficients = coefficients(&signals, texts, f64::NAN);
    let (derived, noise) = (vec![], vec![]);
    NarxModel::new(Parts { signals, derived, coefficients, noise, limit: 10.0, period_s: None, decimation: 1 }).unwrap()
}

#[test]
fn resting_points_and_their_stability() {
    // y = 1.5 y - 0.5 y^3 + u: at u = 0 the roots are 0 (slope 1.5, unstable) and -1, 1 (slope 0).
    let m = model(&[("y[n-1]", 1.5), ("y[n-1]^3", -0.5), ("u[n]", 1.0)]);
    let rest = m.equilibria(&[0.0], -3.0, 3.1).unwrap();
    let expected = [(-1.0, true), (0.0, false), (1.0, true)];
    assert_eq!(rest.len(), 3, "{rest:?}");
    for (r, (y, stable)) in rest.iter().zip(expected) {
        assert!((r.y - y).abs() < 1e-9 && r.stable == stable, "{rest:?}");
    }
    assert_eq!(m.equilibria(&[2.0], -3.0, 3.1).unwrap().len(), 1);
    assert!(m.equilibria(&[], -1.0, 1.0).is_err());
}

#[test]
fn the_static_loop_of_a_bistable_model_is_open_and_of_a_linear_one_closed() {
    let area = |m: &NarxModel| {
        let l = m.static_loop(0, &[0.0], -0.6, 0.6, 2000).unwrap();
        assert_eq!(l.diverged_at, None);
        let pairs: Vec<(f64, f64)> = l.u.iter().zip(&l.y).skip(1002).map(|(u, y)| (*u, *y)).collect();
        pairs.windows(2).map(|w| 0.5 * (w[0].1 + w[1].1) * (w[1].0 - w[0].0)).sum::<f64>().abs()
    };
    assert!(area(&model(&[("y[n-1]", 1.5), ("y[n-1]^3", -0.5), ("u[n]", 1.0)])) > 0.4);
    assert!(area(&model(&[("y[n-1]", 0.5), ("u[n]", 1.0)])) < 0.01);
    assert!(model(&[("u[n]", 1.0)]).static_loop(1, &[0.0], 0.0, 1.0, 10).is_err());
}
