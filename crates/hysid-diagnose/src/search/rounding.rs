//! Whether all that is left is the rounding of a converter.
//!
//! A converter with fine steps is a part of how a machine was recorded and no physics of it: its rounding, and that of noise before it, is what noise there
//! is, and the recorded values lie on its steps. Where noise of another kind is behind it, steps that are coarser than that noise are an effect; so are steps so
//! coarse that the recording is stairs.
//!
//! Reference: B. Widrow, I. Kollár, Quantization Noise, Cambridge University Press (2008), ch. 1.

use rayon::prelude::*;

use super::Search;
use super::candidate::{Candidate, Columns};
use super::compose::{add, best_of};
use super::fitting::refit;
use super::screen::{Along, screen, screen_along};
use crate::budget::Step;
use crate::data::steps::OFF_A_STEP;
use crate::evidence::Projector;
use crate::mechanism::{Mechanism, number_with_unit};
use crate::model::base::Base;
use crate::model::hypothesis::{Effect, Hypothesis, Setting};
use crate::slot::Slot;

/// What is rounded to steps that are told as an effect otherwise.
const ROUNDING: &str = "quantisation";
/// Share of what is left of an output from which on its rounding matters: that of the converter which every recording has does not.
const MATTERS: f64 = 0.1;
/// Log evidence from which on the rounding of converters is what is left, and share of that by which other effects must add to it: where no noise was rounded
/// the right law leaves nothing at most samples and a whole step at a few, and a normal distribution grants much for a handful of these.
const EXPLAINS: f64 = 12.0;
const BESIDE: f64 = 0.05;
/// What is left in steps where one sample of fifty is read as the next step, as what is a tenth of the rounding makes it. The right law does no worse: where
/// it comes near the middle between two steps the last digits of its parameters decide, and a normal distribution grants all there is for each such sample.
const NO_WORSE: f64 = 0.15;
/// Sets that are fitted beside the converters, single effects that are, and log evidence by which sets may trail the best.
const SETS: usize = 8;
const SINGLES: usize = 5;
const TRAIL: f64 = 30.0;

/// An effect that is the rounding of a fine converter.
pub struct Converter {
    /// Its place in the set.
    pub member: usize,
    /// The output that it rounds, and its step.
    output: usize,
    step: f64,
    /// The column and the step, in words.
    words: String,
}

impl Converter {
    /// Several of them, in words.
    fn list(all: &[Self]) -> String {
        all.iter().map(|c| c.words.as_str()).collect::<Vec<_>>().join(" and ")
    }

    /// Why they are not told as effects.
    pub fn note(all: &[Self]) -> String {
        format!(
            "the rounding of the converter to the steps of {} is in the recording too, and is taken for its own: it is no physics that is missing",
            Self::list(all)
        )
    }
}

/// Labels of the outputs of which the recorded values lie on the steps of a fine converter, where its rounding is much of what is left.
pub fn rounded(setting: &Setting<'_>, none: &Base<'_>) -> Vec<String> {
    let left = setting.data.layout.rms(&none.fit.residual);
    let matters =
        |place: usize| setting.data.steps(place).is_some_and(|q| q / 12.0_f64.sqrt() >= MATTERS * left[place]);
    let outputs = setting.original.outputs.iter().enumerate().filter(|(place, _)| matters(*place));
    outputs.map(|(_, output)| format!("output:{}", output.column)).collect()
}

impl Setting<'_> {
    /// What could be missing around a hypothesis. The rounding of fine converters is noise to the search: the step of one that rounds no noise outweighs all
    /// physics, and beside it nothing is found in time.
    pub fn lacking(&self, h: &Hypothesis<'_>, evidence: &(Projector, Vec<f64>), held: Columns) -> Vec<Candidate> {
        let sought = |m: &Mechanism, s: &Slot| m.id != ROUNDING || !self.rounded.contains(&s.label);
        screen_along(&h.base, Along::itself(&h.base), &self.original, &h.effects, evidence, &sought, held)
    }
}

impl<'d> Search<'_, 'd> {
    /// The members of a set that are the rounding of a fine converter on the steps of which the recorded values lie.
    pub fn converters(&self, set: &Hypothesis<'_>) -> Vec<Converter> {
        let values = set.base.values();
        let fine = |(member, effect): (usize, &Effect)| {
            let outputs = &self.setting.original.outputs;
            let place = outputs.iter().position(|o| effect.slot.label == format!("output:{}", o.column))?;
            let step = effect.written.report.first().filter(|_| effect.mechanism.id == ROUNDING)?;
            let q = *values.parameters.get(step.value.symbols().first()?)?;
            let own = self.setting.data.steps(place).is_some_and(|own| (q / own - 1.0).abs() <= OFF_A_STEP);
            let words = format!("`{}` ({})", outputs[place].column, number_with_unit(q, step.unit.as_ref()));
            own.then_some(Converter { member, output: place, step: q, words })
        };
        set.effects.iter().enumerate().filter_map(fine).collect()
    }

    /// Whether a set with the converters of all outputs reads the samples as they were recorded: nothing more can be told.
    pub fn leaves_nothing(&self, set: &Hypothesis<'_>) -> bool {
        let left = self.setting.data.layout.rms(&set.base.fit.residual);
        let converters = self.converters(set);
        converters.len() == left.len() && converters.iter().all(|c| left[c.output] < NO_WORSE * c.step)
    }

    /// The place in a pool of the set that is nothing but those converters of the recording which one of its sets has; `None` where that has none.
    pub fn of_converters(&self, pool: &[Hypothesis<'_>], set: usize) -> Option<usize> {
        let converters = self.converters(&pool[set]);
        let key = pool[set].key_of(|i| converters.iter().any(|c| c.member == i));
        pool.iter().position(|h| !converters.is_empty() && h.key() == key)
    }

    /// A bound for the probability that a fitted set reads the samples as they were recorded where nothing is missing; `None` where no set does, or the
    /// simulation as it is does as well, or nothing is rounded. Where no noise was rounded, rounding hides what the steps themselves tell.
    pub fn by_steps(&self, none: &Hypothesis<'d>, fitted: &[Hypothesis<'d>], candidates: usize) -> Option<f64> {
        if !self.all_in_steps() {
            return None;
        }
        let alone = beside_converters(&self.setting, none).filter(|alone| !self.leaves_nothing(alone))?;
        let best = self.reading(fitted).map(|h| h.log_evidence).reduce(|| f64::NEG_INFINITY, f64::max);
        // A bound is never zero, however many steps tell.
        let chance = (candidates.max(1) as f64 * (alone.log_evidence - best).exp()).max(f64::MIN_POSITIVE);
        (best > alone.log_evidence && chance < self.options.alpha).then_some(chance)
    }

    /// Whether a set of those that were fitted reads the samples as they were recorded: a larger one is not needed.
    pub fn is_read(&self, fitted: &[Hypothesis<'d>]) -> bool {
        self.all_in_steps() && self.reading(fitted).any(|_| true)
    }

    /// Whether the rounding of a fine converter is much of what is left of each output.
    fn all_in_steps(&self) -> bool {
        self.setting.rounded.len() == self.setting.original.outputs.len()
    }

    /// The likeliest of some sets beside the converters, of these the ones that read the samples as they were recorded.
    fn reading<'s>(&'s self, fitted: &'s [Hypothesis<'d>]) -> impl ParallelIterator<Item = Hypothesis<'d>> + 's {
        let beside = worth_a_fit(fitted).into_par_iter().filter_map(|h| beside_converters(&self.setting, h));
        beside.filter(|h| self.leaves_nothing(h))
    }

    /// What to tell where the rounding of fine converters explains what is left, and nothing that was found stands beside it: neither where that is noise as
    /// any other, nor where it is written; `candidates` are so many. What does stand is added to the pool with the converters beside it.
    pub fn by_rounding(
        &self,
        none: &Hypothesis<'d>,
        pool: &mut Vec<Hypothesis<'d>>,
        candidates: usize,
    ) -> Option<String> {
        let alone = beside_converters(&self.setting, none)?;
        let explained = alone.log_evidence - none.log_evidence;
        if explained < EXPLAINS {
            return None;
        }
        let order = worth_a_fit(pool);
        let seen = self.likeliest(none, &order, candidates).is_some_and(|(p, _)| p < self.options.alpha);
        // What rounding hides is seen by its steps, where those of the simulation as it is leave something.
        let heard = seen || !self.leaves_nothing(&alone);
        let setting = &self.setting;
        let mut beside: Vec<Hypothesis<'d>> =
            order.into_par_iter().filter(|_| heard).filter_map(|h| beside_converters(setting, h)).collect();
        beside.retain(|h| seen || self.leaves_nothing(h));
        let complete = beside.iter().filter(|h| self.leaves_nothing(h)).map(|h| h.effects.len()).min();
        beside.retain(|h| complete.is_none_or(|fewest| h.effects.len() <= fewest));
        let least = alone.log_evidence + (EXPLAINS + (candidates.max(1) as f64).ln()).max(BESIDE * explained);
        if beside.iter().any(|h| h.log_evidence > least) {
            beside.into_iter().chain([alone]).for_each(|h| add(pool, h));
            return None;
        }
        Some(format!(
            "what is left is the rounding of the converter to the steps of {}: nothing else is in it, and it is taken for the noise of the recording",
            Converter::list(&self.converters(&alone))
        ))
    }
}

/// The sets of a pool that are worth a fit beside the converters.
fn worth_a_fit<'h, 'd>(pool: &'h [Hypothesis<'d>]) -> Vec<&'h Hypothesis<'d>> {
    let mut order: Vec<&Hypothesis<'d>> = pool.iter().filter(|h| !h.effects.is_empty()).collect();
    order.sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence));
    let best = best_of(pool).map(|b| &pool[b]);
    // Larger sets may follow what a single one leaves of the rounding.
    let (mut singles, mut sets) = (0, 0);
    order.retain(|h| {
        let single = h.effects.len() == 1;
        let near = best.is_some_and(|b| h.log_evidence > b.log_evidence - TRAIL);
        let keep = (single && singles < SINGLES) || (near && sets < SETS);
        singles += usize::from(single);
        sets += usize::from(near);
        keep
    });
    order
}

/// A set with the converters of the recording written into it; `None` where it has none.
fn beside_converters<'d>(setting: &Setting<'d>, set: &Hypothesis<'d>) -> Option<Hypothesis<'d>> {
    let mut found: Option<Hypothesis<'d>> = None;
    for label in &setting.rounded {
        if setting.budget.omits(Step::Fits) {
            return None;
        }
        let parent = found.as_ref().unwrap_or(set);
        let converter = |m: &Mechanism, s: &Slot| m.id == ROUNDING && s.label == *label;
        let evidence = parent.base.evidence();
        let candidates = screen(&parent.base, &setting.original, &parent.effects, &evidence, &converter);
        found = Some(refit(setting, parent, candidates.first()?)?);
    }
    found
}

#[cfg(test)]
mod tests {
    use hysid_plant::Simulation;
    use hysid_signal::range;

    use super::*;
    use crate::budget::Budget;
    use crate::data::DataSet;
    use crate::model::base::NoiseKind;
    use crate::model::hypothesis::{calibrated, recorded};
    use crate::oscillator::{BASELINE, PERIOD, REAL, drive, normal, respond, rms};
    use crate::request::{Hooks, Options};

    /// A recorded oscillator with a further force, the output rounded to so many steps over its range with noise of these shares of a step before that and
    /// behind it, and the step.
    fn converted(steps: f64, [before, behind]: [f64; 2], force: impl Fn(f64, f64) -> f64) -> (DataSet, f64) {
        let mut random = normal(5);
        let u = drive(1500, &mut random);
        let y = respond(&u, REAL, force);
        let (low, high) = range(y.iter().copied());
        let q = (high - low) / steps;
        let mut converted = |y: &f64| q * ((y / q + before * random()).round() + behind * random());
        let y: Vec<f64> = y.iter().map(&mut converted).collect();
        assert!(rms(&y) > q);
        (recorded(&Simulation::parse(BASELINE, "test.sim.toml").unwrap(), PERIOD, [("u_N", u), ("x_m", y)]), q)
    }

    /// What is asked of the search on such a recording, of the simulation as it is and of it with dry friction.
    fn asked<T>(
        steps: f64,
        noise: [f64; 2],
        force: impl Fn(f64, f64) -> f64,
        ask: impl for<'d> FnOnce(&Search<'_, 'd>, &Hypothesis<'d>, Vec<Hypothesis<'d>>) -> T,
    ) -> T {
        let (data, _) = converted(steps, noise, force);
        let budget = Budget::new(&|_| false);
        let original = Simulation::parse(BASELINE, "test.sim.toml").unwrap();
        let (mut setting, none) = calibrated(original, &data, NoiseKind::Coloured, &budget);
        setting.rounded = rounded(&setting, &none.base);
        let search = Search::new(setting, Options::default(), &Hooks::SILENT);
        let friction = search.answer(&none, &vec![("coulomb_friction".to_owned(), "state:v".to_owned())]);
        ask(&search, &none, Vec::from_iter(friction))
    }

    /// Whether the rounding of such a recording is all that is left.
    fn all(steps: f64, noise: [f64; 2], force: impl Fn(f64, f64) -> f64) -> bool {
        asked(steps, noise, force, |search, none, mut pool| search.by_rounding(none, &mut pool, 50).is_some())
    }

    #[test]
    fn a_weak_friction_that_rounding_hides_is_seen_by_the_steps() {
        let seen = |noise: f64, friction: f64| {
            let force = |_: f64, v: f64| friction * v.signum();
            asked(50.0, [noise, 0.0], force, |search, none, pool| {
                assert_eq!(search.is_read(&pool), noise == 0.0, "{noise} {friction}");
                [search.by_chance(none, &pool, 50), search.by_steps(none, &pool, 50)].map(|p| p.is_some())
            })
        };
        assert_eq!(seen(0.0, WEAK), [false, true]);
        assert_eq!(seen(0.3, WEAK), [false, false], "noise that is rounded too");
        assert_eq!(seen(0.0, 0.0), [false, false], "the simulation as it is reads them as well");
    }

    /// A dry friction that changes few of the samples that are read, in N.
    const WEAK: f64 = 0.03;

    #[test]
    fn a_fine_converter_alone_leaves_nothing_and_is_no_mismatch() {
        let nothing = |_: f64, _: f64| 0.0;
        assert!(all(150.0, [0.0, 0.0], nothing));
        assert!(all(50.0, [0.0, 0.0], nothing), "as much as the noise of a sensor");
        assert!(all(150.0, [0.25, 0.0], nothing), "noise that is rounded too");
        assert!(!all(150.0, [0.0, 0.3], nothing), "steps beside a noise of their size");
        assert!(!all(20.0, [0.0, 0.0], nothing), "stairs");
        assert!(!all(150.0, [0.0, 0.0], |_, v| 0.3 * v.signum()), "dry friction besides");
    }

    #[test]
    fn where_samples_are_read_as_they_were_recorded_nothing_more_is_told() {
        let (data, _) = converted(150.0, [0.0, 0.0], |x, _| 2.0 * x.powi(3));
        let budget = Budget::new(&|_| false);
        let original = Simulation::parse(BASELINE, "test.sim.toml").unwrap();
        let (mut setting, none) = calibrated(original, &data, NoiseKind::Coloured, &budget);
        setting.rounded = rounded(&setting, &none.base);
        let search = Search::new(setting, Options::default(), &Hooks::SILENT);
        let asked = |effects: &[(&str, &str)]| {
            let question = effects.iter().map(|(id, slot)| ((*id).to_owned(), (*slot).to_owned())).collect();
            search.answer(&none, &question).unwrap()
        };
        let cubic = ("cubic_stiffness", "state:v");
        let spring = asked(&[cubic]);
        assert!(!search.leaves_nothing(&spring));
        let mut pool = vec![spring, asked(&[cubic, ("output_offset", "output:x_m")])];
        assert!(search.by_rounding(&none, &mut pool, 50).is_none());
        let best = &pool[best_of(&pool).unwrap()];
        assert_eq!((best.effects.len(), best.effects[0].mechanism.id), (2, cubic.0));
        assert!(search.leaves_nothing(best) && search.open(best).is_none());
        assert!(!search.remains(best).tells(0.5));
    }
}
