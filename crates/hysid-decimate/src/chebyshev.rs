//! Digital Chebyshev type I low-pass filters of even order as second-order sections.
//!
//! Analogue prototype, cut-off prewarped, bilinear transform. The squared gain is 1 / (1 + eps^2 T_n(x)^2) with
//! x = tan(w/2) / tan(w_c/2), T_n the Chebyshev polynomial and eps^2 = 10^(ripple/10) - 1; at the cut-off the gain is down by the ripple.

use std::f64::consts::PI;

/// One second-order section, b0 + b1/z + b2/z^2 over 1 + a1/z + a2/z^2.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Section {
    pub b: [f64; 3],
    pub a: [f64; 2],
}

impl Section {
    /// The gain at frequency 0.
    pub fn gain_at_zero(&self) -> f64 {
        self.b.iter().sum::<f64>() / (1.0 + self.a[0] + self.a[1])
    }
}

/// The sections of a low-pass of order 2 `pairs` with this ripple in dB; `cutoff` is a share of the Nyquist frequency, above 0 and below 1.
pub(crate) fn low_pass(pairs: usize, ripple_db: f64, cutoff: f64) -> Vec<Section> {
    let order = (2 * pairs) as f64;
    let eps = (10_f64.powf(ripple_db / 10.0) - 1.0).sqrt();
    let mu = (1.0 / eps).asinh() / order;
    let warped = (PI * cutoff / 2.0).tan();
    // An even order ripples below 1: the gain at frequency 0 is that of the ripple's bottom.
    let floor = (1.0 + eps * eps).sqrt().recip();
    (0..pairs)
        .map(|k| {
            let theta = PI * (2 * k + 1) as f64 / (2.0 * order);
            let (re, im) = (-warped * mu.sinh() * theta.sin(), warped * mu.cosh() * theta.cos());
            let square = re * re + im * im;
            // z = (1 + s)/(1 - s) maps s^2 - 2 re s + |p|^2 to this denominator, up to its leading coefficient.
            let leading = 1.0 - 2.0 * re + square;
            let a = [2.0 * (square - 1.0) / leading, (1.0 + 2.0 * re + square) / leading];
            let unit = square / leading * if k == 0 { floor } else { 1.0 };
            Section { b: [unit, 2.0 * unit, unit], a }
        })
        .collect()
}

/// The squared gain, in closed form, at `w` radians per sample.
pub(crate) fn squared_gain(order: u32, ripple_db: f64, cutoff: f64, w: f64) -> f64 {
    let x = (w / 2.0).tan() / (PI * cutoff / 2.0).tan();
    let n = f64::from(order);
    let t = if x.abs() <= 1.0 { (n * x.acos()).cos() } else { (n * x.abs().acosh()).cosh() };
    1.0 / (1.0 + (10_f64.powf(ripple_db / 10.0) - 1.0) * t * t)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gain_of(sections: &[Section], w: f64) -> f64 {
        let poly = |c: [f64; 3]| {
            let re = c[0] + c[1] * w.cos() + c[2] * (2.0 * w).cos();
            let im = c[1] * w.sin() + c[2] * (2.0 * w).sin();
            re * re + im * im
        };
        sections.iter().map(|s| poly(s.b) / poly([1.0, s.a[0], s.a[1]])).product()
    }

    #[test]
    fn the_gain_is_that_of_the_chebyshev_polynomial() {
        for cutoff in [0.4, 0.8 / 3.0, 0.08, 0.8 / 50.0] {
            let sections = low_pass(4, 0.05, cutoff);
            for i in 0..200 {
                let w = PI * (f64::from(i) + 0.5) / 200.0;
                let expected = squared_gain(8, 0.05, cutoff, w);
                let found = gain_of(&sections, w);
                assert!(
                    (found - expected).abs() < 1e-9 * (1.0 + expected) + 1e-6 * expected,
                    "{cutoff} {w}: {found} {expected}"
                );
            }
            let at_zero: f64 = sections.iter().map(Section::gain_at_zero).product();
            assert!((at_zero - 10_f64.powf(-0.05 / 20.0)).abs() < 1e-9);
        }
    }
}
