//! Maxwell slip: springs in parallel, each of which slips at a force of its own.
//!
//! `F = sum k_i e_i`, where `e_i` is the stop of the displacement with limit `F_i/k_i`. Rate-independent, wiping-out, congruent;
//! the loading curve is piecewise linear and the branches are twice as large (Masing). References: Iwan, J. Appl. Mech. 33
//! (1966) 893-900; Lampaert, Al-Bender and Swevers (2003).

use crate::error::Check;
use crate::{Operator, ParameterError, Stop};

/// Springs in parallel that slip.
#[derive(Debug, Clone, PartialEq)]
pub struct MaxwellSlip {
    elements: Vec<(f64, Stop)>,
}

/// One spring of a [`MaxwellSlip`] operator.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SlipElement {
    /// Stiffness, in units of force over displacement.
    pub stiffness: f64,
    /// The force at which it slips.
    pub limit: f64,
}

impl MaxwellSlip {
    /// Springs in parallel; all are free of force at displacement 0 before the first sample.
    ///
    /// # Errors
    /// No element; a stiffness or a limit that is not above zero.
    pub fn new(elements: &[SlipElement]) -> Result<Self, ParameterError> {
        let check = Check("maxwell-slip");
        check.require("the number of elements", elements.len() as f64, !elements.is_empty(), "1 or more")?;
        let stops = elements.iter().map(|element| {
            check.positive("stiffness", element.stiffness)?;
            check.positive("limit", element.limit)?;
            Ok((element.stiffness, Stop::new(element.limit / element.stiffness)?))
        });
        Ok(Self { elements: stops.collect::<Result<_, ParameterError>>()? })
    }
}

impl Operator for MaxwellSlip {
    /// The slip of each element.
    type State = Vec<f64>;

    fn init(&self) -> Vec<f64> {
        vec![0.0; self.elements.len()]
    }

    fn step(&self, slips: &mut Vec<f64>, u: f64) -> f64 {
        self.elements.iter().zip(slips).map(|((k, stop), slip)| k * stop.step(slip, u)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn loading_and_unloading_follow_masing() {
        let op =
            MaxwellSlip::new(&[SlipElement { stiffness: 2.0, limit: 1.0 }, SlipElement { stiffness: 1.0, limit: 2.0 }])
                .unwrap();
        // Loading: 3 u up to 0.5, then slope 1 up to u = 2, then 3. Unloading: the same curve twice as large, downwards.
        let cases = [(0.5, 1.5), (1.0, 2.0), (2.0, 3.0), (5.0, 3.0), (4.0, 0.0), (3.0, -1.0), (1.0, -3.0), (0.0, -3.0)];
        let mut state = op.init();
        for (u, expected) in cases {
            approx::assert_abs_diff_eq!(op.step(&mut state, u), expected, epsilon = 1e-14);
        }
    }

    #[test]
    fn bad_elements_are_refused() {
        assert!(MaxwellSlip::new(&[]).is_err());
        assert!(MaxwellSlip::new(&[SlipElement { stiffness: 0.0, limit: 1.0 }]).is_err());
        assert!(MaxwellSlip::new(&[SlipElement { stiffness: 1.0, limit: -1.0 }]).is_err());
    }
}
