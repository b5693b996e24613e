//! The reduced-frequency model of a pitching wing: the normal force from angle and pitch rate, with derivatives that depend on
//! the reduced frequency.
//!
//! `C_N = C_N0 + C_a(k) d + C_q(k) d' c/(2V)`, with `d = alpha - alpha0`, `k = omega c/(2V)`,
//! `C_a = C_a_inf + D/(1 + k^2 T^2)`, `C_q = C_q_inf - D T/(1 + k^2 T^2)`. For any motion, not just one sine, that is a first-order
//! lag: `tau x' = d - x`, `C_N = C_N0 + C_a_inf d + C_q_inf d' c/(2V) + D x` with `tau = T c/(2V)`: the form that is integrated
//! here. Linear and rate-dependent: the loop vanishes as the motion slows down. Angles in rad. Reference: Greenwell, J. Aircr. 35
//! (1998) 776-783, on how the derivatives depend on frequency.

use crate::error::Check;
use crate::{Differential, ParameterError};

/// The wing and its flow: what both aerodynamic models need.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wing {
    /// Chord c in m.
    pub chord_m: f64,
    /// Speed of the flow V in m/s.
    pub speed_m_s: f64,
}

impl Wing {
    /// `c/(2V)` in seconds: the unit of time of unsteady aerodynamics.
    pub fn half_chord_time_s(&self) -> f64 {
        self.chord_m / (2.0 * self.speed_m_s)
    }

    pub(crate) fn check(&self, check: &Check) -> Result<(), ParameterError> {
        check.positive("chord_m", self.chord_m)?;
        check.positive("speed_m_s", self.speed_m_s)
    }
}

/// The parameters of the [`ReducedFrequency`] model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReducedFrequencyParameters {
    /// Chord and speed.
    pub wing: Wing,
    /// Angle about which it is linear, rad.
    pub alpha0: f64,
    /// Normal force coefficient there.
    pub c_n0: f64,
    /// Derivative with respect to the angle at high frequency, 1/rad.
    pub c_a_inf: f64,
    /// Derivative with respect to the reduced pitch rate at high frequency, 1/rad.
    pub c_q_inf: f64,
    /// The part of the angle derivative that lags, D, 1/rad.
    pub lagging: f64,
    /// Time constant of the lag, tau, in seconds.
    pub tau_s: f64,
}

/// The reduced-frequency model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReducedFrequency {
    parameters: ReducedFrequencyParameters,
}

impl ReducedFrequency {
    /// The model with these parameters; the lag is at rest at `alpha0` before the first sample.
    ///
    /// # Errors
    /// A chord, speed or time constant that is not above zero; a number that is not finite.
    pub fn new(parameters: ReducedFrequencyParameters) -> Result<Self, ParameterError> {
        let ReducedFrequencyParameters { wing, alpha0, c_n0, c_a_inf, c_q_inf, lagging, tau_s } = parameters;
        let check = Check("reduced-frequency");
        wing.check(&check)?;
        check.positive("tau_s", tau_s)?;
        for (name, value) in
            [("alpha0", alpha0), ("c_n0", c_n0), ("c_a_inf", c_a_inf), ("c_q_inf", c_q_inf), ("lagging", lagging)]
        {
            check.finite(name, value)?;
        }
        Ok(Self { parameters })
    }

    /// The derivatives `(C_a, C_q)` at the reduced frequency `k`, in 1/rad.
    pub fn derivatives_at(&self, k: f64) -> (f64, f64) {
        let p = &self.parameters;
        let t = p.tau_s / p.wing.half_chord_time_s();
        let share = p.lagging / (1.0 + (k * t).powi(2));
        (p.c_a_inf + share, p.c_q_inf - share * t)
    }
}

impl Differential<1> for ReducedFrequency {
    fn initial(&self) -> [f64; 1] {
        [0.0]
    }

    fn derivative(&self, &[x]: &[f64; 1], alpha: f64, _: f64) -> [f64; 1] {
        let p = &self.parameters;
        [(alpha - p.alpha0 - x) / p.tau_s]
    }

    fn output(&self, &[x]: &[f64; 1], alpha: f64, alpha_dot: f64) -> f64 {
        let p = &self.parameters;
        let rate = alpha_dot * p.wing.half_chord_time_s();
        p.c_n0 + p.c_a_inf * (alpha - p.alpha0) + p.c_q_inf * rate + p.lagging * x
    }

    fn fastest_rate(&self, _: &[f64; 1], _: f64, _: f64) -> f64 {
        1.0 / self.parameters.tau_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Sampled;

    #[test]
    fn a_sine_gives_the_derivatives_of_its_reduced_frequency() {
        let wing = Wing { chord_m: 0.4269, speed_m_s: 25.0 };
        let law = ReducedFrequency::new(ReducedFrequencyParameters {
            wing,
            alpha0: 0.5,
            c_n0: 1.1,
            c_a_inf: 2.0,
            c_q_inf: 3.0,
            lagging: 1.5,
            tau_s: 0.1,
        })
        .unwrap();
        let (amplitude, omega, period) = (0.3, std::f64::consts::TAU * 0.4, 0.01);
        let t = |n: usize| n as f64 * period;
        let alpha: Vec<f64> = (0..1000).map(|n| 0.5 + amplitude * (omega * t(n)).sin()).collect();
        let rate: Vec<f64> = (0..1000).map(|n| amplitude * omega * (omega * t(n)).cos()).collect();
        let y = Sampled::new(law, period, 4).unwrap().run_with_derivative(&alpha, &rate);
        let (c_a, c_q) = law.derivatives_at(omega * wing.half_chord_time_s());
        for n in 500..1000 {
            let expected = 1.1 + c_a * (alpha[n] - 0.5) + c_q * rate[n] * wing.half_chord_time_s();
            approx::assert_abs_diff_eq!(y[n], expected, epsilon = 1e-8);
        }
    }

    #[test]
    fn bad_parameters_are_refused() {
        let wing = Wing { chord_m: 0.0, speed_m_s: 25.0 };
        let p = ReducedFrequencyParameters {
            wing,
            alpha0: 0.0,
            c_n0: 0.0,
            c_a_inf: 0.0,
            c_q_inf: 0.0,
            lagging: 0.0,
            tau_s: 1.0,
        };
        assert!(ReducedFrequency::new(p).unwrap_err().to_string().contains("chord_m must be"));
        let wing = Wing { chord_m: 1.0, speed_m_s: 25.0 };
        assert!(ReducedFrequency::new(ReducedFrequencyParameters { wing, tau_s: -1.0, ..p }).is_err());
    }
}
