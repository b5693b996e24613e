//! Dormand-Prince 5(4) with location of events: the integrator of the bank.
//!
//! A hybrid system has continuous states and discrete modes (sticking, sliding to the right, touching a stop ...). Each mode
//! has a guard that is positive while the mode holds. A step over which a guard turns negative is cut at the crossing (Illinois
//! root finding on real steps, not on an interpolant), the mode is switched there, and integration goes on.
//! Between two breaks (a knot of the input, a sample of the output) the right-hand side is smooth, so that the
//! error estimate of the pair holds.
//!
//! Failure modes: more than [`MAX_STEPS`] steps in one interval, or a state that is not finite, ends in
//! [`Failed`]; the caller draws another case.
//!
//! Reference: Dormand, Prince, J. Comput. Appl. Math. 6 (1980) 19-26; Hairer, Norsett, Wanner, Solving ODEs I, II.4, II.6.

/// Steps allowed between two breaks.
pub const MAX_STEPS: usize = 4000;
/// Relative tolerance on every state.
const TOLERANCE: f64 = 1e-7;
/// Mode switches allowed at one instant before the modes are left as they are.
const MAX_SWITCHES: usize = 12;

/// A system with continuous states and discrete modes.
pub trait Hybrid {
    /// Writes the time derivative of `x` in the given modes.
    fn derivative(&mut self, t: f64, x: &[f64], mode: &[i8], dx: &mut [f64]);
    /// Writes one guard for each mode: negative when the mode no longer holds.
    fn guards(&mut self, t: f64, x: &[f64], mode: &[i8], guard: &mut [f64]);
    /// Changes mode `i`, whose guard has turned negative, and clears the states that the change makes exact.
    fn switch(&mut self, i: usize, t: f64, x: &mut [f64], mode: &mut [i8]);
}

/// The integration did not reach the end of the interval.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("integration stopped at t = {at} s")]
pub struct Failed {
    /// Time reached, in seconds.
    pub at: f64,
}

const C: [f64; 6] = [0.2, 0.3, 0.8, 8.0 / 9.0, 1.0, 1.0];
const A: [[f64; 6]; 6] = [
    [0.2, 0.0, 0.0, 0.0, 0.0, 0.0],
    [3.0 / 40.0, 9.0 / 40.0, 0.0, 0.0, 0.0, 0.0],
    [44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0, 0.0, 0.0, 0.0],
    [19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0, 0.0, 0.0],
    [9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0, 0.0],
    [35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0],
];
/// Fifth-order weights minus fourth-order weights.
const E: [f64; 7] =
    [71.0 / 57600.0, 0.0, -71.0 / 16695.0, 71.0 / 1920.0, -17253.0 / 339200.0, 22.0 / 525.0, -1.0 / 40.0];

/// The integrator's memory: states, modes, step size and work arrays.
#[derive(Debug, Clone)]
pub struct Integrator {
    /// Continuous states.
    pub x: Vec<f64>,
    /// Discrete modes.
    pub mode: Vec<i8>,
    largest: Vec<f64>,
    k: [Vec<f64>; 7],
    trial: Vec<f64>,
    next: Vec<f64>,
    guard: Vec<f64>,
    guard_next: Vec<f64>,
    step: f64,
}

impl Integrator {
    /// An integrator at rest in state `x` and the given modes.
    pub fn new(x: Vec<f64>, mode: Vec<i8>) -> Self {
        let n = x.len();
        let zero = || vec![0.0; n];
        Self {
            largest: x.iter().map(|v| v.abs()).collect(),
            k: [zero(), zero(), zero(), zero(), zero(), zero(), zero()],
            trial: zero(),
            next: zero(),
            guard: vec![0.0; mode.len()],
            guard_next: vec![0.0; mode.len()],
            step: f64::INFINITY,
            x,
            mode,
        }
    }

    /// One step of length `h` from the current state into `self.next`; returns the scaled error. `k[0]` must be current.
    fn attempt(&mut self, system: &mut impl Hybrid, t: f64, h: f64) -> f64 {
        let n = self.x.len();
        for s in 0..6 {
            for i in 0..n {
                let mut sum = 0.0;
                for (j, a) in A[s].iter().enumerate().take(s + 1) {
                    sum += a * self.k[j][i];
                }
                self.trial[i] = self.x[i] + h * sum;
            }
            let (_, rest) = self.k.split_at_mut(s + 1);
            system.derivative(t + C[s] * h, &self.trial, &self.mode, &mut rest[0]);
        }
        self.next.copy_from_slice(&self.trial);
        let mut worst = 0.0_f64;
        for i in 0..n {
            let mut e = 0.0;
            for (j, w) in E.iter().enumerate() {
                e += w * self.k[j][i];
            }
            let size = self.largest[i].max(self.next[i].abs()).max(1e-14);
            let ratio = (h * e).abs() / (TOLERANCE * size);
            worst = if ratio.is_nan() { f64::INFINITY } else { worst.max(ratio) };
        }
        worst
    }

    /// The lowest guard at `self.next` and where it stands, when it is negative.
    fn breached(&mut self, system: &mut impl Hybrid, t: f64) -> Option<usize> {
        if self.mode.is_empty() {
            return None;
        }
        system.guards(t, &self.next, &self.mode, &mut self.guard_next);
        (0..self.mode.len()).find(|&i| self.guard_next[i] < 0.0)
    }

    /// Brings the modes into agreement with the state at time `t` (an input may have jumped).
    pub fn settle(&mut self, system: &mut impl Hybrid, t: f64) {
        for _ in 0..MAX_SWITCHES {
            system.guards(t, &self.x, &self.mode, &mut self.guard);
            let Some(i) = (0..self.mode.len()).find(|&i| self.guard[i] < 0.0) else { return };
            system.switch(i, t, &mut self.x, &mut self.mode);
        }
    }

    /// Integrates from `t` to `end`.
    pub fn advance(&mut self, system: &mut impl Hybrid, mut t: f64, end: f64) -> Result<(), Failed> {
        let span = end - t;
        if span <= 0.0 {
            return Ok(());
        }
        self.settle(system, t);
        let mut h = self.step.min(span);
        let mut stale = true;
        let mut stalled = 0;
        for _ in 0..MAX_STEPS {
            if stale {
                let mut k0 = std::mem::take(&mut self.k[0]);
                system.derivative(t, &self.x, &self.mode, &mut k0);
                self.k[0] = k0;
            }
            let last = end - t <= h * (1.0 + 1e-9);
            let taken = if last { end - t } else { h };
            let error = self.attempt(system, t, taken);
            if error > 1.0 && taken > 1e-9 * span {
                h = taken * (0.9 * error.powf(-0.2)).clamp(0.1, 0.9);
                stale = false;
                continue;
            }
            if !self.next.iter().all(|v| v.is_finite()) {
                return Err(Failed { at: t });
            }
            let grown = if error > 0.0 { (0.9 * error.powf(-0.2)).clamp(0.2, 5.0) } else { 5.0 };
            let mut used = taken;
            let event = if stalled > MAX_SWITCHES { None } else { self.breached(system, t + taken) };
            if event.is_some() {
                used = self.locate(system, t, taken);
            } else {
                self.step = if last { (taken * grown).max(self.step.min(h)) } else { taken * grown };
                h = self.step;
            }
            self.x.copy_from_slice(&self.next);
            for (m, v) in self.largest.iter_mut().zip(&self.x) {
                *m = m.max(v.abs());
            }
            t += used;
            stalled = if used > 1e-9 * span { 0 } else { stalled + 1 };
            if event.is_some() {
                // The located step ends a hair beyond the crossing, so that the guard is negative there.
                self.settle(system, t);
            } else if last {
                return Ok(());
            }
            if end - t <= 1e-12 * span {
                return Ok(());
            }
            stale = true;
        }
        Err(Failed { at: t })
    }

    /// Length of the step that ends just beyond the first crossing within `h`; leaves its end in `self.next`.
    fn locate(&mut self, system: &mut impl Hybrid, t: f64, h: f64) -> f64 {
        system.guards(t, &self.x, &self.mode, &mut self.guard);
        let worst = |guard: &[f64]| guard.iter().copied().fold(f64::INFINITY, f64::min);
        let (mut low, mut high) = (0.0, h);
        let (mut f_low, mut f_high) = (worst(&self.guard).max(0.0), worst(&self.guard_next));
        let mut side = 0;
        for _ in 0..60 {
            if high - low <= 1e-10 * h {
                break;
            }
            let mut mid = (low * f_high - high * f_low) / (f_high - f_low);
            if !(mid > low && mid < high) {
                mid = 0.5 * (low + high);
            }
            let _ = self.attempt(system, t, mid);
            system.guards(t + mid, &self.next, &self.mode, &mut self.guard_next);
            let f = worst(&self.guard_next);
            if f < 0.0 {
                (high, f_high) = (mid, f);
                if side == -1 {
                    f_low *= 0.5;
                }
                side = -1;
            } else {
                (low, f_low) = (mid, f);
                if side == 1 {
                    f_high *= 0.5;
                }
                side = 1;
            }
        }
        let _ = self.attempt(system, t, high);
        system.guards(t + high, &self.next, &self.mode, &mut self.guard_next);
        high
    }
}
