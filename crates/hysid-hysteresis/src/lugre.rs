//! LuGre friction: bristles that bend and slip, with the Stribeck effect and viscous friction.
//!
//! `z' = v - sigma0 |v| z/g(v)`, `F = sigma0 z + sigma1 z' + sigma2 v`, `g(v) = F_c + (F_s - F_c) exp(-(v/v_s)^2)`, with
//! displacement `u` and velocity `v = u'`. Rate-dependent. Steady sliding gives `F = g(v) sgn v + sigma2 v`. The law is stiff
//! (rate `sigma0 |v|/g`): the sub-steps follow it. Reference: Canudas de Wit, Olsson, Astrom and Lischinsky, IEEE Trans.
//! Autom. Control 40 (1995) 419-425.

use crate::error::Check;
use crate::{Differential, ParameterError};

/// The parameters of [`LuGre`] friction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LuGreParameters {
    /// Stiffness of the bristles.
    pub sigma0: f64,
    /// Damping of the bristles.
    pub sigma1: f64,
    /// Viscous friction.
    pub sigma2: f64,
    /// Coulomb force.
    pub f_c: f64,
    /// Static force, at least the Coulomb force.
    pub f_s: f64,
    /// Stribeck velocity.
    pub v_s: f64,
}

/// LuGre friction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LuGre {
    parameters: LuGreParameters,
}

impl LuGre {
    /// Friction with these parameters.
    ///
    /// # Errors
    /// `sigma0`, `f_c` or `v_s` not above zero; `sigma1` or `sigma2` negative; `f_s` below `f_c`.
    pub fn new(parameters: LuGreParameters) -> Result<Self, ParameterError> {
        let LuGreParameters { sigma0, sigma1, sigma2, f_c, f_s, v_s } = parameters;
        let check = Check("lugre");
        check.positive("sigma0", sigma0)?;
        check.not_negative("sigma1", sigma1)?;
        check.not_negative("sigma2", sigma2)?;
        check.positive("f_c", f_c)?;
        check.require("f_s", f_s, f_s.is_finite() && f_s >= f_c, &format!("f_c = {f_c} or more"))?;
        check.positive("v_s", v_s)?;
        Ok(Self { parameters })
    }

    /// The steady friction level at a velocity, without the viscous part: `g(v)`.
    pub fn stribeck(&self, v: f64) -> f64 {
        let LuGreParameters { f_c, f_s, v_s, .. } = self.parameters;
        f_c + (f_s - f_c) * (-(v / v_s).powi(2)).exp()
    }
}

impl Differential<1> for LuGre {
    fn initial(&self) -> [f64; 1] {
        [0.0]
    }

    fn derivative(&self, &[z]: &[f64; 1], _: f64, v: f64) -> [f64; 1] {
        [v - self.parameters.sigma0 * v.abs() / self.stribeck(v) * z]
    }

    fn output(&self, x: &[f64; 1], u: f64, v: f64) -> f64 {
        let LuGreParameters { sigma0, sigma1, sigma2, .. } = self.parameters;
        let [z_dot] = self.derivative(x, u, v);
        sigma0 * x[0] + sigma1 * z_dot + sigma2 * v
    }

    fn fastest_rate(&self, _: &[f64; 1], _: f64, v: f64) -> f64 {
        self.parameters.sigma0 * v.abs() / self.stribeck(v)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Operator, Sampled};

    const PARAMETERS: LuGreParameters =
        LuGreParameters { sigma0: 1e5, sigma1: 300.0, sigma2: 0.4, f_c: 1.0, f_s: 1.5, v_s: 0.001 };

    #[test]
    fn steady_sliding_follows_the_stribeck_curve() {
        let law = LuGre::new(PARAMETERS).unwrap();
        for v in [0.0005, 0.002, 0.1, -0.003] {
            let u: Vec<f64> = (0..200).map(|n| v * 0.01 * f64::from(n)).collect();
            let y = Sampled::new(law, 0.01, 1).unwrap().run(&u)[199];
            approx::assert_relative_eq!(y, law.stribeck(v) * v.signum() + 0.4 * v, max_relative = 1e-6);
        }
    }

    #[test]
    fn presliding_is_a_spring() {
        let op = Sampled::new(LuGre::new(LuGreParameters { sigma1: 0.0, ..PARAMETERS }).unwrap(), 1.0, 4).unwrap();
        approx::assert_relative_eq!(op.run(&[0.0, 1e-8])[1], 1e5 * 1e-8, max_relative = 1e-3);
    }

    #[test]
    fn at_one_velocity_the_state_is_an_exponential() {
        let law = LuGre::new(PARAMETERS).unwrap();
        let (v, t) = (0.002, 0.005);
        let op = Sampled::new(law, t, 40).unwrap();
        let mut state = op.init();
        op.step(&mut state, 0.0);
        op.step(&mut state, v * t);
        let zss = law.stribeck(v) / PARAMETERS.sigma0;
        approx::assert_relative_eq!(state.x[0], zss * (1.0 - (-v * t / zss).exp()), max_relative = 1e-6);
    }

    #[test]
    fn bad_parameters_are_refused() {
        for (parameters, expected) in [
            (LuGreParameters { sigma0: 0.0, ..PARAMETERS }, "sigma0 must be"),
            (LuGreParameters { f_s: 0.5, ..PARAMETERS }, "f_s must be f_c = 1 or more"),
            (LuGreParameters { v_s: 0.0, ..PARAMETERS }, "v_s must be"),
        ] {
            let e = LuGre::new(parameters).unwrap_err().to_string();
            assert!(e.contains(expected), "{e}");
        }
    }
}
