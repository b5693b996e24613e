//! The Jiles-Atherton operator: magnetisation by domain walls that bend and break free from pinning sites.
//!
//! Input field `H`, output magnetisation `M`; effective field `H_e = H + alpha M`, anhysteretic curve
//! `M_an = M_s (coth(H_e/a) - a/H_e)`, `M = c M_an + (1 - c) M_irr`, `dM_irr/dH_e = (M_an - M_irr)/(k sgn H')`, and 0 where that
//! is negative (walls do not move against the field). So `dM/dH = X/(1 - alpha X)` with
//! `X = (1 - c) dM_irr/dH_e + c dM_an/dH_e`. Rate-independent. Where `alpha X` reaches 1 the law would have the magnetisation
//! jump; the slope is then limited to 100 times X. References: Jiles and Atherton, J. Magn. Magn. Mater. 61 (1986) 48-60;
//! Jiles, Thoelke and Devine, IEEE Trans. Magn. 28 (1992) 27-35.

use crate::dahl::sign;
use crate::error::Check;
use crate::{Differential, ParameterError};

/// The parameters of a [`JilesAtherton`] operator.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JilesAthertonParameters {
    /// Saturation magnetisation, A/m.
    pub m_s: f64,
    /// Shape of the anhysteretic curve, A/m.
    pub a: f64,
    /// Coupling between domains.
    pub alpha: f64,
    /// Pinning: about the coercive field, A/m.
    pub k: f64,
    /// Reversible share, 0 to below 1.
    pub c: f64,
}

/// A Jiles-Atherton operator.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JilesAtherton {
    parameters: JilesAthertonParameters,
}

/// The least value that `1 - alpha X` is allowed to have.
const LEAST_DENOMINATOR: f64 = 0.01;

impl JilesAtherton {
    /// The operator with these parameters, demagnetised.
    ///
    /// # Errors
    /// `m_s`, `a` or `k` not above zero; `alpha` negative; `c` outside [0, 1); `alpha m_s` not below `3 a` (the anhysteretic
    /// curve would be multivalued).
    pub fn new(parameters: JilesAthertonParameters) -> Result<Self, ParameterError> {
        let JilesAthertonParameters { m_s, a, alpha, k, c } = parameters;
        let check = Check("jiles-atherton");
        check.positive("m_s", m_s)?;
        check.positive("a", a)?;
        check.not_negative("alpha", alpha)?;
        check.positive("k", k)?;
        check.require("c", c, (0.0..1.0).contains(&c), "0 or more and below 1")?;
        let coupled = alpha * m_s;
        check.require("alpha m_s", coupled, coupled < 3.0 * a, &format!("below 3 a = {}", 3.0 * a))?;
        Ok(Self { parameters })
    }

    /// `X` and the denominator `1 - alpha X` at magnetisation `m` and field `h` that rises (`direction` 1) or falls (-1).
    fn susceptibility(&self, m: f64, h: f64, direction: f64) -> (f64, f64) {
        let JilesAthertonParameters { m_s, a, alpha, k, c } = self.parameters;
        let x = (h + alpha * m) / a;
        let (value, slope) = langevin(x);
        let (anhysteretic, reversible) = (m_s * value, m_s / a * slope);
        let irreversible = (m - c * anhysteretic) / (1.0 - c);
        let moving = ((anhysteretic - irreversible) * direction / k).max(0.0);
        let total = (1.0 - c) * moving + c * reversible;
        (total, (1.0 - alpha * total).max(LEAST_DENOMINATOR))
    }
}

/// Langevin's function `coth x - 1/x` and its derivative; by series about 0, where the two parts cancel.
fn langevin(x: f64) -> (f64, f64) {
    if x.abs() < 0.1 {
        let s = x * x;
        let value = x * (1.0 / 3.0 - s * (1.0 / 45.0 - s * (2.0 / 945.0 - s / 4725.0)));
        let slope = 1.0 / 3.0 - s * (1.0 / 15.0 - s * (2.0 / 189.0 - s / 675.0));
        (value, slope)
    } else {
        let coth = 1.0 / x.tanh();
        // 1 - coth^2 cancels for large x, where it is -1/sinh^2 and vanishes.
        (coth - 1.0 / x, 1.0 / (x * x) - x.sinh().powi(-2))
    }
}

impl Differential<1> for JilesAtherton {
    fn initial(&self) -> [f64; 1] {
        [0.0]
    }

    fn derivative(&self, &[m]: &[f64; 1], h: f64, h_dot: f64) -> [f64; 1] {
        let (x, denominator) = self.susceptibility(m, h, sign(h_dot));
        [h_dot * x / denominator]
    }

    fn output(&self, &[m]: &[f64; 1], _: f64, _: f64) -> f64 {
        m
    }

    fn fastest_rate(&self, &[m]: &[f64; 1], h: f64, h_dot: f64) -> f64 {
        let (_, denominator) = self.susceptibility(m, h, sign(h_dot));
        2.0 * h_dot.abs() / (self.parameters.k * denominator * denominator)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Operator, Sampled};

    /// The steel of Jiles and Atherton's paper.
    const STEEL: JilesAthertonParameters =
        JilesAthertonParameters { m_s: 1.6e6, a: 1100.0, alpha: 1.6e-3, k: 400.0, c: 0.2 };

    #[test]
    fn langevin_series_and_formula_meet() {
        for x in [0.0999f64, 0.1001, -0.1001] {
            let (value, slope) = langevin(x);
            approx::assert_abs_diff_eq!(value, 1.0 / x.tanh() - 1.0 / x, epsilon = 1e-12);
            let h = 1e-4;
            approx::assert_abs_diff_eq!(slope, (langevin(x + h).0 - langevin(x - h).0) / (2.0 * h), epsilon = 1e-8);
        }
        let (value, slope) = langevin(800.0);
        assert!(value.is_finite() && slope.is_finite());
    }

    #[test]
    fn weak_pinning_gives_the_anhysteretic_curve() {
        // With k small the walls follow: M solves M = M_s L((H + alpha M)/a).
        let law = JilesAtherton::new(JilesAthertonParameters { alpha: 0.0, k: 1.0, c: 0.0, ..STEEL }).unwrap();
        let u: Vec<f64> = (0..=500).map(|n| 10.0 * f64::from(n)).collect();
        let y = Sampled::new(law, 1.0, 1).unwrap().run(&u);
        approx::assert_relative_eq!(y[500], 1.6e6 * langevin(5000.0 / 1100.0).0, max_relative = 1e-3);
    }

    #[test]
    fn the_major_loop_has_remanence_and_coercivity_of_the_size_of_k() {
        let h: Vec<f64> = (0..3000).map(|n| 5000.0 * (f64::from(n) * std::f64::consts::TAU / 1000.0).sin()).collect();
        let m = Sampled::new(JilesAtherton::new(STEEL).unwrap(), 1e-3, 2).unwrap().run(&h);
        // The last falling branch: from the peak at 2250 to the trough at 2750.
        let crossing = (2250..2750).find(|&n| m[n] > 0.0 && m[n + 1] <= 0.0).unwrap();
        let coercive = -h[crossing];
        assert!((200.0..800.0).contains(&coercive), "coercive field {coercive}");
        assert!(m[2500] > 0.1 * 1.6e6, "remanence {}", m[2500]);
        assert!(m.iter().all(|m| m.abs() < 1.6e6));
    }

    #[test]
    fn bad_parameters_are_refused() {
        for (parameters, expected) in [
            (JilesAthertonParameters { c: 1.0, ..STEEL }, "c must be 0 or more and below 1"),
            (JilesAthertonParameters { alpha: 0.01, ..STEEL }, "alpha m_s must be below 3 a = 3300"),
            (JilesAthertonParameters { k: 0.0, ..STEEL }, "k must be"),
        ] {
            let e = JilesAtherton::new(parameters).unwrap_err().to_string();
            assert!(e.contains(expected), "{e}");
        }
    }
}
