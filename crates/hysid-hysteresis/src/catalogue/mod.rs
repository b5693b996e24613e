//! Every operator by its name, with its parameters by theirs: what a command line or a text format needs.
//!
//! [`all`] lists the operators, [`find`] looks one up, [`Entry::build`] makes it from texts such as `beta` and `0.5`. Each entry
//! also says which [`Laws`] its operator obeys with the default parameters; a test runs the conformance suite over all of them.

mod entries;
mod value;

pub use entries::{all, find};
pub use value::{CatalogueError, Kind, Parameter, Values};

use crate::conformance::Laws;
use crate::{DynOperator, ParameterError};

/// One operator of the catalogue.
#[derive(Debug, Clone, Copy)]
pub struct Entry {
    /// Its name, as in `bouc-wen`.
    pub name: &'static str,
    /// What it is, in one line.
    pub summary: &'static str,
    /// Its parameters.
    pub parameters: &'static [Parameter],
    /// What it obeys with the default parameters.
    pub laws: fn() -> Laws,
    make: fn(&Values, f64) -> Made,
}

/// What a table entry makes of its parameters.
type Made = Result<Box<dyn DynOperator>, ParameterError>;

impl Entry {
    /// The operator with these parameters set (name and value as text) and the others at their defaults.
    ///
    /// `period_s` is the sampling period; operators without time pay no heed to it.
    ///
    /// # Errors
    /// A name that this operator does not have, a text that is no value for it, a value that the operator does not allow.
    pub fn build(&self, set: &[(String, String)], period_s: f64) -> Result<Box<dyn DynOperator>, CatalogueError> {
        let values = Values::new(self.name, self.parameters, set)?;
        Ok((self.make)(&values, period_s)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::conformance::{Law, check};
    use proptest::prelude::*;

    proptest! {
        // A seed has no smaller seed that says more: no shrinking.
        #![proptest_config(ProptestConfig { cases: 6, max_shrink_iters: 0, failure_persistence: None, ..Default::default() })]
        #[test]
        fn every_operator_obeys_its_laws(seed: u64) {
            for entry in all() {
                let op = entry.build(&[], 0.01).unwrap_or_else(|e| panic!("{e}"));
                let laws = Laws { seed, ..(entry.laws)() };
                check(op.as_ref(), &laws).unwrap_or_else(|v| panic!("{}: {v}", entry.name));
            }
        }

        #[test]
        fn every_form_of_preisach_obeys_the_laws(seed: u64) {
            let entry = find("preisach").unwrap();
            for (form, density, start) in [
                ("grid", "gaussian", "all-on"),
                ("smooth", "lorentzian", "all-off"),
                ("smooth", "uniform", "demagnetised"),
                ("staircase", "gaussian", "demagnetised"),
            ] {
                let set = [("form", form), ("density", density), ("start", start), ("cells", "11")];
                let set: Vec<_> = set.iter().map(|(k, v)| (k.to_string(), v.to_string())).collect();
                let laws = Laws { seed, ..(entry.laws)() };
                check(entry.build(&set, 1.0).unwrap().as_ref(), &laws).unwrap_or_else(|v| panic!("{set:?}: {v}"));
            }
        }

        #[test]
        fn rate_independent_operators_do_not_know_the_sampling_period(period_s in 1e-4f64..10.0) {
            let u: Vec<f64> = (0..300).map(|n| (0.07 * f64::from(n)).sin() * (0.031 * f64::from(n)).cos()).collect();
            for entry in all().iter().filter(|e| (e.laws)().claimed.contains(&Law::RateIndependent)) {
                let scale = (entry.laws)().upper;
                let u: Vec<f64> = u.iter().map(|u| u * scale).collect();
                let (a, b) = (entry.build(&[], 0.01).unwrap().respond(&u), entry.build(&[], period_s).unwrap().respond(&u));
                let range = a.iter().fold(0.0f64, |m, y| m.max(y.abs()));
                for (a, b) in a.iter().zip(b) {
                    prop_assert!((a - b).abs() <= 1e-6 * range, "{}: {a} {b}", entry.name);
                }
            }
        }
    }

    #[test]
    fn every_parameter_matters_or_is_refused() {
        // A parameter that changes nothing is a mistyped name in the table.
        let u: Vec<f64> =
            (0..400).map(|n| 1.3 * (0.05 * f64::from(n)).sin() * (1.0 + 0.01 * f64::from(n % 7))).collect();
        for entry in all() {
            let scale = if entry.name == "jiles-atherton" { 3000.0 } else { 1.0 };
            let u: Vec<f64> = u.iter().map(|u| u * scale).collect();
            let before = entry.build(&[], 0.01).unwrap().respond(&u);
            for parameter in entry.parameters {
                let others: Vec<String> = match parameter.kind {
                    Kind::Number(v) => vec![if v == 0.0 { 0.01 } else { 1.1 * v }.to_string()],
                    Kind::Count(c) => vec![(c + 1).to_string()],
                    Kind::Choice(choices) => choices[1..].iter().map(|c| (*c).to_string()).collect(),
                };
                for other in others {
                    let mut set = vec![(parameter.name.to_string(), other)];
                    if let Some((name, value)) = parameter.matters_with {
                        set.push((name.to_string(), value.to_string()));
                    }
                    let reference = entry.build(&set[1..], 0.01).unwrap().respond(&u);
                    let after = entry.build(&set, 0.01).unwrap_or_else(|e| panic!("{e}")).respond(&u);
                    // The one exception: the grid is the same operator, only slower.
                    let same = set[0].1 == "grid";
                    assert!((reference == after) == same, "{}: {set:?} changes nothing", entry.name);
                }
            }
            assert!(before.iter().all(|y| y.is_finite()));
        }
    }

    #[test]
    fn bad_parameters_are_named_with_what_is_allowed() {
        let build = |name: &str, key: &str, value: &str| {
            find(name).unwrap().build(&[(key.into(), value.into())], 0.01).err().unwrap().to_string()
        };
        let cases = [
            (build("bouc-wen", "bta", "1"), "bouc-wen has no parameter `bta`; it has a, beta, gamma"),
            (build("bouc-wen", "beta", "x"), "bouc-wen: beta = x is not allowed; beta must be a number"),
            (build("bouc-wen", "beta", "-1"), "beta must be a finite number of 0 or more"),
            (build("preisach", "cells", "2.5"), "cells must be a whole number of 0 or more"),
            (build("preisach", "density", "normal"), "density must be one of uniform, gaussian, lorentzian"),
        ];
        for (found, expected) in cases {
            assert!(found.contains(expected), "{found}");
        }
        assert!(find("nothing").is_none());
    }
}
