//! A signal that goes no further than a limit: the law that actuators and sensors share.

use super::{Amplitudes, Form, Grid, Law, Purpose};

/// A limit of a signal alike on both sides, at one of these quantiles at first, or on one side only: a valve has one stop, and of a converter's ends one
/// may be within reach. A lower limit is counted as far below the median of the signal, `s_o`, as an upper one stands above it: a temperature or a
/// level never comes near zero.
pub(super) fn limited(signal: &'static str, quantiles: &[f64], purpose: Purpose) -> Law {
    let above = || Grid::SignedQuantiles(signal, quantiles.to_vec());
    let at = |text: String, level: Grid| Law::replace(text).shape("s", signal, level).searched();
    let about = |law: Law| law.constant("s_o", signal, Grid::SignedQuantiles(signal, vec![0.5])).silent();
    match purpose {
        Purpose::Screening => about(
            each_side(signal, &format!("{signal} - (2*s_o - s)"))
                .weights(&["a_p", "a_n"])
                .shape("s", signal, above())
                .searched()
                .with_amplitudes(Amplitudes::OfTwoSides),
        ),
        Purpose::Form(Form::Other) => at(format!("min({signal}, s)"), above()).silent().report("s_p", signal, "s"),
        Purpose::Form(Form::Few) => {
            about(at(format!("max({signal}, 2*s_o - s)"), above()).silent()).report("s_n", signal, "2*s_o - s")
        }
        // Two stops, each where it is.
        Purpose::Form(Form::Finer) => {
            let upper = at(format!("max(min({signal}, s), 2*s_o - s_n)"), above()).silent();
            about(upper.shape("s_n", signal, above()).searched().silent()).report("s_p", signal, "s").report(
                "s_n",
                signal,
                "2*s_o - s_n",
            )
        }
        Purpose::Refit | Purpose::Form(_) => {
            at(format!("max(min({signal}, s), -s)"), Grid::Quantiles(signal, quantiles.to_vec()))
        }
    }
}

/// What is above `s`, and what of a signal counted from a lower level is negative, taken off with a share for each side.
pub(super) fn each_side(signal: &str, from_below: &str) -> Law {
    Law::replace(format!("{signal} - a_p*max({signal} - s, 0) - a_n*min({from_below}, 0)"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mechanism::conformance::specimens;
    use crate::mechanism::mechanism;
    use crate::slot::Structure;

    #[test]
    fn a_limit_on_one_side_is_fitted_as_such_at_first() {
        let structure = Structure::of(&specimens().swap_remove(0));
        for id in ["input_saturation", "output_saturation"] {
            let limit = mechanism(id).unwrap();
            let slot = limit.slots(&structure).remove(0);
            let first = |above: f64, below: f64| {
                limit.fitted_first(&slot, &[("a_p".into(), above), ("a_n".into(), below)], &[])
            };
            assert_eq!(first(0.9, 0.8), Purpose::Refit);
            assert_eq!(first(1.1, -0.1), Purpose::Form(Form::Other));
            // Nobody knows of a side that was never reached.
            assert_eq!(first(1.1, 0.0), Purpose::Refit);
            assert_eq!(first(0.02, 0.7), Purpose::Form(Form::Few));
            let text = |purpose| format!("{:?}", limit.law_at(&slot, purpose).change);
            assert!(
                text(Purpose::Form(Form::Other)).contains("min(") && text(Purpose::Form(Form::Few)).contains("max(")
            );
        }
        // A law of one side has none to leave out.
        let friction = mechanism("coulomb_friction").unwrap();
        let slot = friction.slots(&structure).remove(0);
        assert_eq!(friction.fitted_first(&slot, &[("F_c".into(), 1.0)], &[]), Purpose::Refit);
    }
}
