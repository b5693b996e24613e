//! The poles of a linear recursion, as real factors, and their product.

use nalgebra::DMatrix;

/// The monic real factors, of first and second order, of 1 + a_1 q^-1 + ... + a_k q^-k, each without its leading 1.
///
/// Ordered by the size of the pole, largest first; complex pairs make second-order factors.
pub fn pole_factors(a: &[f64]) -> Vec<Vec<f64>> {
    let n = a.len();
    if n == 0 || a.iter().any(|v| !v.is_finite()) {
        return Vec::new();
    }
    let companion = DMatrix::from_fn(n, n, |i, j| match (i, j) {
        (0, j) => -a[j],
        (i, j) if i == j + 1 => 1.0,
        _ => 0.0,
    });
    let mut poles: Vec<(f64, f64)> = companion.complex_eigenvalues().iter().map(|p| (p.re, p.im)).collect();
    poles
        .sort_by(|x, y| (y.0.hypot(y.1), y.1).partial_cmp(&(x.0.hypot(x.1), x.1)).unwrap_or(std::cmp::Ordering::Equal));
    let scale = poles.first().map_or(1.0, |p| p.0.hypot(p.1)).max(1e-12);
    poles
        .iter()
        .filter_map(|&(re, im)| {
            if im.abs() <= 1e-7 * scale {
                Some(vec![-re])
            } else if im > 0.0 {
                Some(vec![-2.0 * re, re * re + im * im])
            } else {
                None
            }
        })
        .collect()
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
    fn factors_multiply_back() {
        for factors in [
            vec![vec![-0.5]],
            vec![vec![-1.6, 0.9], vec![-0.3]],
            vec![vec![-1.2, 0.7], vec![0.4], vec![-0.9], vec![-0.1, 0.2]],
        ] {
            let a = multiply_factors(&factors);
            let found = pole_factors(&a);
            assert_eq!(found.len(), factors.len());
            for (x, y) in multiply_factors(&found).iter().zip(&a) {
                assert!((x - y).abs() < 1e-9, "{x} {y}");
            }
        }
        assert!(pole_factors(&[]).is_empty());
        assert!(multiply_factors(&[]).is_empty());
    }
}
