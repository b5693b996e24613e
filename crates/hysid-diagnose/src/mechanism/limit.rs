//! A signal that goes no further than a limit: the law that actuators and sensors share.

use super::{Form, Grid, Law, Purpose};

/// A limit of a signal alike on both sides, at one of these levels at first, or on one side only: a valve has one stop, and of a converter's ends one may
/// be within reach.
pub(super) fn limited(signal: &'static str, level: Grid, purpose: Purpose) -> Law {
    let at = |text: String, level: Grid| Law::replace(text).shape("s", signal, level).searched();
    // The level of one side may have either sign.
    let one_sided = |text: String| {
        let levels = Grid::Values(vec![-2.0, -1.2, -0.6, -0.2, 0.2, 0.6, 1.2, 2.0, 3.0]);
        at(text, levels).within(-6.0, 6.0).silent()
    };
    match purpose {
        Purpose::Screening => {
            each_side(signal).weights(&["a_p", "a_n"]).shape("s", signal, level).searched().of_two_sides()
        }
        Purpose::Form(Form::Other) => one_sided(format!("min({signal}, s)")).report("s_p", signal, "s"),
        Purpose::Form(Form::Few) => one_sided(format!("max({signal}, -s)")).report("s_n", signal, "-s"),
        // Two stops, each where it is.
        Purpose::Form(Form::Finer) => at(format!("max(min({signal}, s), -s_n)"), level.clone())
            .silent()
            .shape("s_n", signal, level)
            .searched()
            .silent()
            .report("s_p", signal, "s")
            .report("s_n", signal, "-s_n"),
        Purpose::Refit | Purpose::Form(_) => at(format!("max(min({signal}, s), -s)"), level),
    }
}

/// What is beyond a level taken off with a share for each side.
pub(super) fn each_side(signal: &str) -> Law {
    Law::replace(format!("{signal} - a_p*max({signal} - s, 0) - a_n*min({signal} + s, 0)"))
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
            let first =
                |above: f64, below: f64| limit.fitted_first(&slot, &[("a_p".into(), above), ("a_n".into(), below)]);
            assert_eq!(first(0.9, 0.8), Purpose::Refit);
            assert_eq!(first(1.1, -0.1), Purpose::Form(Form::Other));
            assert_eq!(first(0.02, 0.7), Purpose::Form(Form::Few));
            let text = |purpose| format!("{:?}", limit.law_at(&slot, purpose).change);
            assert!(
                text(Purpose::Form(Form::Other)).contains("min(") && text(Purpose::Form(Form::Few)).contains("max(")
            );
        }
        // A law of one side has none to leave out.
        let friction = mechanism("coulomb_friction").unwrap();
        let slot = friction.slots(&structure).remove(0);
        assert_eq!(friction.fitted_first(&slot, &[("F_c".into(), 1.0)]), Purpose::Refit);
    }
}
