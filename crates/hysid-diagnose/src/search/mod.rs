//! The search for a set of effects: what could be missing, the test, refit of the likeliest, composition.
//!
//! `explore` leads through it. `screen` looks at every mechanism at every slot (`tracked` does so along the recorded motion, `pressed` beside parameters that stand at a bound), `fitting` takes the likeliest
//! from their starts to their finish, `compose` puts effects together, `second_look` asks again where surrogates see nothing. What all of them share is
//! the fitted set and the setting of its fits (`hypothesis`), and the time (`budget`).

pub mod assemble;
pub mod candidate;
pub mod compose;
pub mod detectable;
pub mod explore;
pub mod finer;
pub mod finish;
pub mod fitting;
pub mod gentle;
pub mod given_up;
pub mod joint;
pub mod looks;
pub mod numerics_check;
pub mod outdone;
pub mod parted;
pub mod peaks;
pub mod prediction;
pub mod pressed;
pub mod profile;
pub mod rehearsal;
pub mod ripple;
pub mod rivals;
pub mod rounding;
pub mod screen;
pub mod second_look;
pub mod shaken;
pub mod simpler;
pub mod starts;
pub mod tracked;
pub mod turned;

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

use rayon::prelude::*;

use crate::budget::Step;
use crate::evidence::{
    Contender, FeatureGroup, NoiseModel, Projector, SurrogateTest, TestOptions, doubly, surrogate_test,
};
use crate::mechanism::{Family, Mechanism, SLOW};
use crate::model::base::Base;
use crate::model::hypothesis::{Hypothesis, Key, Setting};
use crate::openset::needed::Refitted;
use crate::openset::{ODDS_AGAINST_MORE, OpenSet, correction};
use crate::request::{Hooks, Options, Question};
use crate::slot::Slot;
use candidate::{Candidate, Columns};
use compose::{Ask, SearchOptions, add, compose};
use fitting::{refit, refit_all, refit_wider};
use given_up::keep_explaining;
use rivals::{include, outdone_by_a_special_case, short_list, unheard};
use screen::screen;
use starts::is_in_a_loop;

/// Composition goes on while the mismatch that remains is significant at this level.
const STOP_LEVEL: f64 = 0.02;
/// Sets that are carried from one noise model to another.
const MOST_CARRIED: usize = 8;
/// Iterations by plain squares before what a noise model may have absorbed is looked at, and how many effects of that kind are fitted.
const PLAIN_ITERATIONS: usize = 5;
const MOST_ABSORBED: usize = 3;
/// Composition goes on too while a candidate scores this much around a hypothesis: surrogates of a residual that is mostly mismatch score as
/// high as the mismatch itself, and their p-value says nothing.
const STOP_SCORE: f64 = 25.0;
/// Rounds in which the rivals of the best single effect are fitted to the end.
const HEARINGS: usize = 2;
/// Candidates that are refitted alone.
const SHORT_LIST: usize = 10;

/// A search for sets of effects on one calibrated simulation.
pub struct Search<'a, 'd> {
    /// What all fits share.
    pub setting: Setting<'d>,
    /// Level and seed of the tests.
    pub options: Options,
    /// Progress and time.
    pub hooks: &'a Hooks<'a>,
    /// Tests of what remains, by statement: composition and the verdict ask for the same ones.
    tests: Mutex<BTreeMap<Key, SurrogateTest>>,
    /// What could be missing around the hypothesis that was tested last: composition mostly extends that one next.
    screened: Mutex<Option<(Key, Vec<Candidate>)>>,
    /// Generic terms, by statement: the second look, composition, the verdict and the correction ask for the same ones.
    open: Mutex<BTreeMap<Key, Option<OpenSet>>>,
    /// Those of the simulation without effects as they were refitted: composition asks whether they outdo what it has reached, the verdict tells them.
    corrected: Mutex<Option<(Key, Refitted<'d>)>>,
}

impl Setting<'_> {
    /// Adds what promises most around a hypothesis along the recorded motion, and where parameters at a bound stay there.
    fn include_further(&self, candidates: &mut Vec<Candidate>, h: &Hypothesis<'_>) {
        candidate::include(candidates, tracked::along_the_recording(self, h));
        candidate::include(candidates, pressed::within_bounds(self, h));
    }
}

impl<'a, 'd> Search<'a, 'd> {
    /// A search that has found nothing yet.
    pub fn new(setting: Setting<'d>, options: Options, hooks: &'a Hooks<'a>) -> Self {
        let (tests, screened, open, corrected) =
            (Mutex::default(), Mutex::default(), Mutex::default(), Mutex::default());
        Self { setting, options, hooks, tests, screened, open, corrected }
    }

    /// The simulation without effects under this search's noise model, and what could be missing in it.
    pub fn start(&self, none: &Hypothesis<'d>) -> Option<(Hypothesis<'d>, Vec<Candidate>)> {
        let base = self.setting.further(&none.base, None, 2, 25)?;
        let start = self.setting.hypothesis(Vec::new(), base);
        let mut candidates = self.setting.lacking(&start, &start.base.evidence(), Columns::Kept);
        self.setting.include_further(&mut candidates, &start);
        Some((start, candidates))
    }

    /// Adds the effects that are fitted alone: the short list without those of the pool that were `glanced` at, its rivals, the numerics.
    pub fn singles(
        &self,
        none: &Hypothesis<'d>,
        candidates: &[Candidate],
        pool: &mut Vec<Hypothesis<'d>>,
        glanced: &[Key],
    ) {
        (self.hooks.progress)("refitting the likeliest effects");
        let mut list = short_list(candidates, SHORT_LIST);
        candidates.iter().filter(|c| is_in_a_loop(c)).for_each(|c| include(&mut list, c));
        list.retain(|c| !glanced.contains(&c.key()));
        for h in refit_all(&self.setting, none, &list) {
            add(pool, h);
        }
        // A drift with an offset is neither of them alone, and both lose to what bends the parameters.
        let beside = |h: &Hypothesis<'d>| refit_all(&self.setting, h, &self.absorbed(h).iter().collect::<Vec<_>>());
        let mut absorbed = beside(none);
        absorbed.extend(absorbed.first().map(beside).unwrap_or_default());
        absorbed.into_iter().for_each(|h| add(pool, h));
        // One hearing may bring another best effect, whose rivals are others.
        let mut given: Vec<Key> = Vec::new();
        for _ in 0..HEARINGS {
            let list = unheard(pool, candidates, &given);
            if list.is_empty() || self.setting.budget.omits(Step::Rivals) {
                break;
            }
            given.extend(list.iter().map(|c| c.key()));
            for h in refit_all(&self.setting, none, &list) {
                add(pool, h);
            }
        }
        let outdone = outdone_by_a_special_case(pool, candidates);
        if !outdone.is_empty() && !self.setting.budget.omits(Step::Rivals) {
            let setting = &self.setting;
            let wider = outdone.par_iter().filter_map(|(i, c)| refit_wider(setting, none, c, &pool[*i]));
            let found: Vec<Hypothesis<'d>> = wider.collect();
            found.into_iter().for_each(|h| add(pool, h));
        }
        if !self.setting.budget.omits(Step::Numerics)
            && let Some(h) = numerics_check::artefact(&self.setting, none)
        {
            add(pool, h);
        }
        keep_explaining(none, pool);
    }

    /// Adds what composition makes of the sets there are; `paired` says whether those are the pairs of a glance too, `settled` of how many effects a set is
    /// there that was composed already, so that none of so many or fewer is looked for but in the place of its members.
    pub fn combine(
        &self,
        none: &Hypothesis<'d>,
        candidates: &mut [Candidate],
        pool: &mut Vec<Hypothesis<'d>>,
        paired: bool,
        settled: usize,
    ) {
        (self.hooks.progress)("looking for a second and third effect");
        // What a coloured noise has taken no test shows.
        let unexplained = |h: &Hypothesis<'d>| self.is_unexplained(h) || h.base.coloured();
        let outdone = |h: &Hypothesis<'d>| self.is_outdone(none, h);
        let bounds = SearchOptions { first: settled.max(1) + 1, depth: 3, beam: 2, most: 6 };
        let count = candidates.len();
        let around = |h: &Hypothesis<'d>, columns| self.around(h, columns);
        let absorbed = |h: &Hypothesis<'d>| self.absorbed(h);
        let plainly = |h: &Hypothesis<'d>| {
            let h = self.plainly(h)?;
            let found = around(&h, Columns::Kept);
            Some((h, found))
        };
        let pushed = |h: &Hypothesis<'d>, sets: &[Hypothesis<'d>]| self.is_pushed_rather(h, sets, count);
        let hear = Ask {
            unexplained: &unexplained,
            around: &around,
            absorbed: &absorbed,
            plainly: &plainly,
            pushed: &pushed,
            outdone: &outdone,
            paired,
        };
        compose(&self.setting, none, candidates, pool, bounds, &hear);
        keep_explaining(none, pool);
        held(&self.screened).take();
    }

    /// The likeliest of these sets, which were found under another noise model, fitted under this search's.
    pub fn under_noise(&self, none: &Hypothesis<'d>, sets: &[Hypothesis<'d>]) -> Vec<Hypothesis<'d>> {
        let setting = &self.setting;
        let mut order: Vec<&Hypothesis<'d>> = sets.iter().collect();
        order.sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence));
        order
            .into_par_iter()
            .take(MOST_CARRIED)
            .enumerate()
            .filter_map(|(i, h)| {
                if i > 0 && setting.budget.omits(Step::OtherNoise) {
                    return None;
                }
                let base = setting.further(&h.base, None, 3, setting.iterations)?;
                (base.log_likelihood > none.base.log_likelihood).then(|| setting.hypothesis(h.effects.clone(), base))
            })
            .collect()
    }

    /// The set that a question names, fitted one effect after the other; `None` where one of them cannot be fitted, or is there already.
    pub fn answer(&self, none: &Hypothesis<'d>, question: &Question) -> Option<Hypothesis<'d>> {
        let mut set: Option<Hypothesis<'d>> = None;
        for (mechanism, slot) in question {
            let parent = set.as_ref().unwrap_or(none);
            let evidence = parent.base.evidence();
            let wanted = |m: &Mechanism, s: &Slot| m.id == *mechanism && s.label == *slot;
            let found = screen(&parent.base, &self.setting.original, &parent.effects, &evidence, &wanted);
            set = Some(refit(&self.setting, parent, found.first()?)?);
        }
        set
    }

    /// Generic terms for what is left of a hypothesis' residual.
    pub fn open(&self, h: &Hypothesis<'_>) -> Option<OpenSet> {
        let key = fitted_key(h);
        if let Some(known) = held(&self.open).get(&key) {
            return known.clone();
        }
        let found = if self.leaves_nothing(h) { None } else { correction(&h.base, self.setting.noise) };
        held(&self.open).insert(key, found.clone());
        found
    }

    /// Whether something significant is left of a hypothesis' residual.
    fn is_unexplained(&self, h: &Hypothesis<'_>) -> bool {
        let test = self.remains(h);
        let seen = test.p_value < STOP_LEVEL || test.statistic > STOP_SCORE;
        seen || self.open(h).is_some_and(|o| o.by_chance(ODDS_AGAINST_MORE) < self.options.alpha)
    }

    /// The test of what remains of a hypothesis' residual.
    pub fn remains(&self, h: &Hypothesis<'_>) -> SurrogateTest {
        let key = fitted_key(h);
        if let Some(known) = held(&self.tests).get(&key) {
            return known.clone();
        }
        if self.leaves_nothing(h) {
            return SurrogateTest::of_nothing();
        }
        let evidence = h.base.evidence();
        let rest = self.setting.lacking(h, &evidence, Columns::Kept);
        let test = self.test(&rest, &h.base, &evidence);
        held(&self.tests).insert(key.clone(), test.clone());
        *held(&self.screened) = Some((key, rest));
        test
    }

    /// What could be missing around a hypothesis.
    fn around(&self, h: &Hypothesis<'_>, columns: Columns) -> Vec<Candidate> {
        let known = held(&self.screened).take_if(|(key, _)| *key == fitted_key(h));
        let looked_for = || self.setting.lacking(h, &h.base.evidence(), columns);
        let mut found = known.map_or_else(looked_for, |(_, candidates)| candidates);
        if columns == Columns::Dropped {
            found.iter_mut().for_each(Candidate::drop_columns);
        }
        self.setting.include_further(&mut found, h);
        found
    }

    /// A hypothesis under white noise; `None` where its noise is white.
    fn plainly(&self, h: &Hypothesis<'d>) -> Option<Hypothesis<'d>> {
        if h.base.whitener.is_white() || self.setting.budget.omits(Step::OtherNoise) {
            return None;
        }
        let plain = self.setting.in_plain_squares(1.0);
        let base = plain.further(&h.base, None, 1, PLAIN_ITERATIONS)?;
        Some(plain.hypothesis(h.effects.clone(), base))
    }

    /// Offsets, drifts, ripples and lines that plain squares see around a hypothesis: a noise that rises towards low frequency holds the ones, an autoregression
    /// predicts the others, and under it their scores are nothing. Fitted beside the effects, each with a noise model of its own, the evidence tells
    /// which it is.
    fn absorbed(&self, h: &Hypothesis<'d>) -> Vec<Candidate> {
        let Some(Hypothesis { base, .. }) = self.plainly(h) else { return Vec::new() };
        let lines = [Family::ExternalDisturbance, Family::PositionRipple];
        let like_noise = |m: &Mechanism, _: &Slot| m.family.is_slow_noise() || lines.contains(&m.family);
        let mut found = screen(&base, &self.setting.original, &h.effects, &base.evidence(), &like_noise);
        found.retain(|c| c.score() > STOP_SCORE);
        found.truncate(MOST_ABSORBED);
        found
    }

    /// The mismatch test over all candidates' kept columns. Where the noise has a colour, what slow noise does has a handicap; where nobody knows
    /// how it goes on below the lowest line, it is no evidence for any effect: what a drift would explain is taken for noise.
    pub fn test(&self, candidates: &[Candidate], base: &Base<'_>, (own, r): &(Projector, Vec<f64>)) -> SurrogateTest {
        let groups_of = |slow: bool| {
            let some = candidates.iter().filter(move |c| c.mechanism.family.is_slow_noise() == slow);
            some.flat_map(|c| c.points.iter().filter_map(|p| p.group.as_ref()))
        };
        let layout = &base.model.data().layout;
        let may_be_noise = !(base.coloured() || base.gross() || base.far());
        let options = TestOptions { alpha: self.options.alpha, seed: self.options.seed, may_be_noise };
        if !base.whitener.models.iter().all(NoiseModel::is_known_below) {
            let drifts = Projector::new(groups_of(true).flat_map(|g| g.columns.iter().map(|c| doubly(c))));
            let rest: Vec<FeatureGroup> = groups_of(false).filter_map(|g| g.outside(&drifts)).collect();
            let groups: Vec<Contender<'_>> = rest.iter().map(|group| Contender { group, handicap: 0.0 }).collect();
            let (mut own, mut r) = (own.clone(), r.clone());
            drifts.remove(&mut r);
            drifts.basis().iter().for_each(|q| {
                own.push(q.clone());
            });
            return surrogate_test(&groups, layout, &own, &r, options);
        }
        // A score is twice a gain in log likelihood.
        let handicap = if base.whitener.is_white() { 0.0 } else { 2.0 * SLOW };
        let quick = groups_of(false).map(|group| Contender { group, handicap: 0.0 });
        let groups: Vec<Contender<'_>> =
            quick.chain(groups_of(true).map(|group| Contender { group, handicap })).collect();
        surrogate_test(&groups, layout, own, r, options)
    }
}

/// What a search holds, whoever asks.
fn held<T>(of: &Mutex<T>) -> MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The statement of a hypothesis with its evidence: a better fit of the same statement is looked at anew.
fn fitted_key(h: &Hypothesis<'_>) -> Key {
    let mut key = h.key();
    key.push(("", format!("{:.3}", h.log_evidence)));
    key
}

#[cfg(test)]
mod tests {
    use hysid_plant::Simulation;

    use super::*;
    use crate::budget::Budget;
    use crate::model::base::NoiseKind;
    use crate::model::hypothesis::{calibrated, recorded};
    use crate::oscillator::{BASELINE, PERIOD, REAL, drive, normal, respond, rms};

    /// What may have been absorbed, and the largest score of the same under the noise model's own eyes, where this is added to an oscillator's
    /// output, in multiples of white noise, by the time in seconds.
    fn absorbed(added: impl Fn(f64) -> f64) -> (Vec<&'static str>, Option<f64>) {
        let mut random = normal(5);
        let u = drive(1000, &mut random);
        let mut y = respond(&u, REAL, |_, _| 0.0);
        let noise = 0.005 * rms(&y);
        y.iter_mut().enumerate().for_each(|(i, y)| *y += noise * (added(i as f64 * PERIOD) + random()));
        let original = Simulation::parse(BASELINE, "test.sim.toml").unwrap();
        let data = recorded(&original, PERIOD, [("u_N", u), ("x_m", y)]);
        let budget = Budget::new(&|_| false);
        let (setting, none) = calibrated(original, &data, NoiseKind::Coloured, &budget);
        let search = Search::new(setting, Options::default(), &Hooks::SILENT);
        let found: Vec<&str> = search.absorbed(&none).iter().map(|c| c.mechanism.id).collect();
        let own = search
            .around(&none, Columns::Dropped)
            .iter()
            .find(|c| found.first() == Some(&c.mechanism.id))
            .map(Candidate::score);
        (found, own)
    }

    #[test]
    fn what_a_noise_model_takes_for_noise_is_seen_by_plain_squares() {
        let (nothing, _) = absorbed(|_| 0.0);
        assert!(nothing.is_empty(), "{nothing:?}");
        let (line, own) = absorbed(|t| 3.0 * (31.0 * t).sin());
        assert!(line.first() == Some(&"periodic_disturbance") && own.unwrap() < 0.0, "{line:?} {own:?}");
        let (slow, own) = absorbed(|t| 1.0 + 0.5 * (0.2 * t).sin());
        assert!(slow.iter().any(|m| m.ends_with("_offset")) && own.unwrap() < STOP_SCORE, "{slow:?} {own:?}");
    }
}
