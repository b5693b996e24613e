//! What the tests of models share: coefficients from terms as text.

use hysid_dictionary::Signals;
use hysid_narx::Coefficient;

/// A coefficient for each term and its value, with this standard error; its ERR is not known.
pub fn coefficients(signals: &Signals, terms: &[(&str, f64)], standard_error: f64) -> Vec<Coefficient> {
    terms
        .iter()
        .map(|(t, theta)| Coefficient { term: signals.parse(t).unwrap(), theta: *theta, standard_error, err: f64::NAN })
        .collect()
}
