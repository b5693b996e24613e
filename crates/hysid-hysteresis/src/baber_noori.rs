//! The Baber-Noori operator: a Bouc-Wen spring that degrades and pinches as it dissipates energy.
//!
//! `z' = p(z, e) (A(e) u' - nu(e) (beta |u'| |z|^(n-1) z + gamma u' |z|^n))/eta(e)`, dissipated energy `e' = z u'`, force
//! `F = alpha k u + (1 - alpha) k z`, with `A = A0 - dA e`, `nu = 1 + dnu e`, `eta = 1 + deta e`. Pinching in the form of
//! Foliente: `p = 1 - zeta1 exp(-(z sgn(u') - q zu)^2/zeta2^2)`, `zu = (A/(nu (beta + gamma)))^(1/n)`,
//! `zeta1 = zeta_s (1 - exp(-p e))`, `zeta2 = (psi + dpsi e)(lambda + zeta1)`. Without degradation and pinching it is the
//! Bouc-Wen operator. References: Baber and Wen, J. Eng. Mech. Div. ASCE 107 (1981) 1069-1087; Baber and Noori, J. Eng. Mech.
//! 111 (1985) 1010-1026; Foliente, J. Struct. Eng. 121 (1995) 1013-1022.

use crate::bouc_wen::power_below;
use crate::error::Check;
use crate::{BoucWen, BoucWenParameters, Differential, ParameterError};

/// How a [`BaberNoori`] spring degrades with the energy `e` that it has dissipated.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Degradation {
    /// Loss of slope A per unit of `e`.
    pub delta_a: f64,
    /// Loss of strength: growth of nu per unit of `e`.
    pub delta_nu: f64,
    /// Loss of stiffness: growth of eta per unit of `e`.
    pub delta_eta: f64,
}

/// How a [`BaberNoori`] spring pinches.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pinching {
    /// Severity of the pinching when fully grown, 0 (none) to below 1 (zeta_s).
    pub severity: f64,
    /// How fast it grows with `e` (p).
    pub growth: f64,
    /// Where in the loop it is, as a fraction of the limit of `z` (q).
    pub position: f64,
    /// Width of the pinched region (psi).
    pub width: f64,
    /// Growth of the width with `e` (dpsi).
    pub delta_width: f64,
    /// How much of the width does not depend on the severity (lambda), above 0.
    pub lambda: f64,
}

impl Pinching {
    /// No pinching.
    pub const NONE: Self =
        Self { severity: 0.0, growth: 0.0, position: 0.0, width: 1.0, delta_width: 0.0, lambda: 1.0 };
}

/// A degrading, pinching hysteretic spring.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BaberNoori {
    loop_shape: BoucWenParameters,
    degradation: Degradation,
    pinching: Pinching,
}

impl BaberNoori {
    /// A spring with this loop (`direct` is `alpha k`, `hysteretic` is `(1 - alpha) k`), degradation and pinching.
    ///
    /// # Errors
    /// The loop breaks a condition of [`BoucWen::new`]; a degradation that is negative; a severity outside [0, 1); a width or
    /// lambda that is not above zero.
    pub fn new(
        loop_shape: BoucWenParameters,
        degradation: Degradation,
        pinching: Pinching,
    ) -> Result<Self, ParameterError> {
        const NAME: &str = "baber-noori";
        BoucWen::new(loop_shape).map_err(|e| ParameterError { operator: NAME, ..e })?;
        let check = Check(NAME);
        check.not_negative("delta_a", degradation.delta_a)?;
        check.not_negative("delta_nu", degradation.delta_nu)?;
        check.not_negative("delta_eta", degradation.delta_eta)?;
        let Pinching { severity, growth, position, width, delta_width, lambda } = pinching;
        check.require("severity", severity, (0.0..1.0).contains(&severity), "0 or more and below 1")?;
        check.not_negative("growth", growth)?;
        check.finite("position", position)?;
        check.positive("width", width)?;
        check.not_negative("delta_width", delta_width)?;
        check.positive("lambda", lambda)?;
        Ok(Self { loop_shape, degradation, pinching })
    }

    /// Slope A, strength nu and stiffness eta after the energy `e` has been dissipated; A does not fall below 0.
    fn degraded(&self, e: f64) -> (f64, f64, f64) {
        let e = e.max(0.0);
        let Degradation { delta_a, delta_nu, delta_eta } = self.degradation;
        ((self.loop_shape.a - delta_a * e).max(0.0), 1.0 + delta_nu * e, 1.0 + delta_eta * e)
    }

    /// The factor of pinching, 1 where there is none.
    fn pinched(&self, z: f64, e: f64, u_dot: f64, limit: f64) -> f64 {
        let p = &self.pinching;
        if p.severity == 0.0 || u_dot == 0.0 {
            return 1.0;
        }
        let zeta1 = p.severity * (1.0 - (-p.growth * e.max(0.0)).exp());
        let zeta2 = (p.width + p.delta_width * e.max(0.0)) * (p.lambda + zeta1);
        let distance = (z * u_dot.signum() - p.position * limit) / zeta2;
        1.0 - zeta1 * (-distance * distance).exp()
    }
}

impl Differential<2> for BaberNoori {
    fn initial(&self) -> [f64; 2] {
        [0.0, 0.0]
    }

    fn derivative(&self, &[z, e]: &[f64; 2], _: f64, u_dot: f64) -> [f64; 2] {
        let BoucWenParameters { beta, gamma, n, .. } = self.loop_shape;
        let (a, nu, eta) = self.degraded(e);
        let limit = (a / (nu * (beta + gamma))).powf(1.0 / n);
        let p = power_below(z, n);
        let bouc_wen = a * u_dot - nu * p * (beta * u_dot.abs() * z + gamma * u_dot * z.abs());
        [self.pinched(z, e, u_dot, limit) * bouc_wen / eta, z * u_dot]
    }

    fn output(&self, &[z, _]: &[f64; 2], u: f64, _: f64) -> f64 {
        self.loop_shape.direct * u + self.loop_shape.hysteretic * z
    }

    fn fastest_rate(&self, &[z, e]: &[f64; 2], _: f64, u_dot: f64) -> f64 {
        let BoucWenParameters { beta, gamma, n, .. } = self.loop_shape;
        let (a, nu, eta) = self.degraded(e);
        let limit = (a / (nu * (beta + gamma))).powf(1.0 / n);
        let p = if n == 1.0 { 1.0 } else { power_below(z.abs().max(limit), n) };
        n * nu * (beta + gamma.abs()) * p * u_dot.abs() / eta
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Operator, Sampled};

    const LOOP: BoucWenParameters =
        BoucWenParameters { a: 1.0, beta: 0.5, gamma: 0.3, n: 1.0, direct: 0.1, hysteretic: 0.9 };

    fn cycles() -> Vec<f64> {
        (0..2000).map(|n| 3.0 * (f64::from(n) * 0.0314159).sin()).collect()
    }

    fn run(degradation: Degradation, pinching: Pinching) -> Vec<f64> {
        Sampled::new(BaberNoori::new(LOOP, degradation, pinching).unwrap(), 0.01, 2).unwrap().run(&cycles())
    }

    #[test]
    fn without_degradation_and_pinching_it_is_bouc_wen() {
        let plain = Sampled::new(BoucWen::new(LOOP).unwrap(), 0.01, 2).unwrap().run(&cycles());
        for (a, b) in run(Degradation::default(), Pinching::NONE).iter().zip(plain) {
            approx::assert_abs_diff_eq!(*a, b, epsilon = 1e-13);
        }
    }

    fn peak(y: &[f64]) -> f64 {
        y.iter().fold(0.0f64, |m, y| m.max(y.abs()))
    }

    #[test]
    fn strength_falls_from_cycle_to_cycle() {
        let y = run(Degradation { delta_nu: 0.05, ..Default::default() }, Pinching::NONE);
        let (first, last) = (peak(&y[..200]), peak(&y[1800..]));
        assert!(last < 0.8 * first, "{first} to {last}");
    }

    #[test]
    fn pinching_makes_the_loop_thin_in_the_middle() {
        let deep = Pinching { severity: 0.9, growth: 1.0, width: 0.3, lambda: 0.5, ..Pinching::NONE };
        // Slope dF/du where z crosses zero: small when pinched.
        let slope = |y: &[f64]| {
            let u = cycles();
            let z: Vec<f64> = y.iter().zip(&u).map(|(y, u)| (y - LOOP.direct * u) / LOOP.hysteretic).collect();
            let n = (1800..1999).find(|&n| z[n] < 0.0 && z[n + 1] >= 0.0).unwrap();
            (z[n + 1] - z[n]) / (u[n + 1] - u[n])
        };
        let (plain, pinched) =
            (slope(&run(Degradation::default(), Pinching::NONE)), slope(&run(Degradation::default(), deep)));
        assert!(pinched < 0.3 * plain, "{plain} and {pinched}");
    }

    #[test]
    fn bad_parameters_are_refused() {
        let none = Degradation::default();
        let cases = [
            (BoucWenParameters { gamma: 0.9, ..LOOP }, none, Pinching::NONE, "baber-noori: gamma = 0.9"),
            (LOOP, Degradation { delta_eta: -0.1, ..none }, Pinching::NONE, "delta_eta must be"),
            (LOOP, none, Pinching { severity: 1.0, ..Pinching::NONE }, "severity must be 0 or more and below 1"),
            (LOOP, none, Pinching { width: 0.0, ..Pinching::NONE }, "width must be"),
        ];
        for (shape, degradation, pinching, expected) in cases {
            let e = BaberNoori::new(shape, degradation, pinching).unwrap_err().to_string();
            assert!(e.contains(expected), "{e}");
        }
    }
}
