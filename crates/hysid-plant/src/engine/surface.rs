//! Switching surfaces in the sense of Filippov: dry friction that really sticks.
//!
//! Where `sign(s)` (or `step(s)`) rests on a state, `s = 0` is a switching surface with three modes: positive and negative
//! (the sign is 1 or -1 and the motion goes on until `s` comes back to zero) and stuck. Stuck, the sign is what keeps
//! `ds/dt = 0`, a number `sigma` between -1 and 1; when it would have to leave that range, the motion starts again. The
//! equations are affine in `sigma`, so it follows from a linear system over the surfaces that are stuck at once.
//! Reference: A. F. Filippov, Differential Equations with Discontinuous Righthand Sides, 1988, section 4.

use crate::number::Number;

/// On which side of a switching surface the motion is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Mode {
    Positive,
    Negative,
    Stuck,
}

impl Mode {
    /// The sign of a mode that is not stuck.
    pub fn sign(self) -> f64 {
        match self {
            Self::Positive => 1.0,
            Self::Negative => -1.0,
            Self::Stuck => 0.0,
        }
    }

    pub fn of(s: f64) -> Self {
        if s < 0.0 { Self::Negative } else { Self::Positive }
    }
}

/// Solves `a x = b` in place by elimination (`a` by rows, `n` unknowns); a pivot that vanishes leaves its unknown at 0 where
/// nothing is asked of it, else at 10 times the sign that it would need (outside [-1, 1]: the surface lets go).
pub(super) fn solve<N: Number>(a: &mut [N], b: &mut [N], n: usize) {
    let scale: f64 = a.iter().fold(0.0, |m, x| f64::max(m, x.value().abs()));
    for k in 0..n {
        let best =
            (k..n).max_by(|&i, &j| a[i * n + k].value().abs().total_cmp(&a[j * n + k].value().abs())).unwrap_or(k);
        for j in 0..n {
            a.swap(k * n + j, best * n + j);
        }
        b.swap(k, best);
        let pivot = a[k * n + k];
        if pivot.value().abs() <= 1e-14 * scale || pivot.value() == 0.0 {
            continue;
        }
        for i in k + 1..n {
            let factor = a[i * n + k].div(pivot);
            for j in k..n {
                a[i * n + j] = a[i * n + j].sub(factor.mul(a[k * n + j]));
            }
            b[i] = b[i].sub(factor.mul(b[k]));
        }
    }
    for k in (0..n).rev() {
        let mut sum = b[k];
        for j in k + 1..n {
            sum = sum.sub(a[k * n + j].mul(b[j]));
        }
        let pivot = a[k * n + k];
        b[k] = if pivot.value().abs() <= 1e-14 * scale || pivot.value() == 0.0 {
            N::lift(-10.0 * crate::number::sign(sum.value()))
        } else {
            sum.div(pivot)
        };
    }
}
