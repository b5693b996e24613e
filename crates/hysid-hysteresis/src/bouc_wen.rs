//! The Bouc-Wen operator, equation (2) of Zhang, Zhu and Gu (2017).
//!
//! `h' = A u' - beta |u'| |h|^(n-1) h - gamma u' |h|^n`, `y = direct u + hysteretic h`. A piezo actuator has `y = d u - h`; a
//! hysteretic spring `y = alpha k u + (1 - alpha) k h`. Rate-independent; neither wiping-out nor congruent (its known
//! shortcoming as physics). `|h|` tends to at most `(A/(beta + gamma))^(1/n)`.
//!
//! References: Bouc (1967); Wen, J. Eng. Mech. Div. ASCE 102 (1976) 249-263; Ikhouane and Rodellar, *Systems with Hysteresis*
//! (2007), for the classes; Erlicher and Point, C. R. Mecanique 332 (2004) 51-57, for the thermodynamic condition.

use crate::error::Check;
use crate::{Differential, ParameterError};

/// The parameters of a [`BoucWen`] operator.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoucWenParameters {
    /// Slope `dh/du` at `h = 0` (A).
    pub a: f64,
    /// Weight of `|u'| |h|^(n-1) h`.
    pub beta: f64,
    /// Weight of `u' |h|^n`.
    pub gamma: f64,
    /// Exponent: the larger, the sharper the knee.
    pub n: f64,
    /// Weight of the input in the output.
    pub direct: f64,
    /// Weight of `h` in the output.
    pub hysteretic: f64,
}

/// A Bouc-Wen operator whose parameters have been checked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoucWen {
    parameters: BoucWenParameters,
}

const NAME: &str = "bouc-wen";

impl BoucWen {
    /// An operator that keeps to thermodynamics: bounded, and dissipating in every cycle.
    ///
    /// # Errors
    /// Unless `a > 0`, `beta + gamma > 0`, `|gamma| <= beta` and `n >= 1`; a number that is not finite.
    pub fn new(parameters: BoucWenParameters) -> Result<Self, ParameterError> {
        let BoucWenParameters { beta, gamma, .. } = parameters;
        let this = Self::bounded(parameters)?;
        let what = format!("at most beta = {beta} in size, or a cycle could give off energy");
        Check(NAME).require("gamma", gamma, gamma.abs() <= beta, &what)?;
        Ok(this)
    }

    /// An operator that is bounded but may give off energy in some cycles, as fitted ones do (`gamma` above `beta`).
    ///
    /// # Errors
    /// Unless `a > 0`, `beta >= 0`, `beta + gamma > 0` and `n >= 1`; a number that is not finite.
    pub fn bounded(parameters: BoucWenParameters) -> Result<Self, ParameterError> {
        let BoucWenParameters { a, beta, gamma, n, direct, hysteretic } = parameters;
        let check = Check(NAME);
        check.positive("a", a)?;
        check.not_negative("beta", beta)?;
        check.finite("gamma", gamma)?;
        check.require("beta + gamma", beta + gamma, beta + gamma > 0.0, "above 0, or h is not bounded")?;
        check.require("n", n, n.is_finite() && n >= 1.0, "a finite number of 1 or more")?;
        check.finite("direct", direct)?;
        check.finite("hysteretic", hysteretic)?;
        Ok(Self { parameters })
    }

    /// A piezo actuator: `y = d u - h` with `n = 1`.
    ///
    /// # Errors
    /// As for [`Self::new`].
    pub fn piezo(d: f64, a: f64, beta: f64, gamma: f64) -> Result<Self, ParameterError> {
        Self::new(BoucWenParameters { a, beta, gamma, n: 1.0, direct: d, hysteretic: -1.0 })
    }

    /// The parameters.
    pub fn parameters(&self) -> &BoucWenParameters {
        &self.parameters
    }

    /// The value that `|h|` tends to where the input keeps rising: `(A/(beta + gamma))^(1/n)`.
    pub fn limit(&self) -> f64 {
        let BoucWenParameters { a, beta, gamma, n, .. } = self.parameters;
        (a / (beta + gamma)).powf(1.0 / n)
    }
}

/// `|h|^(n-1)`; the common exponents 1 and 2 cost no power function.
#[inline]
pub(crate) fn power_below(h: f64, n: f64) -> f64 {
    if n == 1.0 {
        1.0
    } else if n == 2.0 {
        h.abs()
    } else {
        h.abs().powf(n - 1.0)
    }
}

impl Differential<1> for BoucWen {
    fn initial(&self) -> [f64; 1] {
        [0.0]
    }

    #[inline]
    fn derivative(&self, &[h]: &[f64; 1], _: f64, u_dot: f64) -> [f64; 1] {
        let BoucWenParameters { a, beta, gamma, n, .. } = self.parameters;
        let (bend, skew) = (beta * u_dot.abs() * h, gamma * u_dot * h.abs());
        // The sums stand in the order of the shortest chain of operations from `h` to the result.
        if n == 1.0 { [a * u_dot - bend - skew] } else { [a * u_dot - power_below(h, n) * (bend + skew)] }
    }

    #[inline]
    fn output(&self, &[h]: &[f64; 1], u: f64, _: f64) -> f64 {
        self.parameters.direct * u + self.parameters.hysteretic * h
    }

    #[inline]
    fn fastest_rate(&self, &[h]: &[f64; 1], _: f64, u_dot: f64) -> f64 {
        let BoucWenParameters { beta, gamma, n, .. } = self.parameters;
        // Where h is still small a large step may take it to its limit at once.
        let p = if n == 1.0 { 1.0 } else { power_below(h.abs().max(self.limit()), n) };
        n * (beta + gamma.abs()) * p * u_dot.abs()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Operator, Sampled};

    /// Rising from rest with n = 1: `h = A/(beta + gamma) (1 - exp(-(beta + gamma) u))`.
    fn error(samples: u32) -> f64 {
        let law = BoucWen::piezo(0.0, 0.9, 0.5, 0.25).unwrap();
        let op = Sampled::new(law, 0.01, 1).unwrap();
        let u: Vec<f64> = (0..=samples).map(|n| 2.0 * f64::from(n) / f64::from(samples)).collect();
        let exact = -0.9 / 0.75 * (1.0 - (-0.75f64 * 2.0).exp());
        (op.run(&u)[samples as usize] - exact).abs()
    }

    #[test]
    fn it_converges_to_the_closed_form_with_order_four() {
        for samples in [4, 8, 16, 32] {
            let order = (error(samples) / error(2 * samples)).log2();
            assert!((3.8..4.3).contains(&order), "order {order} at {samples} samples");
        }
    }

    #[test]
    fn unloading_for_n_2_follows_its_closed_form() {
        // Rising with n = 2: h = hm tanh(u A/hm), hm = sqrt(A/(beta + gamma)); coming down above 0 with gamma = beta: slope A.
        let p = BoucWenParameters { a: 2.0, beta: 0.4, gamma: 0.4, n: 2.0, direct: 0.0, hysteretic: 1.0 };
        let law = BoucWen::new(p).unwrap();
        let hm = law.limit();
        let op = Sampled::new(law, 1.0, 20).unwrap();
        let y = op.run(&[0.0, 0.5, 1.0, 1.5, 1.25, 1.0]);
        for (y, u) in y.iter().zip([0.0f64, 0.5, 1.0, 1.5]) {
            approx::assert_abs_diff_eq!(*y, hm * (2.0 * u / hm).tanh(), epsilon = 1e-6);
        }
        approx::assert_abs_diff_eq!(y[5], y[3] - 1.0, epsilon = 1e-9);
    }

    #[test]
    fn a_huge_step_of_the_input_leads_to_the_limit() {
        for n in [1.0, 1.5, 2.0, 4.0] {
            let p = BoucWenParameters { a: 1.0, beta: 0.6, gamma: 0.4, n, direct: 0.0, hysteretic: 1.0 };
            let law = BoucWen::new(p).unwrap();
            let y = Sampled::new(law, 0.1, 1).unwrap().run(&[0.0, 1000.0, -1000.0]);
            approx::assert_relative_eq!(y[1], law.limit(), max_relative = 1e-6);
            approx::assert_relative_eq!(y[2], -law.limit(), max_relative = 1e-6);
        }
    }

    #[test]
    fn the_conditions_are_checked() {
        let good = BoucWenParameters { a: 1.0, beta: 0.5, gamma: 0.2, n: 1.0, direct: 1.0, hysteretic: 1.0 };
        let cases = [
            (BoucWenParameters { a: 0.0, ..good }, "a must be a finite number above 0"),
            (BoucWenParameters { beta: -0.1, ..good }, "beta must be a finite number of 0 or more"),
            (BoucWenParameters { gamma: -0.5, ..good }, "beta + gamma must be above 0"),
            (BoucWenParameters { gamma: 0.6, ..good }, "gamma must be at most beta = 0.5 in size"),
            (BoucWenParameters { n: 0.5, ..good }, "n must be a finite number of 1 or more"),
            (BoucWenParameters { direct: f64::NAN, ..good }, "direct must be a finite number"),
        ];
        for (parameters, expected) in cases {
            let e = BoucWen::new(parameters).unwrap_err().to_string();
            assert!(e.contains(expected), "{e}");
        }
        assert!(BoucWen::bounded(BoucWenParameters { gamma: 0.6, ..good }).is_ok());
    }
}
