//! The play operator (backlash): the output follows the input at a distance of at most the half-width.
//!
//! `w[n] = max(u[n] - r, min(u[n] + r, w[n-1]))`. Rate-independent, wiping-out, congruent. References: Krasnosel'skii and
//! Pokrovskii, *Systems with Hysteresis* (1989); Kuhnen, Eur. J. Control 9 (2003) 407-418.

use crate::error::Check;
use crate::{Operator, ParameterError};

/// The play's next output from its last output `w`, the input `u` and the half-width `r` of 0 or more.
#[inline]
pub fn play(w: f64, u: f64, r: f64) -> f64 {
    // In this order a non-finite `r` or `u` cannot panic, as `clamp` would.
    (u - r).max((u + r).min(w))
}

/// A play of half-width `r`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Play {
    r: f64,
    start: f64,
}

impl Play {
    /// A play of half-width `r` (unit of the input) that rests at 0 before the first sample.
    ///
    /// # Errors
    /// `r` is negative or not finite.
    pub fn new(r: f64) -> Result<Self, ParameterError> {
        Self::starting_at(r, 0.0)
    }

    /// The same with the output `start` before the first sample.
    ///
    /// # Errors
    /// `r` is negative or not finite; `start` is not finite.
    pub fn starting_at(r: f64, start: f64) -> Result<Self, ParameterError> {
        let check = Check("play");
        check.not_negative("r", r)?;
        check.finite("start", start)?;
        Ok(Self { r, start })
    }

    /// The half-width.
    pub fn half_width(&self) -> f64 {
        self.r
    }
}

impl Operator for Play {
    /// The last output.
    type State = f64;

    fn init(&self) -> f64 {
        self.start
    }

    #[inline]
    fn step(&self, w: &mut f64, u: f64) -> f64 {
        *w = play(*w, u, self.r);
        *w
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_follows_at_a_distance() {
        let cases: [(f64, &[f64], &[f64]); 4] = [
            (0.5, &[0.0, 0.4, 0.6, 2.0, 1.5, 1.0, 0.9], &[0.0, 0.0, 0.1, 1.5, 1.5, 1.5, 1.4]),
            (0.0, &[1.0, -3.0, 2.0], &[1.0, -3.0, 2.0]),
            (10.0, &[1.0, -3.0, 2.0], &[0.0, 0.0, 0.0]),
            (0.5, &[-2.0, -1.75], &[-1.5, -1.5]),
        ];
        for (r, u, expected) in cases {
            for (y, e) in Play::new(r).unwrap().run(u).iter().zip(expected) {
                approx::assert_abs_diff_eq!(y, e, epsilon = 1e-15);
            }
        }
    }

    #[test]
    fn a_negative_width_is_refused() {
        let e = Play::new(-0.1).unwrap_err();
        assert_eq!(e.to_string(), "play: r = -0.1 is not allowed; r must be a finite number of 0 or more");
        assert!(Play::new(f64::NAN).is_err());
    }
}
