//! How the fit of an effect ends: shapes that least squares cannot move (a time, a period, a knee) are scanned, then all of it is fitted under the
//! noise that is left.

use super::profile::profile_shapes;
use crate::budget::Step;
use crate::model::base::Base;
use crate::model::hypothesis::{Hypothesis, Setting};

/// The end of a fit: shapes that least squares cannot move, of the effects from `from` on, then a round under the hypothesis' own noise.
pub fn finish<'d>(setting: &Setting<'d>, h: &mut Hypothesis<'d>, from: usize) {
    for index in from..h.effects.len() {
        profile_shapes(setting, h, index);
    }
    if setting.budget.omits(Step::Fits) {
        return;
    }
    if let Some(p) = likelier(&h.base, setting.further(&h.base, Some(&h.base.whitener), 1, setting.iterations)) {
        h.base = p;
    }
    if let Some(p) = without_slight_colour(setting, &h.base) {
        h.base = p;
    }
    h.log_evidence = setting.evidence(&h.base);
}

/// Where the noise of a fit has a slight colour: the fit that begins under white noise, if that is likelier.
///
/// The noise model of the simulation without the effect has the colour of what was missing. Fitted under it, parameters may keep a slow error that the
/// noise model passes over, and this error keeps the noise model as it is.
pub fn without_slight_colour<'d>(setting: &Setting<'d>, base: &Base<'d>) -> Option<Base<'d>> {
    let slight = base.whitener.coefficients() > 0 && !base.coloured();
    likelier(base, slight.then(|| setting.further(base, None, 2, setting.iterations))?)
}

/// Another fit of the same simulation, if it is likelier.
pub fn likelier<'d>(base: &Base<'d>, other: Option<Base<'d>>) -> Option<Base<'d>> {
    other.filter(|o| o.log_likelihood > base.log_likelihood)
}
