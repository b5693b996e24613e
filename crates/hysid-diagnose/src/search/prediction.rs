//! Whether an unknown force that acts on the machine explains what effects were fitted to.
//!
//! A simulation that runs free answers a random force as the machine does only while both are in the same state. In a machine that sticks, slips or
//! meets a stop they part, and what is left is no noise of any spectrum: a change, an offset, a resonance takes some of it. What predicts each sample
//! from those before stays with the machine, and of the force there remains what came since: the likelihood of such predictions is that of the
//! recording, force and all. Simulation and sets are therefore weighed once more, each by the better of the two, running free or predicting.
//!
//! Reference: L. Ljung, System Identification: Theory for the User, 2nd ed. (1999), sec. 7.4 (innovations; process noise asks for a predictor).

use hysid_plant::Simulation;
use rayon::prelude::*;

use super::Search;
use crate::model::base::{Base, NoiseKind, Start, fit_simulation};
use crate::model::force::forgets;
use crate::model::hypothesis::{Hypothesis, Setting};
use crate::model::{Model, Values};
use crate::openset::{ODDS_AGAINST, OpenSet};
use crate::refit::LmOptions;
use crate::slot::is_linear;

/// How strong the unknown force may be, over the inputs.
const STRENGTHS: [f64; 10] = [0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0];
/// Log likelihood by which predictions of the simulation as it is must be better than its free run for a force to be there: more than the choice of its
/// strength brings.
const FORCE: f64 = 12.0;
/// Sets, the likeliest first, that are weighed against it.
const WEIGHED: usize = 4;
/// Rounds of unknowns and noise by turns, and iterations in each.
const ROUNDS: usize = 2;
const ITERATIONS: usize = 12;
/// Iterations that tell at which strengths it does well, and how many of these are fitted to the end.
const SKETCH: usize = 2;
const LIKELY: usize = 2;

/// Whether a simulation parts from its machine where a force that nobody recorded acts on that. One that is linear never does: the noise of its free run is
/// that of the force, and what predictions follow better is no noise of any spectrum, but a change, a shape, a memory. Nor does one that forgets where it was.
pub fn parts(h: &Hypothesis<'_>) -> bool {
    !is_linear(h.base.model.simulation()) && !forgets(&h.base.model, &h.base.fit.theta)
}

/// A set of effects, running free and predicting.
struct Weighed<'h, 'd> {
    free: &'h Hypothesis<'d>,
    predicting: Option<Hypothesis<'d>>,
}

impl<'d> Weighed<'_, 'd> {
    /// The better of the two.
    fn better(&self) -> &Hypothesis<'d> {
        self.predicting.as_ref().filter(|p| p.log_evidence > self.free.log_evidence).unwrap_or(self.free)
    }
}

impl<'d> Search<'_, 'd> {
    /// The probability, beyond the level, that sets gain by chance what they gain over a simulation on which an unknown force acts; `None` where
    /// there is no such force, or where sets or generic terms tell more than it does.
    pub fn by_a_force(&self, none: &Hypothesis<'d>, pool: &[Hypothesis<'d>], candidates: usize) -> Option<f64> {
        self.told_by_a_force(none, self.pushed(none)?, pool, candidates)
    }

    /// The same with the simulation as it predicts under the force.
    fn told_by_a_force(
        &self,
        none: &Hypothesis<'d>,
        pushed: Base<'d>,
        pool: &[Hypothesis<'d>],
        candidates: usize,
    ) -> Option<f64> {
        (self.hooks.progress)("weighing a random force against the likeliest effects");
        let sets = pool.iter().filter(|h| !h.effects.is_empty()).collect();
        let (pushed, sets) = self.beside_a_force(none, pushed, sets);
        let force = pushed.base.log_likelihood - none.base.log_likelihood;
        let told = |o: &OpenSet| o.by_chance(ODDS_AGAINST) < self.options.alpha && o.gain > force;
        if self.open(none).as_ref().is_some_and(told) {
            return None;
        }
        let sets: Vec<&Hypothesis<'d>> = sets.iter().map(Weighed::better).collect();
        let (p, _) = self.likeliest(&pushed, &sets, candidates)?;
        (p >= self.options.alpha).then_some(p)
    }

    /// Whether an unknown force that acts on the machine explains what the likeliest of these sets, all of more effects, add to one that stands.
    pub fn is_pushed_rather(&self, stands: &Hypothesis<'d>, wider: &[Hypothesis<'d>], candidates: usize) -> bool {
        let Some(pushed) = self.pushed_apart(stands) else { return false };
        let (pushed, sets) = self.beside_a_force(stands, pushed, wider.iter().collect());
        let sets: Vec<&Hypothesis<'d>> = sets.iter().map(Weighed::better).collect();
        self.likeliest(&pushed, &sets, candidates).is_some_and(|(p, _)| p >= self.options.alpha)
    }

    /// What predictions of a set gain in log likelihood over its free run under an unknown force that acts on the machine; `None` where no such force shows.
    pub fn force_on(&self, set: &Hypothesis<'d>) -> Option<f64> {
        self.pushed_apart(set).map(|base| base.log_likelihood - set.base.log_likelihood)
    }

    /// The probability that [`Search::by_a_force`] gives single effects, where not even the likeliest of them adds anything to such a force: sets of several
    /// would take it bit by bit.
    pub fn by_a_force_alone(
        &self,
        none: &Hypothesis<'d>,
        singles: &[Hypothesis<'d>],
        candidates: usize,
    ) -> Option<f64> {
        let pushed = self.setting.hypothesis(none.effects.clone(), self.pushed_apart(none)?);
        let free: Vec<&Hypothesis<'d>> = singles.iter().filter(|h| !h.effects.is_empty()).collect();
        // What tells more than the force while it runs free need not be asked what it predicts.
        let (p, _) = self.likeliest(&pushed, &free, candidates)?;
        if p < 1.0 {
            return None;
        }
        self.told_by_a_force(none, pushed.base, singles, candidates).filter(|p| *p >= 1.0)
    }

    /// [`Search::pushed`] where such a force parts the simulation from its machine.
    fn pushed_apart(&self, set: &Hypothesis<'d>) -> Option<Base<'d>> {
        if parts(set) { self.pushed(set) } else { None }
    }

    /// A set that predicts each row under an unknown force, fitted from its free run; `None` where no such force shows.
    fn pushed(&self, set: &Hypothesis<'d>) -> Option<Base<'d>> {
        if self.setting.noise != NoiseKind::Coloured || self.setting.pushed.is_empty() {
            return None;
        }
        let base = predicted(&self.setting, set.base.model.simulation(), &set.base)?;
        (base.log_likelihood > set.base.log_likelihood + FORCE).then_some(base)
    }

    /// What stands, predicting each row under an unknown force, as it was `pushed` first, and the likeliest of these sets of more effects.
    fn beside_a_force<'h>(
        &self,
        stands: &Hypothesis<'d>,
        pushed: Base<'d>,
        mut wider: Vec<&'h Hypothesis<'d>>,
    ) -> (Hypothesis<'d>, Vec<Weighed<'h, 'd>>) {
        let setting = &self.setting;
        wider.sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence));
        // Where time is up there is some for the likeliest.
        wider.truncate(if setting.budget.affords(0.0) { WEIGHED } else { 1 });
        let weighed = |free: &'h Hypothesis<'d>| {
            let base = predicted(setting, free.base.model.simulation(), &free.base);
            Weighed { free, predicting: base.map(|base| setting.hypothesis(free.effects.clone(), base)) }
        };
        let sets: Vec<Weighed<'h, 'd>> = wider.into_iter().map(weighed).collect();
        // Beside an effect parameters may be reached that predict better without it too.
        let as_it_is = |from: &Base<'d>| predicted(setting, stands.base.model.simulation(), from);
        let returned = sets.iter().filter_map(|set| as_it_is(&set.predicting.as_ref()?.base));
        let best = returned.fold(pushed, |a, b| if b.log_likelihood > a.log_likelihood { b } else { a });
        (setting.hypothesis(stands.effects.clone(), best), sets)
    }
}

/// A simulation that predicts each row from those before, with the force under which it does best, fitted from where another one stands.
fn predicted<'d>(setting: &Setting<'d>, document: &Simulation, from: &Base<'d>) -> Option<Base<'d>> {
    let (values, substeps) = (from.values(), from.model.substeps());
    let fitted = |strength: f64, values: &Values, rounds: usize, iterations: usize| {
        let options = LmOptions::within(iterations, setting.data.rows());
        let model = Model::new(document, setting.data, substeps).ok()?;
        let theta = model.theta(values);
        let model = model.predicting(&theta, strength)?;
        fit_simulation(model, Start::Values(values), &[], None, rounds, options, setting.noise)
    };
    let at = |strengths: &[f64], rounds: usize, iterations: usize| -> Vec<(f64, Base<'d>)> {
        let all = strengths.par_iter().filter_map(|&s| Some((s, fitted(s, &values, rounds, iterations)?)));
        let mut all: Vec<(f64, Base<'d>)> = all.collect();
        all.sort_by(|a, b| b.1.log_likelihood.total_cmp(&a.1.log_likelihood));
        all
    };
    let likely: Vec<f64> = at(&STRENGTHS, 1, SKETCH).iter().take(LIKELY).map(|(strength, _)| *strength).collect();
    let (strength, best) = at(&likely, ROUNDS, ITERATIONS).into_iter().next()?;
    // Once more, with the gain of where it went.
    let again = fitted(strength, &best.values(), ROUNDS, ITERATIONS).filter(|b| b.log_likelihood > best.log_likelihood);
    Some(again.unwrap_or(best))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::Budget;
    use crate::model::hypothesis::{calibrated, recorded};
    use crate::oscillator::normal;
    use crate::request::{Hooks, Options};
    use crate::search::fitting::refit;
    use crate::search::screen::screen;

    const FRICTION: f64 = 8.0;
    /// Effects that could be missing there, about.
    const CANDIDATES: usize = 30;

    /// Asks about an axis in a position loop that sticks at each turn, integrated by hand, under forces of this size (rms, over its friction) which
    /// nobody recorded, with a cogging of this size.
    fn axis<T>(forces: f64, cogging: f64, ask: impl for<'d> FnOnce(&Search<'_, 'd>, &Hypothesis<'d>) -> T) -> T {
        let text = "[time]\nperiod_s = 0.01\n[inputs]\nr = \"ref_m\"\n[parameters]\nm = { value = 5.0, min = 1.0, max = 16.0, unit = \"kg\" }\n\
                    c = { value = 30.0, min = 9.0, max = 90.0, unit = \"N s/m\" }\nFc = { value = 8.0, min = 2.0, max = 30.0, unit = \"N\" }\n[states]\n\
                    x = { derivative = \"v\", initial = 0.0, unit = \"m\" }\n\
                    v = { derivative = \"(3000*(r - x) - 120*v - c*v - Fc*sign(v))/m\", initial = 0.0, unit = \"m/s\" }\n[outputs]\nx_mm = \"1000*x\"\n";
        let original = Simulation::parse(text, "axis.sim.toml").unwrap();
        let mut random = normal(3);
        let n = 2000;
        let r: Vec<f64> =
            (0..n).map(|i| 0.004 * (0.021 * f64::from(i)).sin() + 0.003 * (0.047 * f64::from(i) + 1.0).sin()).collect();
        let (mut x, mut v, mut force, steps) = (0.0_f64, 0.0_f64, 0.0_f64, 40);
        let mut y = Vec::new();
        for pair in r.windows(2).chain([[r[r.len() - 1]; 2].as_slice()]) {
            y.push(1000.0 * x + 0.02 * random());
            force = 0.9 * force + FRICTION * forces * (1.0_f64 - 0.81).sqrt() * random();
            for i in 0..steps {
                let (dt, share) = (0.01 / f64::from(steps), f64::from(i) / f64::from(steps));
                let target = pair[0] + share * (pair[1] - pair[0]);
                let ripple = cogging * (std::f64::consts::TAU * x / 0.0023).sin();
                let pull = 3000.0 * (target - x) - 150.0 * v + force - ripple;
                if v == 0.0 && pull.abs() <= FRICTION {
                    continue;
                }
                let sliding = if v == 0.0 { pull.signum() } else { v.signum() };
                let next = v + dt * (pull - FRICTION * sliding) / 5.0;
                v = if next * sliding < 0.0 { 0.0 } else { next };
                x += dt * v;
            }
        }
        let data = recorded(&original, 0.01, [("ref_m", r), ("x_mm", y)]);
        let budget = Budget::new(&|_| false);
        let (setting, none) = calibrated(original, &data, NoiseKind::Coloured, &budget);
        ask(&Search::new(setting, Options::default(), &Hooks::SILENT), &none)
    }

    /// What stands with this effect.
    fn with<'d>(search: &Search<'_, 'd>, stands: &Hypothesis<'d>, id: &str) -> Hypothesis<'d> {
        let (setting, base) = (&search.setting, &stands.base);
        let candidates = screen(base, &setting.original, &stands.effects, &base.evidence(), &|m, _| m.id == id);
        refit(setting, stands, &candidates[0]).unwrap()
    }

    #[test]
    fn a_random_force_on_what_sticks_is_no_effect() {
        let explained = |forces, cogging, id: &str| {
            axis(forces, cogging, |search, none| {
                let set = with(search, none, id);
                let gain = set.log_evidence - none.log_evidence;
                let sets = [set];
                (search.by_a_force(none, &sets, CANDIDATES), search.by_a_force_alone(none, &sets, CANDIDATES), gain)
            })
        };
        let (by, alone, gain) = explained(0.3, 0.0, "periodic_disturbance");
        assert!(gain > 20.0 && by.is_some_and(|p| p > Options::default().alpha), "{gain} {by:?}");
        assert_eq!(alone, by, "nothing is left of it beside the force");
        // A ripple of the motor is followed by such predictions too, and told far better by its own law.
        let (by, alone, gain) = explained(0.0, 4.0, "cogging");
        assert!(gain > 100.0 && by.is_none() && alone.is_none(), "{gain} {by:?}");
    }

    #[test]
    fn nor_is_one_beside_an_effect() {
        // What the wider set gains, what the force gains without it, and whether that explains the set.
        let beside = |forces, first: &str, second: &str| {
            axis(forces, 4.0, |search, none| {
                let stands = with(search, none, first);
                let set = with(search, &stands, second);
                let gain = set.log_evidence - stands.log_evidence;
                (gain, search.force_on(&stands), search.is_pushed_rather(&stands, &[set], CANDIDATES))
            })
        };
        let (gain, force, explained) = beside(0.3, "cogging", "periodic_disturbance");
        assert!(gain > 10.0 && force.is_some_and(|f| f > gain) && explained, "{gain} {force:?}");
        // A ripple that is there gains less than the force, and as much beside it.
        let (gain, force, explained) = beside(0.1, "asymmetric_friction", "cogging");
        assert!(gain > 50.0 && force.is_some_and(|f| f > gain) && !explained, "{gain} {force:?}");
        let (_, force, explained) = beside(0.0, "cogging", "periodic_disturbance");
        assert!(force.is_none() && !explained, "{force:?}");
    }
}
