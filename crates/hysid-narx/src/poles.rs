//! The poles of a linear recursion, as real factors, and their product.

use nalgebra::{DMatrix, Schur};

/// Steps of the eigenvalue iteration allowed for each pole; a few are usual.
const STEPS_PER_POLE: usize = 100;

/// The monic real factors, of first and second order, of 1 + a_1 q^-1 + ... + a_k q^-k, each without its leading 1.
///
/// Ordered by the size of the pole, largest first; complex pairs make second-order factors. `None` where the poles cannot be found:
/// coefficients that are not finite, or numbers so small or so alike that the iteration for them does not end.
pub fn pole_factors(a: &[f64]) -> Option<Vec<Vec<f64>>> {
    let n = a.len();
    if n == 0 {
        return Some(Vec::new());
    }
    if a.iter().any(|v| !v.is_finite()) {
        return None;
    }
    let companion = DMatrix::from_fn(n, n, |i, j| match (i, j) {
        (0, j) => -a[j],
        (i, j) if i == j + 1 => 1.0,
        _ => 0.0,
    });
    let schur = Schur::try_new(companion, f64::EPSILON, STEPS_PER_POLE * n)?;
    let mut poles: Vec<(f64, f64)> = schur.complex_eigenvalues().iter().map(|p| (p.re, p.im)).collect();
    if poles.iter().any(|p| !(p.0.is_finite() && p.1.is_finite())) {
        return None;
    }
    poles
        .sort_by(|x, y| (y.0.hypot(y.1), y.1).partial_cmp(&(x.0.hypot(x.1), x.1)).unwrap_or(std::cmp::Ordering::Equal));
    let scale = poles.first().map_or(1.0, |p| p.0.hypot(p.1)).max(1e-12);
    let factors = poles.iter().filter_map(|&(re, im)| {
        if im.abs() <= 1e-7 * scale {
            Some(vec![-re])
        } else if im > 0.0 {
            Some(vec![-2.0 * re, re * re + im * im])
        } else {
            None
        }
    });
    Some(factors.collect())
}

/// The product of such factors, without its leading 1.
pub fn multiply_factors<'a>(factors: impl IntoIterator<Item = &'a Vec<f64>>) -> Vec<f64> {
    let mut product = vec![1.0];
    for f in factors {
        let mut next = vec![0.0; product.len() + f.len()];
        for (i, p) in product.iter().enumerate() {
            next[i] += p;
            for (j, c) in f.iter().enumerate() {
                next[i + j + 1] += p * c;
            }
        }
        product = next;
    }
    product.remove(0);
    product
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_iteration_that_does_not_end_is_given_up() {
        // Found by trying; with all coefficients 0, or so small that their products are, no step of the iteration changes anything.
        assert!(pole_factors(&[0.0; 3]).is_none());
        assert!(pole_factors(&[f64::NAN]).is_none());
        for a in [vec![0.0; 7], vec![-1e-320, 3e-321, 2e-320], vec![0.0, 0.0, 0.0, 1e-17], vec![1e300, -1e300, 1e300]] {
            // Nothing, or factors: but an answer.
            let factors = pole_factors(&a).unwrap_or_default();
            assert!(factors.iter().flatten().all(|c| c.is_finite()), "{a:?}");
        }
    }

    #[test]
    fn factors_multiply_back() {
        for factors in [
            vec![vec![-0.5]],
            vec![vec![-1.6, 0.9], vec![-0.3]],
            vec![vec![-1.2, 0.7], vec![0.4], vec![-0.9], vec![-0.1, 0.2]],
        ] {
            let a = multiply_factors(&factors);
            let found = pole_factors(&a).unwrap();
            assert_eq!(found.len(), factors.len());
            for (x, y) in multiply_factors(&found).iter().zip(&a) {
                assert!((x - y).abs() < 1e-9, "{x} {y}");
            }
        }
        assert!(pole_factors(&[]).unwrap().is_empty());
        assert!(multiply_factors(&[]).is_empty());
    }
}
