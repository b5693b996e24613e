//! What is believed of the sets that were fitted: which one is told, how firmly, and what speaks against it.

use super::firmness::{firmness, likelihoods};
use super::remaining::Remaining;
use super::resonance::is_of_the_simulation;
use super::trifles::{Trifle, without_trifles};
use super::veto::{found_too_little, veto};
use super::wanders::{Wanders, is_one_course, wanders};
use super::weigh::*;
use super::{FIRM, Hypothesis as Weighed, Support, verdict};
use crate::file::{RemainingRecord, VerdictKind};
use crate::model::base::Base;
use crate::model::hypothesis::{Effect, Hypothesis, Key, best_place, block_score};
use crate::openset::uneven::{Uneven, uneven};
use crate::search::candidate::Candidate;
use crate::search::compose::best_of;
use crate::search::explore::Explored;
use crate::search::rounding::Converter;

/// What is believed.
pub struct Judgement<'d> {
    weighed: Vec<Weighed>,
    probability: Vec<f64>,
    /// The set that the evidence prefers, without what adds next to nothing, as a place in the pool; the simulation as it is where nothing is significant.
    pub winner: usize,
    /// What adds next to nothing beside it.
    pub trifles: Vec<Trifle>,
    /// What its residual holds.
    pub rest: Remaining<'d>,
    /// The same as it is reported.
    pub remaining: Option<RemainingRecord>,
    /// The set whose effects are told: the winner, or the likeliest one where a mismatch is significant and no set outweighs its price.
    pub told: usize,
    /// How firmly each of them is told.
    pub support: Vec<Support>,
    /// Whether the strength of each member of the winner depends on the motion.
    pub uneven: Vec<Option<Uneven>>,
    /// Whether a parameter wanders in the place of a member of the winner.
    pub wandering: Vec<Option<Wanders>>,
    /// The members of the set told that are the recording's own, and not told as effects.
    pub converters: Vec<Converter>,
    /// What the recording lacks for a firm answer about a member of the winner.
    pub lacking: Vec<Option<String>>,
    /// What speaks against writing the winner into the simulation, in words.
    pub veto: Option<&'static str>,
    /// Whether a mismatch is significant and time was up before a set was found that explains it.
    pub cut_short: bool,
    /// Whether the simulation is so unstable that its free run follows no recording.
    pub runs_away: bool,
    /// The verdict among the sets of the catalogue.
    pub within: VerdictKind,
    /// The verdict.
    pub kind: VerdictKind,
}

/// Probability above which something wanders in the place of an effect rather than not.
const LIKELY: f64 = 0.5;
/// Share of the level below which a mismatch must be that no set and no generic term supports.
const UNSUPPORTED: f64 = 0.5;
/// Share of the mismatch beside which nothing is firm, where a random force explains it.
const MOSTLY: f64 = 0.5;
/// Share of the log evidence that the members which do not wander must bring by themselves to be written without the others.
const STEADY: f64 = 0.5;

impl<'d> Judgement<'d> {
    /// Of what a search found.
    pub fn of(found: &Explored<'_, 'd>) -> Self {
        let Explored { search, pool, candidates, significant, shown, p_value, least, .. } = found;
        let (setting, significant) = (&search.setting, *significant);
        let unfinished = || setting.budget.unfinished();
        // Before the blocks take what is left of the time.
        let outdone =
            unfinished() && significant && best_of(pool).is_some_and(|best| search.is_outdone(&pool[0], &pool[best]));
        let weighed: Vec<Weighed> = pool.iter().map(weigh).collect();
        let mut blocks = block_scores(setting, pool);
        // Under a noise of its own a simulation may leave more than it has to.
        let least = least.as_ref().unwrap_or(&pool[0]);
        let standing = standing(pool, least).filter(|_| significant);
        let preferred = standing.map_or(0, |s| tie_broken(pool, &weighed, s, &blocks));
        // Beside converters of the recording, effects are judged by what they add to these.
        let from = search.of_converters(pool, preferred).unwrap_or(0);
        let (winner, trifles) = without_trifles(pool, preferred, from, least);
        if winner != preferred {
            blocks[winner] = block_score(setting, &pool[winner]);
        }
        let rest = Remaining::of(search, pool, winner, from, significant);
        let probability = likelihoods(pool, &weighed, &blocks, winner, rest.imperfect);
        let mut support = firmness(pool, &weighed, &probability, winner, rest.imperfect);
        let best = &pool[winner];
        // Where something is left, or rivals were not heard, nothing is firm anyway, and what is missing looks like a strength that varies.
        // Where the samples are read as they were recorded, the last digits of two integrators do.
        let uneven = if rest.imperfect || unfinished() || search.leaves_nothing(best) {
            vec![None; best.effects.len()]
        } else {
            uneven(&best.base, setting.noise, &best.effects)
        };
        for (s, u) in support.iter_mut().zip(&uneven) {
            s.discount(u.map_or(0.0, |u| u.probability));
        }
        // Nor is a parameter that changes once told from one that wanders by its name alone.
        let wandering = wanders(search, pool, winner);
        for (s, w) in support.iter_mut().zip(&wandering) {
            s.discount(w.as_ref().map_or(0.0, |w| w.probability));
        }
        // On four turns a play and a sum of plays are one law: what a law needs to be told from its neighbours it needs to be told firmly.
        let lacking = lacking(&pool[0].base, best, candidates);
        support.iter_mut().zip(&lacking).filter(|(_, l)| l.is_some()).for_each(|(s, _)| s.weaken());
        let remaining = rest.record(pool, winner);
        // Where most of the mismatch is left, and a random force explains that, what the effects gain is as likely a part of what the force does.
        let pushed = rest.pushed && remaining.as_ref().is_some_and(|r| r.share > MOSTLY);
        // A search that was cut short has not heard all rivals.
        if unfinished() || rest.is_unequal() || pushed {
            support.iter_mut().for_each(Support::weaken);
        }
        // Where one of several effects that only the second look sees is not known, the others may be parts of the same imitation (development seed
        // 341, 0035: a change, firm, beside a spring; dry friction that depends on the position).
        let converters = search.converters(best);
        // What the verdict is about: but for the rounding of the recording itself.
        let verdict_of = |support: &[Support]| {
            let rounds = |i: &usize| converters.iter().any(|c| c.member == *i);
            let own: Vec<Support> = (0..support.len()).filter(|i| !rounds(i)).map(|i| support[i].clone()).collect();
            verdict(if own.is_empty() { support } else { &own })
        };
        if !shown && support.len() > 1 && verdict_of(&support) == VerdictKind::Ambiguous {
            support.iter_mut().for_each(Support::weaken);
        }
        // A mismatch that is significant stays one, though nothing that was fitted in time explains it.
        let cut_short = significant && winner == 0 && unfinished() && !outdone;
        let mut within = if cut_short { VerdictKind::Ambiguous } else { verdict_of(&support) };
        let elsewhere = uneven.iter().flatten().any(|u| u.probability >= FIRM)
            || wandering.iter().flatten().any(|w| w.is_sure(search.options.alpha));
        let outside = elsewhere || rest.is_outside(&support, remaining.as_ref());
        let runs_away = pool[0].base.model.runs_away(&pool[0].base.fit.theta);
        let veto = match winner {
            0 => None,
            _ if runs_away => Some("what no free run can follow tells nothing of a set of effects"),
            _ => veto(&pool[0], least, best, [&blocks[0], &blocks[winner]])
                .or_else(|| found_too_little(remaining.as_ref().filter(|_| unfinished()), search.options.alpha)),
        };
        if veto.is_some() {
            within = VerdictKind::Ambiguous;
            support.iter_mut().for_each(Support::weaken);
        }
        let mut kind = if outside && (outdone || rest.imitation || !unfinished()) && !runs_away {
            VerdictKind::NotInCatalogue
        } else {
            within
        };
        // What is significant stays so, though no set outweighs its price: the likeliest is told, neither believed nor written. The level is shared by surrogates
        // and sets, so that what only the surrogates see must be below half of it.
        let mut told = if runs_away { 0 } else { winner };
        if significant && *p_value < UNSUPPORTED * search.options.alpha && kind == VerdictKind::NoSignificantMismatch {
            kind = VerdictKind::Ambiguous;
            if let Some(likeliest) = likeliest(&weighed).filter(|_| !runs_away) {
                told = likeliest;
                support = firmness(pool, &weighed, &probability, likeliest, true);
            }
        }
        let converters = if told == winner { converters } else { Vec::new() };
        Self {
            weighed,
            probability,
            winner,
            trifles,
            rest,
            remaining,
            told,
            support,
            uneven,
            wandering,
            converters,
            lacking,
            veto,
            cut_short,
            runs_away,
            within,
            kind,
        }
    }

    /// Whether a mismatch is significant that no set of the catalogue, nor any generic term, outweighs its price in explaining.
    pub fn unexplained(&self) -> bool {
        !self.runs_away && self.within == VerdictKind::NoSignificantMismatch && self.kind == VerdictKind::Ambiguous
    }

    /// The winner without the members in the place of which something wanders, without what else changes there in time, and without those that are
    /// [`overdone`], as a place in the pool; the simulation as it is where the others were not fitted or explain too little.
    pub fn steady(&self, pool: &[Hypothesis<'_>]) -> usize {
        let best = &pool[self.winner];
        let wanders = |i: usize| self.wandering[i].as_ref().is_some_and(|w| w.probability > LIKELY);
        let unsteady = |i: usize| wanders(i) || overdone(&best.base, &best.effects[i]);
        let all = 0..best.effects.len();
        let key = best.key_of(|i| !all.clone().any(|j| unsteady(j) && is_one_course(best, i, j)));
        let sets: Vec<(Key, f64)> = pool.iter().map(|h| (h.key(), h.log_evidence - pool[0].log_evidence)).collect();
        place_of(&sets, &key, STEADY * sets[self.winner].1)
    }

    /// What most likely varies in the place of a member of the winner, in words, where that is likelier than the member.
    pub fn wanders(&self) -> Option<&str> {
        let likely = self.wandering.iter().flatten().filter(|w| w.probability > LIKELY);
        likely.max_by(|a, b| a.probability.total_cmp(&b.probability)).map(|w| w.words.as_str())
    }

    /// The first member of the winner that is [`overdone`].
    pub fn overdone<'p>(&self, pool: &'p [Hypothesis<'_>]) -> Option<&'p Effect> {
        let best = &pool[self.winner];
        best.effects.iter().find(|e| overdone(&best.base, e))
    }

    /// Whether nothing speaks against writing a set of the pool, as nothing must against the winner.
    pub fn may_be_written(found: &Explored<'_, 'd>, set: usize) -> bool {
        let Explored { search, pool, least, .. } = found;
        let (none, set) = (&pool[0], &pool[set]);
        let blocks = [none, set].map(|h| block_score(&search.setting, h));
        let speaks = veto(none, least.as_ref().unwrap_or(none), set, blocks.each_ref());
        speaks.is_none() && !set.effects.iter().any(|e| overdone(&set.base, e))
    }

    /// The sets as they stand against each other.
    pub fn contest<'a>(&'a self, pool: &'a [Hypothesis<'d>]) -> Contest<'a, 'd> {
        Contest { pool, weighed: &self.weighed, probability: &self.probability, winner: self.winner }
    }
}

/// The place of the best set that makes this statement, of sets by statement and gain; the first where it gains no more than the least.
fn place_of(sets: &[(Key, f64)], key: &Key, least: f64) -> usize {
    best_place(sets, key).filter(|&i| sets[i].1 > least).unwrap_or(0)
}

/// What a moment nearer to an end than that may be.
const AT_AN_END: &str =
    "so near to an end of the recording a change is what a state that nobody knows leaves as it dies away";

/// What a resonance may be that the simulation has itself.
const ITS_OWN: &str = "the simulation has this resonance itself: another way into it would look the same";

/// What the recording lacks for a firm answer about each effect of the best set; `None` where nothing is lacking.
fn lacking(none: &Base<'_>, best: &Hypothesis<'_>, candidates: &[Candidate]) -> Vec<Option<String>> {
    let values = best.base.values();
    let told = |e: &Effect| {
        let id = e.mechanism.id;
        let at_an_end = best.changes_at_an_end(e).then_some(AT_AN_END);
        let own = || is_of_the_simulation(none, &best.base, e).then_some(ITS_OWN);
        let shapes = e.written.shapes.iter();
        let confused = shapes.filter_map(|s| s.confused(*values.parameters.get(&s.name)?)).next();
        if let Some(confused) = at_an_end.or(confused).or_else(own) {
            return Some(format!("{id}: this is not firm, since {confused}"));
        }
        let candidate = candidates.iter().find(|c| c.mechanism.id == id && c.slot.is_at(&e.slot))?;
        let lacking = candidate.lacking.as_ref()?;
        Some(format!("{id}: for a firm answer the recording lacks something: {lacking}"))
    };
    best.effects.iter().map(told).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_members_that_stay_are_written_where_they_bring_enough() {
        let key = |ids: &[&'static str]| -> Key { ids.iter().map(|id| (*id, String::new())).collect() };
        let sets =
            [(key(&[]), 0.0), (key(&["a"]), 55.0), (key(&["b"]), 90.0), (key(&["a"]), 60.0), (key(&["a", "b"]), 100.0)];
        assert_eq!(place_of(&sets, &key(&["a"]), 50.0), 3);
        assert_eq!(place_of(&sets, &key(&["a"]), 70.0), 0);
        assert_eq!(place_of(&sets, &key(&["c"]), 50.0), 0);
        assert_eq!(place_of(&sets, &key(&[]), 50.0), 0);
    }
}
