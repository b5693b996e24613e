//! The Prandtl-Ishlinskii operator: a gain and a weighted sum of plays, with its inverse in closed form.
//!
//! `y = w0 u + sum w_i play(r_i)[u]`. Rate-independent, wiping-out, congruent, odd about its start. It is monotone where every
//! partial sum `w0 + w_1 + ... + w_i` is not negative, and has an inverse of the same form where they are all positive.
//! Reference: Kuhnen, "Modeling, identification and compensation of complex hysteretic nonlinearities", Eur. J. Control 9 (2003).

use crate::error::Check;
use crate::{Operator, ParameterError, play};

/// A gain and a weighted sum of plays.
#[derive(Debug, Clone, PartialEq)]
pub struct PrandtlIshlinskii {
    gain: f64,
    plays: Vec<WeightedPlay>,
}

/// One play of a [`PrandtlIshlinskii`] operator.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WeightedPlay {
    /// Half-width, in the unit of the input.
    pub r: f64,
    /// Weight, in units of output over input.
    pub weight: f64,
}

const NAME: &str = "prandtl-ishlinskii";

impl PrandtlIshlinskii {
    /// The operator `gain u + sum weight play(r)[u]`; all plays rest at 0 before the first sample.
    ///
    /// # Errors
    /// A half-width that is not above the one before it (the first: above 0); a number that is not finite; a negative partial
    /// sum of gain and weights, since the output would then fall where the input rises.
    pub fn new(gain: f64, plays: Vec<WeightedPlay>) -> Result<Self, ParameterError> {
        let check = Check(NAME);
        check.not_negative("gain", gain)?;
        let (mut before, mut slope) = (0.0, gain);
        for (i, WeightedPlay { r, weight }) in plays.iter().enumerate() {
            check.finite("r", *r)?;
            check.require(&format!("r[{i}]"), *r, *r > before, &format!("above {before}, the one before it"))?;
            check.finite("weight", *weight)?;
            slope += weight;
            check.require(&format!("the sum of gain and weights up to [{i}]"), slope, slope >= 0.0, "0 or more")?;
            before = *r;
        }
        Ok(Self { gain, plays })
    }

    /// The gain.
    pub fn gain(&self) -> f64 {
        self.gain
    }

    /// The plays, narrowest first.
    pub fn plays(&self) -> &[WeightedPlay] {
        &self.plays
    }

    /// The operator that undoes this one: fed with its output it gives its input.
    ///
    /// # Errors
    /// The gain, or a partial sum of gain and weights, is zero.
    pub fn inverse(&self) -> Result<Self, ParameterError> {
        let check = Check(NAME);
        let what = "above 0 for the inverse";
        check.require("gain", self.gain, self.gain > 0.0, what)?;
        let (mut slope, mut r_inverse, mut r_before) = (self.gain, 0.0, 0.0);
        let mut plays = Vec::with_capacity(self.plays.len());
        for WeightedPlay { r, weight } in &self.plays {
            // The initial loading curve is piecewise linear with breaks at r; its mirror image has them at its values there.
            r_inverse += slope * (r - r_before);
            let next = slope + weight;
            check.require("a partial sum of gain and weights", next, next > 0.0, what)?;
            plays.push(WeightedPlay { r: r_inverse, weight: 1.0 / next - 1.0 / slope });
            (slope, r_before) = (next, *r);
        }
        Ok(Self { gain: 1.0 / self.gain, plays })
    }
}

impl Operator for PrandtlIshlinskii {
    /// The output of each play.
    type State = Vec<f64>;

    fn init(&self) -> Vec<f64> {
        vec![0.0; self.plays.len()]
    }

    fn step(&self, state: &mut Vec<f64>, u: f64) -> f64 {
        let mut y = self.gain * u;
        for (w, WeightedPlay { r, weight }) in state.iter_mut().zip(&self.plays) {
            *w = play(*w, u, *r);
            y += weight * *w;
        }
        y
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn operator() -> PrandtlIshlinskii {
        let plays = [(0.1, 0.5), (0.3, 0.25), (0.8, 1.5)].map(|(r, weight)| WeightedPlay { r, weight });
        PrandtlIshlinskii::new(0.4, plays.to_vec()).unwrap()
    }

    proptest! {
        #[test]
        fn the_inverse_undoes_it_on_either_side(u in prop::collection::vec(-2.0f64..2.0, 1..100)) {
            let (op, inverse) = (operator(), operator().inverse().unwrap());
            for (a, b) in inverse.run(&op.run(&u)).iter().zip(&u) {
                prop_assert!((a - b).abs() < 1e-13);
            }
            for (a, b) in op.run(&inverse.run(&u)).iter().zip(&u) {
                prop_assert!((a - b).abs() < 1e-13);
            }
        }
    }

    #[test]
    fn the_initial_loading_curve_is_piecewise_linear() {
        let y = operator().run(&[0.1, 0.3, 0.8, 1.0]);
        for (y, e) in y.iter().zip([0.04, 0.22, 0.795, 1.325]) {
            approx::assert_abs_diff_eq!(*y, e, epsilon = 1e-14);
        }
    }

    #[test]
    fn bad_parameters_are_refused() {
        let with = |gain, plays: &[(f64, f64)]| {
            PrandtlIshlinskii::new(gain, plays.iter().map(|&(r, weight)| WeightedPlay { r, weight }).collect())
        };
        for (op, expected) in [
            (with(-1.0, &[]), "gain must be"),
            (with(1.0, &[(0.0, 1.0)]), "r[0] must be above 0"),
            (with(1.0, &[(0.2, 1.0), (0.2, 1.0)]), "r[1] must be above 0.2"),
            (with(1.0, &[(0.2, -1.5)]), "the sum of gain and weights up to [0] must be 0 or more"),
            (with(0.0, &[(0.2, 1.0)]).unwrap().inverse(), "gain must be above 0 for the inverse"),
        ] {
            let e = op.unwrap_err().to_string();
            assert!(e.contains(expected), "{e}");
        }
    }
}
