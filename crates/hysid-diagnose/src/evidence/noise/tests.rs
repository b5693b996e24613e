//! Noise models against noise whose spectrum is known.

use super::*;
use crate::evidence::norm2;
use hysid_signal::{fourier, inverse_fourier};
use nalgebra::DMatrix;
use rand_distr::{Distribution, StandardNormal};

fn white(n: usize, seed: u64) -> Vec<f64> {
    let mut rng = crate::random::generator(seed, 7);
    (0..n).map(|_| StandardNormal.sample(&mut rng)).collect()
}

/// Noise whose power goes as one over frequency, by shaping the lines of white noise; a quarter of what it was made of, so that its end and its beginning are
/// no neighbours.
fn pink(n: usize, seed: u64) -> Vec<f64> {
    let whole = 4 * n;
    let mut lines = fourier(&white(whole, seed));
    for (k, l) in lines.iter_mut().enumerate() {
        let a = (k.max(1) as f64 / whole as f64).powf(-0.5);
        *l = (l.0 * a, l.1 * a);
    }
    let mut e = inverse_fourier(&lines, whole);
    e.truncate(n);
    e
}

/// Power of the lowest lines of a whitened series over that of all.
fn lowest(m: &NoiseModel, e: &[f64]) -> f64 {
    let mut w = vec![0.0; e.len()];
    m.whiten(0, e, &mut w);
    let power: Vec<f64> = fourier(&w).iter().map(|(re, im)| (re * re + im * im) / e.len() as f64).collect();
    power[1..20].iter().sum::<f64>() / 19.0
}

#[test]
fn one_over_f_noise_is_white_down_to_the_lowest_lines() {
    for seed in 0..5 {
        let e = pink(4000, seed);
        let low = lowest(&NoiseModel::fit(&[&e], 16, &[]), &e);
        assert!((0.5..1.8).contains(&low), "{low}");
    }
}

#[test]
fn white_and_autoregressive_noise_need_no_shape() {
    let mut e = white(3000, 3);
    assert_eq!(NoiseModel::fit(&[&e], 16, &[]).coefficients(), 0);
    for n in 1..e.len() {
        e[n] += 0.9 * e[n - 1];
    }
    assert!(matches!(NoiseModel::fit(&[&e], 16, &[]).kind, Kind::Shaped(_, None)));
}

#[test]
fn an_offset_is_no_colour_of_the_noise() {
    let (n, offset) = (4000, 3.0);
    let mean = |w: &[f64]| w.iter().sum::<f64>() / w.len() as f64;
    for coefficient in [0.0, 0.9] {
        let mut e = white(n, 11);
        (1..n).for_each(|i| e[i] += coefficient * e[i - 1]);
        let raised: Vec<f64> = e.iter().map(|e| e + offset).collect();
        let m = NoiseModel::fit(&[&raised], 16, &[]);
        let without = NoiseModel::fit(&[&e], 16, &[]);
        assert_eq!(m.coefficients(), without.coefficients(), "coefficient {coefficient}");
        assert!((m.innovation() / without.innovation() - 1.0).abs() < 1e-9);
        assert_eq!(m.coefficients() == 0, coefficient == 0.0);
        let mut w = vec![0.0; n];
        m.whiten(0, &raised, &mut w);
        // Standard errors by which the mean stands out: its own size in white noise; under a colour the mean may hold more.
        let expected = offset * (1.0 - coefficient) * (n as f64).sqrt();
        let found = mean(&w) * (n as f64).sqrt();
        assert!(found > 0.25 * expected && found < 1.1 * expected, "{found} {expected}");
    }
}

#[test]
fn the_mean_of_noise_that_rises_is_no_error() {
    let left = |e: Vec<f64>| {
        let mut raised: Vec<f64> = e.iter().map(|x| x + 3.0 * (norm2(&e) / 4000.0).sqrt()).collect();
        let plain = norm2(&raised);
        NoiseModel::fit(&[&e], 16, &[]).discount_mean(&mut raised);
        norm2(&raised) / plain
    };
    assert!(left(pink(4000, 8)) < 0.4);
    assert_eq!(left(white(4000, 8)), 1.0);
}

#[test]
fn a_hole_at_the_lowest_lines_is_no_noise() {
    // What the courses of a walk take out of a residual.
    let mut lines = fourier(&white(3000, 6));
    for (k, line) in lines.iter_mut().enumerate().take(20) {
        let left = k as f64 / 20.0;
        *line = (line.0 * left, line.1 * left);
    }
    let m = NoiseModel::fit(&[&inverse_fourier(&lines, 3000)], 16, &[]);
    assert!(matches!(m.kind, Kind::Shaped(_, None)), "{m:?}");
}

#[test]
fn whitening_and_colouring_are_inverse_and_the_determinant_is_that_of_the_map() {
    let m = NoiseModel::fit(&[&pink(4000, 1)], 2, &[]);
    let Kind::Shaped(_, Some(shape)) = &m.kind else { panic!("a shape") };
    let e = pink(600, 2);
    let mut w = vec![0.0; 600];
    m.whiten(0, &e, &mut w);
    m.colour(0, &mut w);
    assert!(e.iter().zip(&w).all(|(a, b)| (a - b).abs() < 1e-9 * (1.0 + a.abs())));
    // The shape's determinant, column by column, on a short stretch.
    let n = 41;
    let columns: Vec<f64> = (0..n)
        .flat_map(|i| {
            let mut unit = vec![0.0; n];
            unit[i] = 1.0;
            shape.scale(&mut unit, 1.0);
            unit
        })
        .collect();
    let log = DMatrix::from_column_slice(n, n, &columns).lu().determinant().abs().ln();
    assert!((log - shape.log_scale(n)).abs() < 1e-9, "{log} {}", shape.log_scale(n));
}

#[test]
fn a_slow_mismatch_in_a_fast_recording_costs_likelihood() {
    // Sensor noise with and without a slow random wander, sampled far faster than it moves: the model without it must gain.
    let n = 8000;
    let e: Vec<f64> = white(n, 5);
    let mut slow = vec![0.0; n];
    for k in 1..12 {
        let phase = 1.7 * (k * k) as f64;
        for (i, s) in slow.iter_mut().enumerate() {
            *s += 20.0 * (std::f64::consts::TAU * k as f64 * i as f64 / n as f64 + phase).sin();
        }
    }
    let with: Vec<f64> = e.iter().zip(&slow).map(|(e, s)| e + s).collect();
    let likelihood = |e: &[f64]| {
        let m = NoiseModel::fit(&[e], 16, &[]);
        let mut w = vec![0.0; n];
        m.whiten(0, e, &mut w);
        -0.5 * norm2(&w) - m.log_scale(0, n)
    };
    assert!(likelihood(&e) > likelihood(&with) + 50.0, "{} {}", likelihood(&e), likelihood(&with));
}
