//! What is given up: sets that trail too far to be fitted to the end, and sets that explain nothing, whose noise model calls noise what others explain.

use crate::model::hypothesis::Hypothesis;

/// Log evidence by which a candidate may trail after a few iterations, and later after each stage of its fit, and still be refitted to the end.
pub const HOPELESS: f64 = 40.0;
/// Plain error, over that of a set of no more effects, at which a set under a noise model takes mismatch for noise.
const GIVEN_UP: f64 = 1.5;

/// Whether a set leaves a larger plain error than the simulation without effects: its noise model explains, and the effects do not.
pub fn leaves_more(h: &Hypothesis<'_>, none: &Hypothesis<'_>) -> bool {
    plain_error(h, none).1 > plain_error(none, none).1
}

/// The number of effects of a set, and the plain error that it leaves, each output in units of what the simulation without effects leaves of it.
fn plain_error(h: &Hypothesis<'_>, none: &Hypothesis<'_>) -> (usize, f64) {
    let layout = &h.base.model.data().layout;
    let (left, before) = (layout.rms(&h.base.fit.residual), layout.rms(&none.base.fit.residual));
    let error = left.iter().zip(&before).map(|(l, b)| (l / b.max(f64::MIN_POSITIVE)).powi(2)).sum::<f64>().sqrt();
    (h.effects.len(), error)
}

/// Whether a set of so many effects that leaves this error leaves much more than one of these of no more effects.
fn outdone((effects, error): (usize, f64), others: &[(usize, f64)]) -> bool {
    others.iter().any(|&(of, left)| of <= effects && error > GIVEN_UP * left)
}

/// Drops the sets that call noise what others explain, where the simulation is so far off that most of the residual is no noise. A colour can
/// be found for any residual, and the likelihood of a slow one under its own colour is high.
pub fn keep_explaining<'d>(none: &Hypothesis<'d>, pool: &mut Vec<Hypothesis<'d>>) {
    if none.base.far() {
        let errors: Vec<_> = pool.iter().map(|h| plain_error(h, none)).collect();
        let mut all = errors.iter();
        pool.retain(|_| all.next().is_none_or(|own| !outdone(*own, &errors)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_set_that_leaves_what_a_smaller_one_explains_has_given_up() {
        let check = |own, others: &[(usize, f64)], expected| {
            assert_eq!(outdone(own, others), expected, "{own:?} beside {others:?}")
        };
        // A damper: one effect under plain squares, three under a coloured noise.
        check((3, 0.66), &[(1, 0.22), (3, 0.66)], true);
        check((1, 0.22), &[(1, 0.22), (3, 0.66)], false);
        // More effects may leave less.
        check((1, 0.66), &[(2, 0.22)], false);
        check((2, 0.30), &[(1, 0.22)], false);
        check((2, 0.30), &[], false);
    }
}
