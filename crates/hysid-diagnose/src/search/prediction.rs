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
use crate::model::hypothesis::{Hypothesis, Setting};
use crate::model::{Model, Values};
use crate::openset::{ODDS_AGAINST, OpenSet};
use crate::refit::LmOptions;

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

impl<'d> Search<'_, 'd> {
    /// The probability, beyond the level, that sets gain by chance what they gain over a simulation on which an unknown force acts; `None` where
    /// there is no such force, or where sets or generic terms tell more than it does.
    pub fn by_a_force(&self, none: &Hypothesis<'d>, pool: &[Hypothesis<'d>], candidates: usize) -> Option<f64> {
        let setting = &self.setting;
        let simulation = none.base.model.simulation();
        if setting.noise != NoiseKind::Coloured || setting.pushed.is_empty() {
            return None;
        }
        let as_it_is = |from: &Base<'d>| predicted(setting, simulation, from);
        let first = as_it_is(&none.base)?;
        let beyond = |b: &Base<'_>| b.log_likelihood - none.base.log_likelihood;
        if beyond(&first) < FORCE {
            return None;
        }
        let mut order: Vec<&Hypothesis<'d>> = pool.iter().filter(|h| !h.effects.is_empty()).collect();
        order.sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence));
        // Where time is up there is some for the likeliest.
        order.truncate(if setting.budget.affords(0.0) { WEIGHED } else { 1 });
        let sets: Vec<(&Hypothesis<'d>, Option<Hypothesis<'d>>)> = order
            .into_iter()
            .map(|h| {
                let base = predicted(setting, h.base.model.simulation(), &h.base);
                (h, base.map(|base| setting.hypothesis(h.effects.clone(), base)))
            })
            .collect();
        // Beside an effect parameters may be reached that predict better without it too.
        let returned = sets.iter().filter_map(|(_, p)| as_it_is(&p.as_ref()?.base));
        let best = returned.fold(first, |a, b| if b.log_likelihood > a.log_likelihood { b } else { a });
        let force = beyond(&best);
        let told = |o: &OpenSet| o.by_chance(ODDS_AGAINST) < self.options.alpha && o.gain > force;
        if self.open(none).as_ref().is_some_and(told) {
            return None;
        }
        let pushed = setting.hypothesis(Vec::new(), best);
        let sets: Vec<&Hypothesis<'d>> = sets
            .iter()
            .map(|(free, p)| p.as_ref().filter(|p| p.log_evidence > free.log_evidence).unwrap_or(free))
            .collect();
        let (p, _) = self.likeliest(&pushed, &sets, candidates)?;
        (p >= self.options.alpha).then_some(p)
    }
}

/// A simulation that predicts each row from those before, with the force under which it does best, fitted from where another one stands.
fn predicted<'d>(setting: &Setting<'d>, document: &Simulation, from: &Base<'d>) -> Option<Base<'d>> {
    let (values, substeps) = (from.values(), from.model.substeps());
    let options = LmOptions::within(ITERATIONS, setting.data.rows());
    let fitted = |strength: f64, values: &Values| {
        let model = Model::new(document, setting.data, substeps).ok()?;
        let theta = model.theta(values);
        let model = model.predicting(&theta, strength)?;
        fit_simulation(model, Start::Values(values), &[], None, ROUNDS, options, setting.noise)
    };
    let all: Vec<(f64, Base<'d>)> =
        STRENGTHS.par_iter().filter_map(|strength| Some((*strength, fitted(*strength, &values)?))).collect();
    let (strength, best) = all.into_iter().max_by(|a, b| a.1.log_likelihood.total_cmp(&b.1.log_likelihood))?;
    // Once more, with the gain of where it went.
    let again = fitted(strength, &best.values()).filter(|b| b.log_likelihood > best.log_likelihood);
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

    /// What is said of an axis in a position loop that sticks at each turn, integrated by hand, under forces of this size (rms, over its friction) which
    /// nobody recorded, with a cogging of this size, where this effect is fitted; and what that gains.
    fn axis(forces: f64, cogging: f64, id: &str) -> (Option<f64>, f64) {
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
        let candidates = screen(&none.base, &setting.original, &[], &none.base.evidence(), &|m, _| m.id == id);
        let set = refit(&setting, &none, &candidates[0]).unwrap();
        let gain = set.log_evidence - none.log_evidence;
        let search = Search::new(setting, Options::default(), &Hooks::SILENT);
        (search.by_a_force(&none, &[set], candidates.len()), gain)
    }

    #[test]
    fn a_random_force_on_what_sticks_is_no_effect() {
        let (explained, gain) = axis(0.3, 0.0, "periodic_disturbance");
        assert!(gain > 20.0 && explained.is_some_and(|p| p > Options::default().alpha), "{gain} {explained:?}");
        // A ripple of the motor is followed by such predictions too, and told far better by its own law.
        let (explained, gain) = axis(0.0, 4.0, "cogging");
        assert!(gain > 100.0 && explained.is_none(), "{gain} {explained:?}");
    }
}
