//! Fitting effects: from a candidate of the screening, or a list of them, to a hypothesis.
//!
//! A few iterations tell who is hopeless. The others are fitted from their first start; those that are near the best then go on from their other starts and to
//! their end; of these the ones that are near the best look for another form of their law.

use rayon::prelude::*;

use super::candidate::Candidate;
use super::finer::{finer, inherited};
use super::finish::{finish, likelier};
use super::given_up::HOPELESS;
use super::screen::with_added_starts;
use super::starts::{is_in_a_loop, set, starting_values, starts, strength_in_shapes};
use crate::budget::Step;
use crate::evidence::Whitener;
use crate::model::Values;
use crate::model::base::Base;
use crate::model::hypothesis::{Effect, Hypothesis, Setting};

/// A few iterations from a candidate's best start, the first of `froms`; from the second as well where the law's strength is in its shapes (at the points
/// of the grid it may be far too strong), and from the last two (the user's own parameters and a global calibration) where the fit without the effect is
/// far off.
fn sketch<'d>(
    setting: &Setting<'d>,
    parent: &Hypothesis<'_>,
    candidate: &Candidate,
    froms: &[Values],
) -> Option<Base<'d>> {
    let first = 1 + usize::from(strength_in_shapes(candidate));
    froms
        .iter()
        .enumerate()
        .filter(|(i, _)| *i < first || (*i + 2 >= froms.len() && parent.base.far()))
        .filter_map(|(_, from)| setting.fit(&candidate.refit.simulation, from, Some(&parent.base.whitener), 1, SKETCH))
        .max_by(|a, b| a.log_likelihood.total_cmp(&b.log_likelihood))
}

/// Refits one candidate on top of a hypothesis' simulation.
pub fn refit<'d>(setting: &Setting<'d>, parent: &Hypothesis<'_>, candidate: &Candidate) -> Option<Hypothesis<'d>> {
    refit_from(setting, parent, candidate, &starting_values(setting, parent, candidate))
}

/// Refits a candidate whose law contains that of `special`, from where that one came to rest.
///
/// What both laws name alike, and their shapes in order, begin at its values; amplitudes that only the wider law has begin at zero.
pub fn refit_wider<'d>(
    setting: &Setting<'d>,
    parent: &Hypothesis<'_>,
    wider: &Candidate,
    special: &Hypothesis<'_>,
) -> Option<Hypothesis<'d>> {
    let values = special.base.values();
    let effect = special.effects.last()?;
    let start = starts(wider).into_iter().next()?;
    let names = wider.refit.parameters_of();
    let own: Vec<Option<f64>> =
        names.iter().map(|name| start.iter().find(|(n, _)| n == name).map(|(_, x)| *x)).collect();
    let law = wider.mechanism.law_at(&wider.slot, wider.refit.purpose);
    let mut from = with_added_starts(&values, &wider.refit, &wider.slot, setting.data.stretches.len());
    for (name, x) in names.iter().zip(inherited((wider.mechanism, &law), &own, effect, &values)) {
        if let Some(x) = x {
            set(&mut from, &wider.refit.simulation, name, x);
        }
    }
    refit_from(setting, parent, wider, &[from])
}

/// Refits one candidate from these values.
fn refit_from<'d>(
    setting: &Setting<'d>,
    parent: &Hypothesis<'_>,
    candidate: &Candidate,
    froms: &[Values],
) -> Option<Hypothesis<'d>> {
    let begun = from_the_first(setting, parent, candidate, froms, None);
    let h = from_the_others(setting, parent, candidate, froms, begun)?;
    Some(in_another_form(setting, parent, h))
}

/// A candidate fitted from the first of these values, where `sketched` is a fit from there that has not converged.
fn from_the_first<'d>(
    setting: &Setting<'d>,
    parent: &Hypothesis<'_>,
    candidate: &Candidate,
    froms: &[Values],
    sketched: Option<Base<'d>>,
) -> Option<Base<'d>> {
    let noise = Some(&parent.base.whitener);
    let Some(sketched) = sketched else {
        return setting.fit(&candidate.refit.simulation, froms.first()?, noise, 1, setting.iterations);
    };
    Some(likelier(&sketched, setting.further(&sketched, noise, 1, setting.iterations)).unwrap_or(sketched))
}

/// The same from the others of these values, the best of all taken to its end.
fn from_the_others<'d>(
    setting: &Setting<'d>,
    parent: &Hypothesis<'_>,
    candidate: &Candidate,
    froms: &[Values],
    begun: Option<Base<'d>>,
) -> Option<Hypothesis<'d>> {
    let noise = Some(&parent.base.whitener);
    // Another start must come near the best in a few iterations to be followed.
    let brief = if is_in_a_loop(candidate) { setting.iterations } else { 5 };
    let mut best = begun;
    for from in froms.iter().skip(1) {
        if best.is_some() && setting.budget.omits(Step::Fits) {
            break;
        }
        let Some(mut base) = setting.fit(&candidate.refit.simulation, from, noise, 1, brief) else { continue };
        if best.as_ref().is_none_or(|b| base.log_likelihood > b.log_likelihood - 10.0) {
            base = setting.further(&base, noise, 1, setting.iterations).unwrap_or(base);
        }
        if best.as_ref().is_none_or(|b| base.log_likelihood > b.log_likelihood) {
            best = Some(base);
        }
    }
    let mut h = hypothesis(setting, parent, candidate, best?);
    finish(setting, &mut h, parent.effects.len());
    Some(h)
}

/// A fitted candidate in the form of its law that says most.
fn in_another_form<'d>(setting: &Setting<'d>, parent: &Hypothesis<'_>, h: Hypothesis<'d>) -> Hypothesis<'d> {
    finer(setting, parent, &h, parent.effects.len()).unwrap_or(h)
}

/// A fitted candidate as a hypothesis.
fn hypothesis<'d>(
    setting: &Setting<'d>,
    parent: &Hypothesis<'_>,
    candidate: &Candidate,
    base: Base<'d>,
) -> Hypothesis<'d> {
    let mut effects = parent.effects.clone();
    effects.push(Effect {
        mechanism: candidate.mechanism,
        slot: candidate.slot.clone(),
        written: candidate.refit.clone(),
        concealment: candidate.concealment(),
    });
    setting.hypothesis(effects, base)
}

/// Candidates of a list that are fitted to the end.
const MOST_COMPLETE: usize = 8;

/// Shapes from which on a few iterations tell little of a law: between the points of its grid its likelihood is bent. It goes on by as many as long as each time
/// takes it this share of the way to what it trails.
const BENT: usize = 2;
const CLIMBING: f64 = 0.2;
/// Iterations of a sketch.
const SKETCH: usize = 3;

/// A fit that is taken on by so many iterations under this noise; `None` where it gains nothing.
fn taken_on<'d>(
    setting: &Setting<'d>,
    parent: &Hypothesis<'_>,
    candidate: &Candidate,
    fit: &Hypothesis<'d>,
    noise: &Whitener,
    iterations: usize,
) -> Option<Hypothesis<'d>> {
    let base = setting.further(&fit.base, Some(noise), 1, iterations)?;
    Some(hypothesis(setting, parent, candidate, base)).filter(|h| h.log_evidence > fit.log_evidence)
}

/// A sketch of a law with several shapes that trails, taken on as long as it climbs.
fn climbed<'d>(
    setting: &Setting<'d>,
    parent: &Hypothesis<'_>,
    candidate: &Candidate,
    mut sketched: Hypothesis<'d>,
    threshold: f64,
) -> Hypothesis<'d> {
    if candidate.refit.shapes.len() < BENT {
        return sketched;
    }
    for _ in 0..setting.iterations / SKETCH {
        let short = threshold - sketched.log_evidence;
        if short <= 0.0 || setting.budget.omits(Step::Fits) {
            break;
        }
        let noise = &parent.base.whitener;
        let Some(longer) = taken_on(setting, parent, candidate, &sketched, noise, SKETCH) else { break };
        let gain = longer.log_evidence - sketched.log_evidence;
        sketched = longer;
        if gain < CLIMBING * short {
            break;
        }
    }
    sketched
}

/// A sketch that fits worse than the simulation without its effect is none of the effect's best: it has not come near a minimum, or it was fitted under a noise
/// that is no longer there (where 1/f noise hid a drift, the mean was free). Where the effect promised more than the threshold it is fitted on, under the noise
/// that it leaves.
fn brought_home<'d>(
    setting: &Setting<'d>,
    parent: &Hypothesis<'_>,
    candidate: &Candidate,
    sketched: Hypothesis<'d>,
    threshold: f64,
) -> Hypothesis<'d> {
    let strayed = sketched.log_evidence < threshold && sketched.base.log_likelihood < parent.base.log_likelihood;
    if !strayed || parent.log_evidence + candidate.score() < threshold || setting.budget.omits(Step::Fits) {
        return sketched;
    }
    let own = &sketched.base.whitener;
    taken_on(setting, parent, candidate, &sketched, own, setting.iterations).unwrap_or(sketched)
}

/// The fit of one candidate of a list.
struct UnderWay<'c, 'd> {
    candidate: &'c Candidate,
    froms: Vec<Values>,
    /// As far as it has come; `None` where the simulation diverges.
    fit: Option<Hypothesis<'d>>,
    /// Whether it stays as it is: it is hopeless, or there is no time.
    left: bool,
}

impl<'d> UnderWay<'_, 'd> {
    fn reached(&self) -> Option<f64> {
        self.fit.as_ref().map(|h| h.log_evidence)
    }

    /// Leaves it as it is where it trails; not within a loop.
    fn leave_below(&mut self, threshold: f64) {
        self.left |= self.reached().is_some_and(|e| e < threshold) && !is_in_a_loop(self.candidate);
    }

    /// From a few iterations to the end of the fit from the first start, unless it trails.
    fn begin(&mut self, setting: &Setting<'d>, parent: &Hypothesis<'_>, threshold: f64) {
        if self.left {
            return;
        }
        let candidate = self.candidate;
        let climbed = self.fit.take().map(|h| climbed(setting, parent, candidate, h, threshold));
        self.fit = climbed.map(|h| brought_home(setting, parent, candidate, h, threshold));
        self.leave_below(threshold);
        self.left |= setting.budget.omits(Step::Fits);
        if !self.left {
            let sketched = self.fit.take().map(|h| h.base);
            let begun = from_the_first(setting, parent, candidate, &self.froms, sketched);
            self.fit = begun.map(|base| hypothesis(setting, parent, candidate, base));
        }
    }
}

/// Leaves those as they are that trail the best by too much; of laws with several shapes, whose first start need not lead to the best of their minima,
/// only those that explain nothing.
fn leave_hopeless(all: &mut [UnderWay<'_, '_>], parent: &Hypothesis<'_>) {
    let best = all.iter().filter_map(UnderWay::reached).fold(f64::NEG_INFINITY, f64::max);
    let near = best - HOPELESS;
    for one in all {
        let bent = one.candidate.refit.shapes.len() >= BENT;
        one.leave_below(if bent { near.min(parent.log_evidence) } else { near });
    }
}

/// Refits a short list on top of a hypothesis, in parallel, best evidence first.
pub fn refit_all<'d>(setting: &Setting<'d>, parent: &Hypothesis<'d>, list: &[&Candidate]) -> Vec<Hypothesis<'d>> {
    refit_beside(setting, parent, list, f64::NEG_INFINITY)
}

/// The same where what has less log evidence than `least` after a few iterations is of no interest.
///
/// After a few iterations from the best start, after the fit from it, and after those from the other starts the hopeless ones are left as they are (but within a
/// loop of the simulation). The first is always begun, however little time there is.
pub fn refit_beside<'d>(
    setting: &Setting<'d>,
    parent: &Hypothesis<'d>,
    list: &[&Candidate],
    least: f64,
) -> Vec<Hypothesis<'d>> {
    let sketched = list.par_iter().enumerate().map(|(i, candidate)| {
        if i > 0 && setting.budget.omits(Step::Fits) {
            return UnderWay { candidate, froms: Vec::new(), fit: None, left: true };
        }
        let froms = starting_values(setting, parent, candidate);
        let fit = sketch(setting, parent, candidate, &froms).map(|base| hypothesis(setting, parent, candidate, base));
        UnderWay { candidate, froms, fit, left: false }
    });
    let mut all: Vec<UnderWay<'_, 'd>> = sketched.collect();
    let mut order: Vec<f64> = all.iter().filter_map(UnderWay::reached).collect();
    order.sort_by(|a, b| b.total_cmp(a));
    let best = order.first().copied().unwrap_or(f64::NEG_INFINITY);
    let fourth = order.get(3).copied().unwrap_or(f64::NEG_INFINITY);
    let last = order.get(MOST_COMPLETE - 1).copied().unwrap_or(f64::NEG_INFINITY);
    let threshold = (best - HOPELESS).min(fourth).max(last).max(least);
    all.par_iter_mut().for_each(|one| one.begin(setting, parent, threshold));
    leave_hopeless(&mut all, parent);
    let underway = |one: &&mut UnderWay<'_, 'd>| !one.left;
    all.par_iter_mut().filter(underway).for_each(|one| {
        let begun = one.fit.take().map(|h| h.base);
        one.fit = from_the_others(setting, parent, one.candidate, &one.froms, begun);
    });
    leave_hopeless(&mut all, parent);
    all.par_iter_mut().filter(underway).for_each(|one| {
        one.fit = one.fit.take().map(|h| in_another_form(setting, parent, h));
    });
    let mut out: Vec<Hypothesis<'d>> = all.into_iter().filter_map(|one| one.fit).collect();
    out.sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence));
    out
}

#[cfg(test)]
mod tests {
    use hysid_plant::Simulation;

    use super::*;
    use crate::budget::Budget;
    use crate::model::base::NoiseKind;
    use crate::model::hypothesis::{calibrated, recorded};
    use crate::oscillator::{BASELINE, PERIOD, REAL, drive, normal, respond};
    use crate::search::candidate::Columns;

    #[test]
    fn a_law_with_several_shapes_is_left_only_where_it_explains_nothing() {
        let u = drive(300, &mut normal(1));
        let y = respond(&u, REAL, |_, _| 0.0);
        let original = Simulation::parse(BASELINE, "test.sim.toml").unwrap();
        let data = recorded(&original, PERIOD, [("u_N", u), ("x_m", y)]);
        let budget = Budget::new(&|_| false);
        let (setting, none) = calibrated(original, &data, NoiseKind::White(1.0), &budget);
        let candidates = setting.lacking(&none, &none.base.evidence(), Columns::Kept);
        let with = |bent: bool| candidates.iter().find(|c| (c.refit.shapes.len() >= BENT) == bent).unwrap();
        let one = |bent: bool, gain: f64| {
            let base = setting.further(&none.base, None, 1, 1).unwrap();
            let fit = Hypothesis { log_evidence: none.log_evidence + gain, ..setting.hypothesis(Vec::new(), base) };
            UnderWay { candidate: with(bent), froms: Vec::new(), fit: Some(fit), left: false }
        };
        let mut all = [
            one(false, 900.0),
            one(false, 870.0),
            one(false, 800.0),
            one(true, 800.0),
            one(true, 1.0),
            one(true, -1.0),
        ];
        leave_hopeless(&mut all, &none);
        assert_eq!(all.map(|one| one.left), [false, false, true, false, false, true]);
    }
}
