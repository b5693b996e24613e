//! The discrete cosine transform: a signal in cosines of half periods, which its mirror image continues without a jump.
//!
//! A Fourier transform takes the end of a recording and its beginning for neighbours. Of what wanders they are none, and the jump between them spreads over
//! all lines; the lines of a cosine transform see no such jump. Reference: N. Ahmed, T. Natarajan, K. R. Rao, IEEE Trans. Comput. C-23 (1974) 90-93.

use std::cell::RefCell;

use rustdct::DctPlanner;

thread_local! {
    /// Plans by length.
    static PLANNER: RefCell<DctPlanner<f64>> = RefCell::new(DctPlanner::new());
}

/// The orthonormal cosine transform (of the second kind) of a signal, in place: line `k` of `N` samples has `k/(2 N)` cycles a sample, and the squares
/// of the lines sum to those of the samples.
pub fn cosine_transform(u: &mut [f64]) {
    if u.is_empty() {
        return;
    }
    PLANNER.with_borrow_mut(|p| p.plan_dct2(u.len())).process_dct2(u);
    let scale = (2.0 / u.len() as f64).sqrt();
    u.iter_mut().for_each(|x| *x *= scale);
    u[0] *= std::f64::consts::FRAC_1_SQRT_2;
}

/// The inverse of [`cosine_transform`], in place.
pub fn inverse_cosine_transform(lines: &mut [f64]) {
    if lines.is_empty() {
        return;
    }
    let scale = (2.0 / lines.len() as f64).sqrt();
    lines.iter_mut().for_each(|x| *x *= scale);
    lines[0] *= std::f64::consts::SQRT_2;
    PLANNER.with_borrow_mut(|p| p.plan_dct3(lines.len())).process_dct3(lines);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::white_noise;

    #[test]
    fn lines_are_sums_over_cosines_and_lead_back() {
        for n in [1, 2, 7, 64, 1001] {
            let u = white_noise(n, 1.0, 3).unwrap();
            let mut lines = u.clone();
            cosine_transform(&mut lines);
            for k in [0, 1, n / 3, n - 1].into_iter().filter(|k| *k < n) {
                let wave = |i: usize| (std::f64::consts::PI * k as f64 * (i as f64 + 0.5) / n as f64).cos();
                let norm: f64 = (0..n).map(|i| wave(i).powi(2)).sum::<f64>().sqrt();
                let direct = u.iter().enumerate().map(|(i, x)| x * wave(i)).sum::<f64>() / norm;
                assert!((lines[k] - direct).abs() < 1e-9, "{n} {k}: {} {direct}", lines[k]);
            }
            let energy = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>();
            assert!((energy(&lines) - energy(&u)).abs() < 1e-9 * energy(&u));
            inverse_cosine_transform(&mut lines);
            assert!(lines.iter().zip(&u).all(|(a, b)| (a - b).abs() < 1e-9), "{n}");
        }
    }

    #[test]
    fn nothing_has_no_lines() {
        let mut nothing: Vec<f64> = Vec::new();
        cosine_transform(&mut nothing);
        inverse_cosine_transform(&mut nothing);
        assert!(nothing.is_empty());
    }
}
