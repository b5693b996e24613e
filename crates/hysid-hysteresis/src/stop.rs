//! The stop operator (elastic, ideally plastic spring): the part of the input that the play of the same width leaves.
//!
//! `e[n] = min(r, max(-r, u[n] - u[n-1] + e[n-1]))`, so that stop and play of one width add up to the input. Rate-independent,
//! wiping-out, congruent. References: as for the play.

use crate::error::Check;
use crate::{Operator, ParameterError, play};

/// A stop that yields at `+r` and `-r`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stop {
    r: f64,
}

impl Stop {
    /// A stop that yields at `+r` and `-r` (unit of the input), free of stress at input 0.
    ///
    /// # Errors
    /// `r` is negative or not finite.
    pub fn new(r: f64) -> Result<Self, ParameterError> {
        Check("stop").not_negative("r", r)?;
        Ok(Self { r })
    }

    /// The output at which it yields.
    pub fn limit(&self) -> f64 {
        self.r
    }
}

impl Operator for Stop {
    /// The output of the play of the same width: the plastic part of the input.
    type State = f64;

    fn init(&self) -> f64 {
        0.0
    }

    #[inline]
    fn step(&self, plastic: &mut f64, u: f64) -> f64 {
        *plastic = play(*plastic, u, self.r);
        // The subtraction may round to just above the limit.
        (u - *plastic).min(self.r).max(-self.r)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Play;

    #[test]
    fn stop_and_play_add_up_to_the_input() {
        let u = [0.0, 0.3, 1.2, 0.9, -2.0, -1.5, 0.25];
        let (stop, play) = (Stop::new(0.5).unwrap(), Play::new(0.5).unwrap());
        for ((e, w), u) in stop.run(&u).iter().zip(play.run(&u)).zip(u) {
            approx::assert_abs_diff_eq!(e + w, u, epsilon = 1e-15);
            assert!(e.abs() <= 0.5);
        }
    }

    #[test]
    fn it_agrees_with_the_recursion() {
        let u = [0.0, 0.3, 1.2, 0.9, -2.0, -1.5, 0.25];
        let (mut e, mut last) = (0.0f64, 0.0);
        for (y, u) in Stop::new(0.5).unwrap().run(&u).iter().zip(u) {
            e = (u - last + e).clamp(-0.5, 0.5);
            last = u;
            approx::assert_abs_diff_eq!(*y, e, epsilon = 1e-15);
        }
    }
}
