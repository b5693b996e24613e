//! Dahl friction: a force that bends over to the Coulomb level as the displacement goes on.
//!
//! `F' = sigma v |1 - (F/F_c) sgn v|^i sgn(1 - (F/F_c) sgn v)` with displacement `u` and velocity `v = u'`. Rate-independent;
//! `|F|` stays below `F_c`. For `i = 1` it is Bouc-Wen with `gamma = 0`, `n = 1`. Reference: Dahl, *A solid friction model*,
//! Aerospace Corporation TOR-158 (1968).

use crate::error::Check;
use crate::{Differential, ParameterError};

/// Dahl friction of exponent 1 and Coulomb force 1 after the input has moved by `du`, exactly: from its last force `f` towards the
/// direction's sign, over the travel `length` (above 0, in the input's unit). A NaN passes through.
#[inline]
pub fn dahl(f: f64, du: f64, length: f64) -> f64 {
    if du == 0.0 {
        return f;
    }
    let s = du.signum();
    s + (f - s) * (-du.abs() / length).exp()
}

/// Dahl friction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dahl {
    sigma: f64,
    f_c: f64,
    shape: f64,
}

impl Dahl {
    /// Friction with stiffness at rest `sigma`, Coulomb force `f_c` and exponent `shape` (1 is the common choice).
    ///
    /// # Errors
    /// A stiffness or force that is not above zero; a shape below 1 (the solution would not be unique).
    pub fn new(sigma: f64, f_c: f64, shape: f64) -> Result<Self, ParameterError> {
        let check = Check("dahl");
        check.positive("sigma", sigma)?;
        check.positive("f_c", f_c)?;
        check.require("shape", shape, shape.is_finite() && shape >= 1.0, "a finite number of 1 or more")?;
        Ok(Self { sigma, f_c, shape })
    }
}

impl Differential<1> for Dahl {
    fn initial(&self) -> [f64; 1] {
        [0.0]
    }

    #[inline]
    fn derivative(&self, &[force]: &[f64; 1], _: f64, u_dot: f64) -> [f64; 1] {
        let left = 1.0 - force / self.f_c * sign(u_dot);
        let bend = if self.shape == 1.0 { left } else { left.abs().powf(self.shape) * sign(left) };
        [self.sigma * u_dot * bend]
    }

    fn output(&self, &[force]: &[f64; 1], _: f64, _: f64) -> f64 {
        force
    }

    fn fastest_rate(&self, _: &[f64; 1], _: f64, u_dot: f64) -> f64 {
        // |1 - F/F_c sgn v| is at most 2, right after a reversal.
        self.sigma / self.f_c * u_dot.abs() * self.shape * 2f64.powf(self.shape - 1.0)
    }
}

/// -1, 0 or 1, and 0 at 0 (unlike `signum`).
#[inline]
pub(crate) fn sign(v: f64) -> f64 {
    if v > 0.0 {
        1.0
    } else if v < 0.0 {
        -1.0
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Operator, Sampled};

    #[test]
    fn loading_and_unloading_are_exponentials() {
        // i = 1: F = F_c (1 - exp(-sigma x/F_c)); from F0 downwards F = -F_c + (F0 + F_c) exp(-sigma x/F_c).
        let (sigma, f_c) = (4.0, 2.0f64);
        let op = Sampled::new(Dahl::new(sigma, f_c, 1.0).unwrap(), 1.0, 50).unwrap();
        let y = op.run(&[0.0, 0.3, 0.8, 0.1]);
        let up = |x: f64| f_c * (1.0 - (-sigma * x / f_c).exp());
        approx::assert_abs_diff_eq!(y[1], up(0.3), epsilon = 1e-7);
        approx::assert_abs_diff_eq!(y[2], up(0.8), epsilon = 1e-7);
        let down = -f_c + (up(0.8) + f_c) * (-sigma * 0.7 / f_c).exp();
        approx::assert_abs_diff_eq!(y[3], down, epsilon = 1e-6);
    }

    #[test]
    fn the_exact_step_is_the_differential_law_of_shape_one() {
        let inputs = [0.0, 0.3, 0.8, 0.1, 0.1, -0.9, 0.4];
        let law = Sampled::new(Dahl::new(1.0 / 0.7, 1.0, 1.0).unwrap(), 1.0, 200).unwrap().run(&inputs);
        let mut f = 0.0;
        for (pair, expected) in inputs.windows(2).zip(&law[1..]) {
            f = dahl(f, pair[1] - pair[0], 0.7);
            approx::assert_abs_diff_eq!(f, *expected, epsilon = 1e-8);
        }
    }

    #[test]
    fn shape_two_has_its_own_closed_form() {
        // i = 2 from rest: 1 - F/F_c = 1/(1 + sigma x/F_c).
        let op = Sampled::new(Dahl::new(4.0, 2.0, 2.0).unwrap(), 1.0, 50).unwrap();
        let y = op.run(&[0.0, 0.5, 3.0]);
        approx::assert_abs_diff_eq!(y[1], 2.0 * (1.0 - 1.0 / 2.0), epsilon = 1e-6);
        approx::assert_abs_diff_eq!(y[2], 2.0 * (1.0 - 1.0 / 7.0), epsilon = 1e-6);
    }

    #[test]
    fn a_huge_step_stays_below_the_coulomb_level() {
        for shape in [1.0, 2.0] {
            let op = Sampled::new(Dahl::new(1e4, 1.0, shape).unwrap(), 0.01, 1).unwrap();
            for y in op.run(&[0.0, 1.0, -1.0, 1.0]) {
                assert!(y.abs() <= 1.0 + 1e-9, "{y}");
            }
        }
    }

    #[test]
    fn bad_parameters_are_refused() {
        assert!(Dahl::new(0.0, 1.0, 1.0).is_err());
        assert!(Dahl::new(1.0, -1.0, 1.0).is_err());
        assert!(Dahl::new(1.0, 1.0, 0.5).is_err());
    }
}
