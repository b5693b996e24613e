//! The Goman-Khrabrov model of a pitching wing: how far the flow is attached lags behind the angle of attack.
//!
//! `tau1 x' + x = x0(alpha - tau2 alpha')`, `x0 = 1/(1 + exp(s (alpha - alpha*)))`,
//! `C_N = x C_att sin(alpha) + (1 - x) C_sep sin(alpha) + C_Nq alpha' c/(2V)`. Angles in rad. Rate-dependent: the loop vanishes
//! as the motion slows down, and exists only where the motion passes the stall angle. References: Goman and Khrabrov, J. Aircr.
//! 31 (1994) 1109-1115; Williams, Reissner, Greenblatt, Mueller-Vahl and Strangfeld, AIAA J. 55 (2017) 403-409.

use crate::error::Check;
use crate::reduced_frequency::Wing;
use crate::{Differential, ParameterError};

/// The parameters of the [`GomanKhrabrov`] model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GomanKhrabrovParameters {
    /// Chord and speed.
    pub wing: Wing,
    /// Angle at which half of the flow is separated when at rest, rad.
    pub alpha_star: f64,
    /// Steepness of the separation, 1/rad.
    pub steepness: f64,
    /// Relaxation time, s.
    pub tau1_s: f64,
    /// Delay of the separation, s.
    pub tau2_s: f64,
    /// Normal force of attached flow over the sine of the angle.
    pub c_attached: f64,
    /// Normal force of separated flow over the sine of the angle.
    pub c_separated: f64,
    /// Pitch damping, 1/rad.
    pub c_nq: f64,
}

/// The Goman-Khrabrov model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GomanKhrabrov {
    parameters: GomanKhrabrovParameters,
}

impl GomanKhrabrov {
    /// The model with these parameters; the flow is attached before the first sample.
    ///
    /// # Errors
    /// A chord, a speed, a steepness or `tau1_s` that is not above zero; `tau2_s` negative; a number that is not finite.
    pub fn new(parameters: GomanKhrabrovParameters) -> Result<Self, ParameterError> {
        let p = &parameters;
        let check = Check("goman-khrabrov");
        p.wing.check(&check)?;
        check.positive("steepness", p.steepness)?;
        check.positive("tau1_s", p.tau1_s)?;
        check.not_negative("tau2_s", p.tau2_s)?;
        for (name, value) in [
            ("alpha_star", p.alpha_star),
            ("c_attached", p.c_attached),
            ("c_separated", p.c_separated),
            ("c_nq", p.c_nq),
        ] {
            check.finite(name, value)?;
        }
        Ok(Self { parameters })
    }

    /// How far the flow is attached at rest at this angle: 1 attached, 0 separated.
    pub fn at_rest(&self, alpha: f64) -> f64 {
        1.0 / (1.0 + (self.parameters.steepness * (alpha - self.parameters.alpha_star)).exp())
    }

    /// The normal force coefficient from the attachment `x`, the angle and its rate in rad/s.
    pub fn normal_force(&self, x: f64, alpha: f64, alpha_dot: f64) -> f64 {
        let p = &self.parameters;
        let share = x * p.c_attached + (1.0 - x) * p.c_separated;
        share * alpha.sin() + p.c_nq * alpha_dot * p.wing.half_chord_time_s()
    }
}

impl Differential<1> for GomanKhrabrov {
    fn initial(&self) -> [f64; 1] {
        [1.0]
    }

    fn derivative(&self, &[x]: &[f64; 1], alpha: f64, alpha_dot: f64) -> [f64; 1] {
        [(self.at_rest(alpha - self.parameters.tau2_s * alpha_dot) - x) / self.parameters.tau1_s]
    }

    fn output(&self, &[x]: &[f64; 1], alpha: f64, alpha_dot: f64) -> f64 {
        self.normal_force(x, alpha, alpha_dot)
    }

    fn fastest_rate(&self, _: &[f64; 1], _: f64, _: f64) -> f64 {
        1.0 / self.parameters.tau1_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Operator, Sampled};

    fn law() -> GomanKhrabrov {
        GomanKhrabrov::new(GomanKhrabrovParameters {
            wing: Wing { chord_m: 0.4269, speed_m_s: 25.0 },
            alpha_star: 0.44,
            steepness: 15.0,
            tau1_s: 0.05,
            tau2_s: 0.03,
            c_attached: 3.0,
            c_separated: 1.3,
            c_nq: 0.0,
        })
        .unwrap()
    }

    #[test]
    fn a_constant_angle_relaxes_exponentially() {
        let op = Sampled::new(law(), 0.01, 4).unwrap();
        let mut state = op.init();
        for n in 0..100 {
            op.step(&mut state, 0.5);
            let rest = law().at_rest(0.5);
            let exact = rest + (1.0 - rest) * (-0.01 * f64::from(n) / 0.05).exp();
            approx::assert_abs_diff_eq!(state.x[0], exact, epsilon = 1e-7);
        }
    }

    #[test]
    fn slow_pitching_follows_the_curve_at_rest_and_fast_pitching_does_not() {
        let spread = |period: f64| {
            let u: Vec<f64> =
                (0..2000).map(|n| 0.5 + 0.4 * (std::f64::consts::TAU * f64::from(n) / 500.0).sin()).collect();
            let y = Sampled::new(law(), period, 1).unwrap().run(&u);
            (1500..2000).map(|n| (y[n] - law().normal_force(law().at_rest(u[n]), u[n], 0.0)).abs()).fold(0.0, f64::max)
        };
        let (slow, fast) = (spread(1.0), spread(0.001));
        assert!(slow < 0.01 && fast > 0.2, "{slow} {fast}");
    }

    #[test]
    fn bad_parameters_are_refused() {
        let good = law().parameters;
        for (parameters, expected) in [
            (GomanKhrabrovParameters { tau1_s: 0.0, ..good }, "tau1_s must be"),
            (GomanKhrabrovParameters { tau2_s: -1.0, ..good }, "tau2_s must be"),
            (GomanKhrabrovParameters { c_nq: f64::INFINITY, ..good }, "c_nq must be"),
        ] {
            let e = GomanKhrabrov::new(parameters).unwrap_err().to_string();
            assert!(e.contains(expected), "{e}");
        }
    }
}
