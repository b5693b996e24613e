//! The second look: what a few fitted sets say of a mismatch that the surrogates do not see.
//!
//! Surrogates are made of the residual itself. Where much of it is mismatch they carry its shape, two effects that cancel each other show in
//! no single score, and the margin that an estimated noise model asks for costs power. A set that is fitted, each with a noise model of its
//! own, is free of all three: what it gains is compared with what the number of sets that were looked at would gain by chance.

use super::Search;
use super::candidate::Candidate;
use super::fitting::refit_all;
use super::joint::superposed;
use super::peaks::lines_of;
use super::rehearsal::by_rehearsal;
use super::rivals::short_list;
use crate::evidence::{NoiseModel, better_by_chance, difference};
use crate::mechanism::SLOW;
use crate::model::base::spared;
use crate::model::hypothesis::{Effect, Hypothesis, block_score};
use crate::openset::ODDS_AGAINST;

/// Effects and pairs that are fitted for a second look.
const LOOKED_AT: (usize, usize) = (5, 4);
/// Sets, the likeliest first, of which one must predict blocks that it was not fitted to before a rehearsal is worth its time.
const MOST_ASKED: usize = 3;
/// Share of the residual's power that an effect must take where the residual is mismatch throughout.
const LARGE: f64 = 0.25;
/// Log evidence that speaks for a set there, without its share of the power.
const SURE: f64 = 15.0;
/// Share of the squared error on held-out blocks that noise never takes away.
const HALF: f64 = 0.5;
/// Moments of a recording that are apart for an effect that begins at one of them.
const MOMENTS: f64 = 25.0;

/// Share of the level that each test of a second look has: sets, rehearsals and generic terms are three tests that a recording must pass in which
/// nothing is missing, beside the surrogates.
const OF_THREE: f64 = 1.0 / 3.0;

impl<'d> Search<'_, 'd> {
    /// The likeliest effects and pairs, fitted; and what is there or not (a sensor that shows the size only), of which no derivative at
    /// nothing tells how likely it is.
    pub fn glance(&self, start: &Hypothesis<'d>, candidates: &[Candidate]) -> Vec<Hypothesis<'d>> {
        let mut list = short_list(candidates, LOOKED_AT.0);
        for c in candidates.iter().filter(|c| c.refit.amplitudes.is_empty() && c.refit.shapes.is_empty()) {
            if c.lacking.is_none() && list.iter().all(|l| l.key() != c.key()) {
                list.push(c);
            }
        }
        let mut fitted = refit_all(&self.setting, start, &list);
        fitted.extend(superposed(&self.setting, start, candidates, LOOKED_AT.1));
        fitted
    }

    /// A bound for the probability that a set gains so much evidence where nothing is missing, if the set predicts blocks that it was not
    /// fitted to no worse than the simulation as it is.
    ///
    /// A ratio of evidences exceeds `x` by chance with a probability of at most `1/x` (Markov);
    /// there are as many sets as can be made of the candidates, and sets of one size that say nearly the same (a dead zone before or behind a valve)
    /// stand together. That the noise model is an estimate is allowed for by [`ODDS_AGAINST`], but not
    /// where a set turns a coloured residual into a white one: there the simulation as it is has the best colour that could be found for it, and the set
    /// has none to choose. A random force has one colour and no choice of it, and a straight line whitens the walk of what integrates. What changes at an
    /// end of the recording may be how it began (a play that the simulation has, and that an earlier input moved).
    pub fn by_chance(&self, start: &Hypothesis<'d>, fitted: &[Hypothesis<'d>], candidates: usize) -> Option<f64> {
        let fitted: Vec<&Hypothesis<'d>> = fitted.iter().collect();
        let (p, best) = self.likeliest(start, &fitted, candidates)?;
        (p < self.level() && self.holds_on_blocks(start, best)).then_some(p)
    }

    /// The same bound whatever it is, with the set that is least by chance.
    pub fn likeliest<'h>(
        &self,
        start: &Hypothesis<'d>,
        fitted: &[&'h Hypothesis<'d>],
        candidates: usize,
    ) -> Option<(f64, &'h Hypothesis<'d>)> {
        let sets = |h: &Hypothesis<'_>| {
            let added = h.effects.iter().filter(|e| !start.effects.iter().any(|known| known.states_the_same(e)));
            let choices = |i: usize| (candidates.saturating_sub(i) as f64 / (i + 1) as f64).max(1.0);
            added.enumerate().map(|(i, e)| choices(i) * self.places_of(e)).product::<f64>()
        };
        // A set that leaves white noise has no colour left to choose: it need not allow for those that noise may have.
        let spared_by = |h: &Hypothesis<'_>| {
            let noise = if h.base.whitener.is_white() { &start.base.whitener } else { &h.base.whitener };
            spared(self.setting.data, noise, &start.base.whitener)
        };
        let evidence = |h: &Hypothesis<'_>| {
            let slow = h.effects.iter().all(|e| e.mechanism.family.is_slow_noise());
            h.log_evidence + spared_by(h) - if slow { SLOW } else { 0.0 }
        };
        let none = start.log_evidence + spared_by(start);
        let coloured = !start.base.whitener.is_white() && !start.base.driven();
        let whitens = |h: &Hypothesis<'_>| coloured && h.base.whitener.is_white();
        let odds = |h: &Hypothesis<'_>| if whitens(h) { 1.0 } else { ODDS_AGAINST };
        let bound = |h: &Hypothesis<'_>| odds(h) * sets(h) * (none - evidence(h)).exp();
        let fitted = || fitted.iter().copied().filter(|h| !h.effects.iter().any(|e| h.changes_at_an_end(e)));
        let best = fitted().min_by(|a, b| bound(a).total_cmp(&bound(b)))?;
        Some((together(fitted().filter(|h| h.effects.len() == best.effects.len()).map(bound)), best))
    }

    /// The level of each test of the second look.
    fn level(&self) -> f64 {
        OF_THREE * self.options.alpha
    }

    /// A bound for the probability that generic terms gain so much where nothing is missing, below the level.
    pub fn by_terms(&self, start: &Hypothesis<'d>) -> Option<f64> {
        self.open(start).map(|o| o.by_chance(ODDS_AGAINST)).filter(|p| *p < self.level())
    }

    /// Squared errors on blocks that they were not fitted to, of the simulation as it is and of a set.
    fn squares_on_blocks(&self, start: &Hypothesis<'d>, set: &Hypothesis<'d>) -> Option<[Vec<f64>; 2]> {
        let squares = |h| block_score(&self.setting, h).map(|(_, squares)| squares);
        Some([squares(start)?, squares(set)?])
    }

    /// Whether a set predicts such blocks better than the simulation as it is.
    fn predicts_blocks(&self, start: &Hypothesis<'d>, set: &Hypothesis<'d>) -> bool {
        self.squares_on_blocks(start, set).is_some_and(|[before, after]| is_less(&after, &before))
    }

    /// Whether a set predicts such blocks no worse, within a standard error: what acts at a few moments only may leave all of them as they are.
    fn holds_on_blocks(&self, start: &Hypothesis<'d>, set: &Hypothesis<'d>) -> bool {
        self.squares_on_blocks(start, set).is_some_and(|[before, after]| {
            is_less(&after, &before) || difference(&after, &before).is_some_and(|(more, error)| more <= error)
        })
    }

    /// The probability, below the level, that the likeliest effects gain so much where nothing is missing, by simulation.
    /// Asked only where the noise is known below the lowest line (of 1/f noise no recording tells how it goes on there, and simulations of
    /// it would promise too much), and where a set of those that were `fitted` predicts blocks better.
    pub fn by_rehearsal(
        &self,
        none: &Hypothesis<'d>,
        fitted: &[Hypothesis<'d>],
        candidates: &[Candidate],
        plain: Option<&(Hypothesis<'d>, Vec<Candidate>)>,
    ) -> Option<f64> {
        let level = self.level();
        let noise = &none.base.whitener;
        if !noise.models.iter().all(NoiseModel::is_known_below) {
            return None;
        }
        let quick = |h: &&Hypothesis<'_>| h.effects.iter().any(|e| !e.mechanism.family.is_slow_noise());
        let mut better: Vec<&Hypothesis<'d>> =
            fitted.iter().filter(quick).filter(|h| h.log_evidence > none.log_evidence).collect();
        better.sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence));
        better.truncate(MOST_ASKED);
        // The rehearsal takes far longer than what else is asked.
        if !better.into_iter().any(|h| self.predicts_blocks(none, h)) {
            return None;
        }
        (self.hooks.progress)("rehearsing on simulated recordings in which nothing is missing");
        by_rehearsal(&self.setting, none, candidates, plain, level, self.options.seed).filter(|p| *p < level)
    }

    /// Places at which an effect was looked for by the residual itself: a line of its spectrum, a moment of the recording.
    pub fn places_of(&self, effect: &Effect) -> f64 {
        lines_of(self.setting.data, &effect.written) * MOMENTS.powi(effect.moments().count() as i32)
    }

    /// The same where the residual is mismatch throughout and no noise model can be had: a set that takes [`LARGE`] of its power or brings
    /// [`SURE`] of log evidence, and predicts blocks that it was not fitted to better, is no accident. Nor is one that leaves [`HALF`] of the
    /// squared error on such blocks, however few they are. The p-value is that of the difference on the blocks.
    pub fn on_blocks(&self, start: &Hypothesis<'d>, fitted: &[Hypothesis<'d>]) -> Option<f64> {
        let best = fitted.iter().max_by(|a, b| a.log_evidence.total_cmp(&b.log_evidence))?;
        let rows = self.setting.noise.share() * self.setting.data.rows() as f64;
        let large = best.base.log_likelihood - start.base.log_likelihood > -0.5 * rows * (1.0 - LARGE).ln();
        if !large && best.log_evidence - start.log_evidence < SURE {
            return None;
        }
        let [before, after] = self.squares_on_blocks(start, best)?;
        // Too few blocks tell nothing of chance; what they tell of the error remains.
        let p = better_by_chance(&before, &after).map_or(1.0, |p| (p * fitted.len() as f64).min(1.0));
        let halved = after.iter().sum::<f64>() < HALF * before.iter().sum::<f64>();
        (p < self.options.alpha || halved).then_some(p)
    }
}

/// Whether some squared errors are less than others, in all.
fn is_less(a: &[f64], b: &[f64]) -> bool {
    a.iter().sum::<f64>() < b.iter().sum::<f64>()
}
/// The bound that sets of one size make together, each of them bounded for the number of sets there are: the mean of their ratios of evidence, those
/// that were not fitted for nothing, has an expectation of one at most where nothing is missing, as each of them has.
fn together(bounds: impl Iterator<Item = f64>) -> f64 {
    bounds.map(|b| 1.0 / b.max(f64::MIN_POSITIVE)).fold(0.0, |a: f64, b| a + b).recip().min(1.0)
}

#[cfg(test)]
mod tests {
    use super::together;
    use crate::oscillator::normal;

    #[test]
    fn sets_that_say_the_same_stand_together() {
        assert_eq!(together([0.02].into_iter()), 0.02);
        assert!((together([0.02, 0.02].into_iter()) - 0.01).abs() < 1e-15);
        assert_eq!(together(std::iter::empty()), 1.0);
        assert!(together([1e-3, 1e9].into_iter()) <= 1e-3);
    }

    #[test]
    fn what_they_bound_together_is_no_more_frequent_by_chance() {
        // Four shifts of a normal variable by nearly the same, where there is none.
        let shifts = [2.0, 2.1, 2.2, 2.3];
        let mut random = normal(7);
        let draws = 20_000;
        for level in [0.1, 0.03] {
            let below = |x: f64| {
                let bounds = shifts.iter().map(|m| shifts.len() as f64 * (0.5 * m * m - m * x).exp());
                together(bounds) < level
            };
            let share = (0..draws).filter(|_| below(random())).count() as f64 / f64::from(draws);
            assert!(share < level && share > 0.0, "{share} at {level}");
        }
    }
}
