//! Filters run without delay: forward and backward, or with symmetric taps; the ends are continued by odd reflection.
//!
//! Odd reflection continues x about its end value (2 x[0] - x[k]), so that values and slopes do not jump. What lies within the reach of an end
//! rests on this invention.

use crate::chebyshev::Section;

/// Runs the sections forward and backward over `x`, which must be longer than `pad`; each pass starts in the steady state of its first value.
pub(crate) fn forward_backward(sections: &[Section], x: &[f64], pad: usize) -> Vec<f64> {
    let mut y = reflected(x, pad);
    for _ in 0..2 {
        run(sections, &mut y);
        y.reverse();
    }
    y[pad..pad + x.len()].to_vec()
}

/// The convolution of `x` with symmetric taps of odd number, at the samples `offset`, `offset + step`, ... of `x`.
pub(crate) fn symmetric(taps: &[f64], x: &[f64], offset: usize, step: usize) -> Vec<f64> {
    let half = taps.len() / 2;
    let wide = reflected(x, half);
    (offset..x.len()).step_by(step).map(|n| taps.iter().zip(&wide[n..]).map(|(t, x)| t * x).sum()).collect()
}

fn reflected(x: &[f64], pad: usize) -> Vec<f64> {
    let (Some(first), Some(last)) = (x.first(), x.last()) else { return Vec::new() };
    // A stretch shorter than the filter is reflected once and then held: there is nothing more to reflect.
    let at = |k: usize| k.min(x.len() - 1);
    let before = (1..=pad).rev().map(|k| 2.0 * first - x[at(k)]);
    let after = (1..=pad).map(|k| 2.0 * last - x[x.len() - 1 - at(k)]);
    before.chain(x.iter().copied()).chain(after).collect()
}

/// Runs the sections over `x` in place (transposed direct form II), from the steady state of a constant equal to `x[0]`.
fn run(sections: &[Section], x: &mut [f64]) {
    let Some(mut level) = x.first().copied() else { return };
    for s in sections {
        let out = s.gain_at_zero() * level;
        let mut second = s.b[2] * level - s.a[1] * out;
        let mut first = s.b[1] * level - s.a[0] * out + second;
        for v in x.iter_mut() {
            let y = s.b[0] * *v + first;
            first = s.b[1] * *v - s.a[0] * y + second;
            second = s.b[2] * *v - s.a[1] * y;
            *v = y;
        }
        level = out;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chebyshev::low_pass;

    #[test]
    fn a_sine_in_the_band_keeps_its_phase_and_a_constant_its_value() {
        let sections = low_pass(4, 0.05, 0.2);
        let x: Vec<f64> = (0..2000).map(|n| (0.05 * n as f64).sin()).collect();
        let y = forward_backward(&sections, &x, 24);
        let ratio = y[1000] / x[1000];
        for n in 600..1400 {
            assert!((y[n] - ratio * x[n]).abs() < 1e-8, "no phase at {n}");
        }
        assert!((0.988..=1.0 + 1e-12).contains(&ratio), "twice the ripple at most: {ratio}");
        let flat = forward_backward(&sections, &[2.5; 200], 24);
        assert!(flat.iter().all(|y| (y / 2.5 - 10_f64.powf(-0.05 / 10.0)).abs() < 1e-12));
    }
}
