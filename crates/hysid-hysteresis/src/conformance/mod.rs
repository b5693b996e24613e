//! The laws that operators obey, as a suite that anyone can run on an operator of their own.
//!
//! [`check`] tests what every operator must hold (same input, same output; a run is its steps; a fork goes its own way; finite
//! outputs for finite inputs in the range; no panic on any input), and then each [`Law`] that the caller claims. Inputs are
//! random paths, a function of the seed, over 240 equal steps of the range.
//!
//! ```
//! use hysid_hysteresis::{Play, conformance::{Law, Laws, check}};
//! let laws = Laws::on(-1.0, 1.0).claim([Law::RateIndependent, Law::WipingOut, Law::LagWork]);
//! check(&Play::new(0.3)?, &laws).unwrap();
//! # Ok::<(), hysid_hysteresis::ParameterError>(())
//! ```

mod laws;
mod path;

use crate::DynOperator;

/// A property that some operators have.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Law {
    /// The output depends on the input's path, not on how fast it was gone: time may be stretched and shrunk.
    RateIndependent,
    /// A rise to a former maximum wipes out what was remembered of all that happened since (return-point memory).
    WipingOut,
    /// Minor loops between the same two inputs have the same shape whatever went before.
    Congruent,
    /// Where the input rises the output does not fall, and the other way round.
    Monotone,
    /// The mirrored input gives the mirrored output.
    Odd,
    /// The output stays in this range.
    Bounded {
        /// Lower limit.
        lowest: f64,
        /// Upper limit.
        highest: f64,
    },
    /// Input a displacement, output a force: a closed cycle takes up energy, the integral of y du is not negative.
    Work,
    /// Input a field, output a displacement that lags: a closed cycle takes up energy, the integral of u dy is not negative.
    LagWork,
}

/// What is claimed of an operator, and where.
#[derive(Debug, Clone, PartialEq)]
pub struct Laws {
    /// The range of inputs, lower end.
    pub lower: f64,
    /// The range of inputs, upper end.
    pub upper: f64,
    /// What is allowed as rounding or integration error, as a share of the output's range.
    pub tolerance: f64,
    /// Seed of the random paths.
    pub seed: u64,
    /// The laws beyond those of every operator.
    pub claimed: Vec<Law>,
}

impl Laws {
    /// Only what every operator must hold, for inputs from `lower` to `upper`; tolerance 1e-9.
    pub fn on(lower: f64, upper: f64) -> Self {
        Self { lower, upper, tolerance: 1e-9, seed: 1, claimed: Vec::new() }
    }

    /// These laws as well.
    pub fn claim(mut self, laws: impl IntoIterator<Item = Law>) -> Self {
        self.claimed.extend(laws);
        self
    }

    /// With another tolerance: operators that are integrated need about 1e-6.
    pub fn within(self, tolerance: f64) -> Self {
        Self { tolerance, ..self }
    }
}

/// A law that an operator has broken, and how.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{law} does not hold: {detail}")]
pub struct Violation {
    /// The law.
    pub law: String,
    /// Where it was broken and by how much.
    pub detail: String,
}

/// Tests an operator against the laws of every operator and those that are claimed of it.
///
/// # Errors
/// The first law that it breaks.
pub fn check(op: &dyn DynOperator, laws: &Laws) -> Result<(), Violation> {
    let test = laws::Test::new(op, laws);
    test.every_operator()?;
    laws.claimed.iter().try_for_each(|law| test.law(*law))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BoucWen, Operator, Play, Sampled};

    /// Wraps a play and breaks a law on purpose.
    #[derive(Clone, Copy)]
    enum Broken {
        /// Leaks to zero with every sample.
        Leaking,
        /// Answers with its opposite.
        Inverted,
        /// Adds one.
        Shifted,
        /// Not a number beyond 0.9.
        NotFinite,
    }

    impl Operator for Broken {
        type State = f64;
        fn init(&self) -> f64 {
            0.0
        }
        fn step(&self, w: &mut f64, u: f64) -> f64 {
            *w = crate::play(*w, u, 0.3);
            match self {
                Self::Leaking => {
                    *w *= 0.99;
                    *w
                }
                Self::Inverted => -*w,
                Self::Shifted => *w + 1.0,
                Self::NotFinite if u > 0.9 => f64::NAN,
                Self::NotFinite => *w,
            }
        }
    }

    /// Remembers through a cell shared between runs, which no operator may do.
    struct Shared(std::sync::Mutex<f64>);

    impl Operator for Shared {
        type State = ();
        fn init(&self) {}
        fn step(&self, (): &mut (), u: f64) -> f64 {
            let mut w = self.0.lock().unwrap();
            *w = crate::play(*w, u, 0.3);
            *w
        }
    }

    #[test]
    fn broken_operators_are_caught() {
        let bouc_wen = Sampled::new(BoucWen::piezo(0.0, 1.0, 0.9, 0.5).unwrap(), 1.0, 1).unwrap();
        let shared = Shared(std::sync::Mutex::new(0.0));
        let play = Play::new(0.3).unwrap();
        let cases: [(&dyn DynOperator, Option<Law>, &str); 11] = [
            (&shared, None, "a run is its steps"),
            (&Broken::NotFinite, None, "finite output"),
            (&Broken::Leaking, Some(Law::RateIndependent), "RateIndependent"),
            (&Broken::Leaking, Some(Law::WipingOut), "WipingOut"),
            (&Broken::Leaking, Some(Law::Monotone), "Monotone"),
            (&Broken::Shifted, Some(Law::Odd), "Odd"),
            (&Broken::Inverted, Some(Law::LagWork), "LagWork"),
            (&Broken::Inverted, Some(Law::Monotone), "Monotone"),
            (&play, Some(Law::Work), "Work"),
            (&play, Some(Law::Bounded { lowest: -0.5, highest: 0.5 }), "Bounded"),
            (&bouc_wen, Some(Law::Congruent), "Congruent"),
        ];
        for (op, law, expected) in cases {
            let laws = Laws::on(-1.0, 1.0).claim(law);
            let violation = check(op, &laws).expect_err(expected);
            assert!(violation.law.starts_with(expected), "{violation}");
        }
        let laws = Laws::on(-1.0, 1.0).claim([Law::WipingOut]);
        assert!(check(&bouc_wen, &laws).is_err(), "Bouc-Wen has no return-point memory");
    }
}
