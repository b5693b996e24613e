//! How the fit of an effect ends: shapes that least squares cannot move (a time, a period, a knee) are scanned, then all of it is fitted under the
//! noise that is left.

use super::profile::profile_shapes;
use crate::budget::Step;
use crate::model::hypothesis::{Hypothesis, Setting};

/// The end of a fit: shapes that least squares cannot move, of the effects from `from` on, then a round under the hypothesis' own noise.
pub fn finish<'d>(setting: &Setting<'d>, h: &mut Hypothesis<'d>, from: usize) {
    for index in from..h.effects.len() {
        profile_shapes(setting, h, index);
    }
    if setting.budget.omits(Step::Fits) {
        return;
    }
    let polished = setting.further(&h.base, Some(&h.base.whitener), 1, setting.iterations);
    if let Some(p) = polished
        && p.log_likelihood > h.base.log_likelihood
    {
        h.base = p;
    }
    h.log_evidence = setting.evidence(&h.base);
}
