//! The relay (Schmitt trigger): two outputs, one threshold for going up and a lower one for coming down.
//!
//! Up where `u >= upper`, down where `u <= lower`, as before in between. Rate-independent, wiping-out. Reference:
//! Mayergoyz, *Mathematical Models of Hysteresis* (1991).

use crate::error::Check;
use crate::{Operator, ParameterError};

/// Which of its two outputs a relay gives.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum RelayState {
    /// The lower output.
    Down,
    /// The upper output.
    Up,
}

impl RelayState {
    /// -1 when down, 1 when up.
    #[inline]
    pub fn sign(self) -> f64 {
        match self {
            Self::Down => -1.0,
            Self::Up => 1.0,
        }
    }
}

/// The relay's next state from its last one and the input, with `lower <= upper`.
#[inline]
pub fn relay(last: RelayState, u: f64, lower: f64, upper: f64) -> RelayState {
    if u >= upper {
        RelayState::Up
    } else if u <= lower {
        RelayState::Down
    } else {
        last
    }
}

/// A relay with outputs -1 and 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Relay {
    lower: f64,
    upper: f64,
    start: RelayState,
}

impl Relay {
    /// A relay that goes to 1 where `u >= upper` and to -1 where `u <= lower`, and is in state `start` before the first sample.
    ///
    /// # Errors
    /// A threshold is not finite, or `lower > upper`.
    pub fn new(lower: f64, upper: f64, start: RelayState) -> Result<Self, ParameterError> {
        let check = Check("relay");
        check.finite("lower", lower)?;
        check.finite("upper", upper)?;
        check.require("lower", lower, lower <= upper, &format!("at most upper = {upper}"))?;
        Ok(Self { lower, upper, start })
    }
}

impl Operator for Relay {
    type State = RelayState;

    fn init(&self) -> RelayState {
        self.start
    }

    #[inline]
    fn step(&self, state: &mut RelayState, u: f64) -> f64 {
        *state = relay(*state, u, self.lower, self.upper);
        state.sign()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_switches_at_its_thresholds_and_holds_between() {
        let r = Relay::new(-1.0, 1.0, RelayState::Down).unwrap();
        let cases =
            [(0.9, -1.0), (1.0, 1.0), (-0.9, 1.0), (-1.0, -1.0), (0.0, -1.0), (5.0, 1.0), (0.0, 1.0), (-5.0, -1.0)];
        let mut state = r.init();
        for (u, expected) in cases {
            assert_eq!(r.step(&mut state, u), expected, "at u = {u}");
        }
    }

    #[test]
    fn thresholds_out_of_order_are_refused() {
        let e = Relay::new(1.0, -1.0, RelayState::Up).unwrap_err();
        assert_eq!(e.to_string(), "relay: lower = 1 is not allowed; lower must be at most upper = -1");
    }
}
