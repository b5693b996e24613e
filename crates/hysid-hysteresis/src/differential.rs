//! Operators given by a differential equation: what such a law is, and its integration over samples by RK4.
//!
//! Between two samples the input is interpolated linearly, so its derivative is constant there; where the exact derivative is
//! known it can be supplied, and the input is then the cubic through both values and both derivatives (whose derivative is
//! of fourth order at the middle of the step, so RK4 keeps its order). Reference: Hairer, Norsett and Wanner, *Solving
//! Ordinary Differential Equations I* (1993), II.1.

use crate::error::Check;
use crate::{Operator, ParameterError};

/// A hysteresis law `x' = f(x, u, u')`, `y = g(x, u, u')` with `N` states.
pub trait Differential<const N: usize>: Send + Sync {
    /// The states before the first sample.
    fn initial(&self) -> [f64; N];

    /// The states' time derivatives from the states, the input and its time derivative.
    fn derivative(&self, x: &[f64; N], u: f64, u_dot: f64) -> [f64; N];

    /// The output.
    fn output(&self, x: &[f64; N], u: f64, u_dot: f64) -> f64;

    /// A bound on how fast the states forget, in 1/s: the largest of `|df/dx|` at this input.
    ///
    /// [`Sampled`] takes more sub-steps where the product of this and the sub-step is above 1, since RK4 is unstable beyond
    /// 2.78. The default, 0, never asks for more.
    fn fastest_rate(&self, x: &[f64; N], u: f64, u_dot: f64) -> f64 {
        let _ = (x, u, u_dot);
        0.0
    }
}

/// One step of the classical Runge-Kutta method for `x' = f(s, x)`, of length `h`; `s` runs from 0 to 1 over the step.
#[inline]
pub fn rk4<const N: usize>(x: &[f64; N], h: f64, f: impl Fn(f64, &[f64; N]) -> [f64; N]) -> [f64; N] {
    let ahead = |k: &[f64; N], h: f64| std::array::from_fn(|i| x[i] + h * k[i]);
    let k1 = f(0.0, x);
    let k2 = f(0.5, &ahead(&k1, 0.5 * h));
    let k3 = f(0.5, &ahead(&k2, 0.5 * h));
    let k4 = f(1.0, &ahead(&k3, h));
    std::array::from_fn(|i| x[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]))
}

/// More sub-steps than this are never taken in one sampling period, however stiff the law.
const MOST_SUB_STEPS: u32 = 100_000;

/// A number of sub-steps that can be taken.
pub(crate) fn checked_sub_steps(count: usize) -> Result<u32, ParameterError> {
    let possible = u32::try_from(count).ok().filter(|n| (1..=MOST_SUB_STEPS).contains(n));
    let refused = || {
        let allowed = format!("sub_steps must be 1 to {MOST_SUB_STEPS}");
        Check("sampling").refuse(format_args!("sub_steps = {count}"), allowed)
    };
    possible.ok_or_else(refused)
}

/// A differential law with a sampling period: an [`Operator`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sampled<L, const N: usize> {
    law: L,
    period_s: f64,
    sub_steps: u32,
}

/// The memory of a [`Sampled`] law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SampledState<const N: usize> {
    /// The law's states at the last sample.
    pub x: [f64; N],
    /// The input at the last sample and its derivative there, once there was a sample.
    last: Option<(f64, f64)>,
}

impl<const N: usize, L: Differential<N>> Sampled<L, N> {
    /// `law` sampled every `period_s` seconds, with at least `sub_steps` RK4 steps from each sample to the next.
    ///
    /// # Errors
    /// The period is not a finite number above zero, or the sub-steps are not 1 to 100 000.
    pub fn new(law: L, period_s: f64, sub_steps: u32) -> Result<Self, ParameterError> {
        Check("sampling").positive("period_s", period_s)?;
        Ok(Self { law, period_s, sub_steps: checked_sub_steps(sub_steps as usize)? })
    }

    /// The law.
    pub fn law(&self) -> &L {
        &self.law
    }

    /// The sampling period in seconds.
    pub fn period_s(&self) -> f64 {
        self.period_s
    }

    /// A state that starts from the law's states `x` instead of [`Differential::initial`].
    pub fn from_states(&self, x: [f64; N]) -> SampledState<N> {
        SampledState { x, last: None }
    }

    /// The output for the next sample when the input's time derivative at it is known.
    pub fn step_with_derivative(&self, state: &mut SampledState<N>, u: f64, u_dot: f64) -> f64 {
        if let Some((u0, v0)) = state.last {
            let (t, rise) = (self.period_s, u - u0);
            // The cubic Hermite interpolant and its derivative at the fraction `s` of the step.
            let input = |s: f64| {
                let (a, b) = (t * v0 - rise, rise - t * u_dot);
                let value = u0 + s * rise + s * (1.0 - s) * (a * (1.0 - s) + b * s);
                let slope = rise + (1.0 - 2.0 * s) * (a * (1.0 - s) + b * s) + s * (1.0 - s) * (b - a);
                (value, slope / t)
            };
            self.integrate(state, u0, v0.abs().max(u_dot.abs()), input);
        }
        state.last = Some((u, u_dot));
        self.law.output(&state.x, u, u_dot)
    }

    /// The outputs for the samples `u` with time derivatives `u_dot`, from the initial state; as many as the shorter slice holds.
    pub fn run_with_derivative(&self, u: &[f64], u_dot: &[f64]) -> Vec<f64> {
        let mut state = self.init();
        u.iter().zip(u_dot).map(|(&u, &v)| self.step_with_derivative(&mut state, u, v)).collect()
    }

    /// Advances the states by one sampling period; `input(s)` gives input and derivative at the fraction `s` of it.
    #[inline]
    fn integrate(&self, state: &mut SampledState<N>, u: f64, u_dot: f64, input: impl Fn(f64) -> (f64, f64)) {
        let sub_steps = self.sub_steps_needed(&state.x, u, u_dot);
        let fraction = 1.0 / f64::from(sub_steps);
        let h = self.period_s * fraction;
        for m in 0..sub_steps {
            let start = f64::from(m);
            state.x = rk4(&state.x, h, |s, x| {
                let (u, u_dot) = input((start + s) * fraction);
                self.law.derivative(x, u, u_dot)
            });
        }
    }

    /// The number of sub-steps: as asked for, and more where the law would be unstable.
    #[inline]
    fn sub_steps_needed(&self, x: &[f64; N], u: f64, u_dot: f64) -> u32 {
        let needed = self.law.fastest_rate(x, u, u_dot) * self.period_s;
        if needed > f64::from(self.sub_steps) {
            needed.min(f64::from(MOST_SUB_STEPS)).ceil() as u32
        } else {
            self.sub_steps
        }
    }
}

impl<const N: usize, L: Differential<N>> Operator for Sampled<L, N> {
    type State = SampledState<N>;

    fn init(&self) -> SampledState<N> {
        self.from_states(self.law.initial())
    }

    #[inline]
    fn step(&self, state: &mut SampledState<N>, u: f64) -> f64 {
        let mut u_dot = 0.0;
        if let Some((u0, _)) = state.last {
            let rise = u - u0;
            u_dot = rise / self.period_s;
            self.integrate(state, u0, u_dot, |s| (u0 + s * rise, u_dot));
        }
        state.last = Some((u, u_dot));
        self.law.output(&state.x, u, u_dot)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `x' = -x + u`, whose answer to `u = sin t` from rest is `(exp(-t) + sin t - cos t)/2`.
    struct Lag;

    impl Differential<1> for Lag {
        fn initial(&self) -> [f64; 1] {
            [0.0]
        }
        fn derivative(&self, x: &[f64; 1], u: f64, _: f64) -> [f64; 1] {
            [u - x[0]]
        }
        fn output(&self, x: &[f64; 1], _: f64, _: f64) -> f64 {
            x[0]
        }
    }

    fn error(samples: usize) -> f64 {
        let end = 4.0;
        let t: Vec<f64> = (0..=samples).map(|n| end * n as f64 / samples as f64).collect();
        let u: Vec<f64> = t.iter().map(|t| t.sin()).collect();
        let v: Vec<f64> = t.iter().map(|t| t.cos()).collect();
        let y = Sampled::new(Lag, end / samples as f64, 1).unwrap().run_with_derivative(&u, &v);
        (y[samples] - ((-end).exp() + end.sin() - end.cos()) / 2.0).abs()
    }

    #[test]
    fn rk4_with_the_exact_derivative_is_of_order_four() {
        for samples in [10, 20, 40] {
            let order = (error(samples) / error(2 * samples)).log2();
            assert!((3.7..4.5).contains(&order), "order {order} at {samples} samples");
        }
    }

    #[test]
    fn a_linear_input_is_integrated_the_same_with_and_without_its_derivative() {
        let u: Vec<f64> = (0..20).map(|n| 0.1 * f64::from(n)).collect();
        let s = Sampled::new(Lag, 0.1, 3).unwrap();
        for (a, b) in s.run(&u).iter().zip(s.run_with_derivative(&u, &[1.0; 20])) {
            approx::assert_abs_diff_eq!(*a, b, epsilon = 1e-14);
        }
    }

    #[test]
    fn a_bad_period_is_refused() {
        assert!(Sampled::new(Lag, 0.0, 1).is_err());
        assert!(Sampled::new(Lag, 1.0, 0).is_err());
        assert!(Sampled::new(Lag, 1.0, u32::MAX).is_err());
    }
}
