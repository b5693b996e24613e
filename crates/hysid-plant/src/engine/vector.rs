//! The instruction set that the steps of a run are compiled for, chosen at run time; the arithmetic is the same in every form.

use super::machine::Machine;
use crate::number::{Number, Span};

/// What the processor has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Width {
    /// What the compiler takes for granted.
    Baseline,
    #[cfg(target_arch = "x86_64")]
    Avx2,
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl Width {
    /// The widest that pays for this number.
    pub fn of<N: Number>() -> Self {
        #[cfg(target_arch = "x86_64")]
        if N::WIDE {
            if is_x86_feature_detected!("avx512f") {
                return Self::Avx512;
            }
            if is_x86_feature_detected!("avx2") {
                return Self::Avx2;
            }
        }
        Self::Baseline
    }
}

impl<N: Number> Machine<'_, N> {
    /// One Runge-Kutta step of length `h`, from `tau` after the present sample, into `trial`; where a surface is stuck,
    /// the state derivatives are those of [`Machine::stuck_flow`].
    #[inline(always)]
    pub fn step<S: Span<N>>(&mut self, tau: S, h: S) {
        if self.any_stuck {
            return self.step_stuck(tau, h);
        }
        #[cfg(target_arch = "x86_64")]
        if N::WIDE && S::PLAIN {
            match self.width {
                // SAFETY: `Width::of` has found the feature.
                Width::Avx512 => return unsafe { step_avx512(self, tau, h) },
                // SAFETY: as above.
                Width::Avx2 => return unsafe { step_avx2(self, tau, h) },
                Width::Baseline => {}
            }
        }
        step_baseline(self, tau, h);
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f")]
fn step_avx512<N: Number, S: Span<N>>(machine: &mut Machine<'_, N>, tau: S, h: S) {
    machine.step_here(tau, h);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn step_avx2<N: Number, S: Span<N>>(machine: &mut Machine<'_, N>, tau: S, h: S) {
    machine.step_here(tau, h);
}

#[inline(never)]
fn step_baseline<N: Number, S: Span<N>>(machine: &mut Machine<'_, N>, tau: S, h: S) {
    machine.step_here(tau, h);
}
