//! The Duhem operator in Coleman and Hodgdon's form: the output decays towards a curve as the input moves.
//!
//! `y' = alpha |u'| (f(u) - y) + u' g`, with `f(u) = slope u + rise tanh(u/width)`. Rate-independent; rising and falling
//! branches are `y = f -+` a lag that tends to `(f' - g)/alpha`. With `rise = 0` it is the backlash-like law of Su et al.
//! References: Coleman and Hodgdon, Int. J. Eng. Sci. 24 (1986) 897-919; Su, Stepanenko, Svoboda and Leung, IEEE Trans.
//! Autom. Control 45 (2000) 2427-2432.

use crate::error::Check;
use crate::{Differential, ParameterError};

/// The parameters of a [`Duhem`] operator.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DuhemParameters {
    /// How fast the output decays to the curve, per unit of the input.
    pub alpha: f64,
    /// Slope of the curve far from 0.
    pub slope: f64,
    /// Height of the curve's step about 0.
    pub rise: f64,
    /// Width of that step, in the unit of the input.
    pub width: f64,
    /// Slope of the output where it is on the curve (g): at most `slope`.
    pub g: f64,
}

/// A Duhem operator.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Duhem {
    parameters: DuhemParameters,
}

impl Duhem {
    /// The operator with these parameters, at rest on its curve at input 0.
    ///
    /// # Errors
    /// `alpha` or `width` not above zero; `slope`, `rise` or `g` negative; `g` above `slope` (the loop would run the wrong way).
    pub fn new(parameters: DuhemParameters) -> Result<Self, ParameterError> {
        let DuhemParameters { alpha, slope, rise, width, g } = parameters;
        let check = Check("duhem");
        check.positive("alpha", alpha)?;
        check.not_negative("slope", slope)?;
        check.not_negative("rise", rise)?;
        check.positive("width", width)?;
        check.not_negative("g", g)?;
        check.require("g", g, g <= slope, &format!("at most slope = {slope}"))?;
        Ok(Self { parameters })
    }

    /// The curve `f(u)` that the output decays to.
    pub fn curve(&self, u: f64) -> f64 {
        let DuhemParameters { slope, rise, width, .. } = self.parameters;
        slope * u + rise * (u / width).tanh()
    }
}

impl Differential<1> for Duhem {
    fn initial(&self) -> [f64; 1] {
        [0.0]
    }

    fn derivative(&self, &[y]: &[f64; 1], u: f64, u_dot: f64) -> [f64; 1] {
        let DuhemParameters { alpha, g, .. } = self.parameters;
        [alpha * u_dot.abs() * (self.curve(u) - y) + g * u_dot]
    }

    fn output(&self, &[y]: &[f64; 1], _: f64, _: f64) -> f64 {
        y
    }

    fn fastest_rate(&self, _: &[f64; 1], _: f64, u_dot: f64) -> f64 {
        self.parameters.alpha * u_dot.abs()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Operator, Sampled};

    const PARAMETERS: DuhemParameters = DuhemParameters { alpha: 1.5, slope: 3.0, rise: 0.0, width: 1.0, g: 0.3 };

    #[test]
    fn rising_from_rest_follows_the_closed_form_of_su() {
        // y = c u - (c - g)/alpha (1 - exp(-alpha u)).
        let op = Sampled::new(Duhem::new(PARAMETERS).unwrap(), 1.0, 20).unwrap();
        let u = [0.0, 0.5, 1.0, 2.0, 4.0];
        for (y, u) in op.run(&u).iter().zip(u) {
            let exact = 3.0 * u - 2.7 / 1.5 * (1.0 - (-1.5 * u).exp());
            approx::assert_abs_diff_eq!(*y, exact, epsilon = 1e-5);
        }
    }

    #[test]
    fn bad_parameters_are_refused() {
        assert!(Duhem::new(DuhemParameters { alpha: 0.0, ..PARAMETERS }).is_err());
        assert!(Duhem::new(DuhemParameters { rise: -1.0, ..PARAMETERS }).is_err());
        let e = Duhem::new(DuhemParameters { g: 4.0, ..PARAMETERS }).unwrap_err().to_string();
        assert!(e.contains("g must be at most slope = 3"), "{e}");
    }
}
