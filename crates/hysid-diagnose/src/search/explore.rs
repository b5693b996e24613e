//! Everything that is looked for on one calibration: test, second look, refits, composition, the sets that were asked for.

use rayon::prelude::*;

use super::Search;
use super::candidate::{Candidate, Columns};
use super::compose::{add, best_of};
use super::detectable::detectability;
use super::finer::finer;
use super::given_up::leaves_more;
use super::prediction::parts;
use super::rounding::rounded;
use crate::budget::Step;
use crate::calibration::fair::recalibrated;
use crate::calibration::lesson::{Done, Lesson, lesson};
use crate::evidence::correlation_time;
use crate::file::DetectableRecord;
use crate::model::base::Base;
use crate::model::hypothesis::{Hypothesis, Key, Setting};
use crate::request::{Hooks, Request, words};
use crate::text::number;

/// What was found on one calibration.
pub struct Explored<'a, 'd> {
    /// The search, under the noise model that decided.
    pub search: Search<'a, 'd>,
    /// Every set that was fitted; the simulation as it is comes first.
    pub pool: Vec<Hypothesis<'d>>,
    /// What could be missing in the simulation as it is.
    pub candidates: Vec<Candidate>,
    /// Whether simulation and recording differ by more than noise does.
    pub significant: bool,
    /// Whether surrogates of the residual show it: what only the second look sees is weaker.
    pub shown: bool,
    /// Of the mismatch test and of the second look, the smaller.
    pub p_value: f64,
    /// What the calibrated simulation leaves of each output (rms).
    pub residual: Vec<f64>,
    /// The least effect that could have been seen, by mechanism.
    pub detectable: Vec<DetectableRecord>,
    /// The simulation as it is where it leaves the least; `None` where that is the first of the pool.
    pub least: Option<Hypothesis<'d>>,
    /// What the user must be told of it.
    pub notes: Vec<String>,
}

/// Searches that may be begun again.
pub const LESSONS: usize = 2;

/// Log evidence by which a set must lead over those that name other families for its lead to be clear.
const CLEAR: f64 = 10.0;

/// Whether no other families come near those of the best set, of sets by their families and evidence; sets of more effects say the same and more.
fn leads_clearly(best: usize, sets: &[(Vec<&str>, f64)]) -> bool {
    let (families, evidence) = &sets[best];
    sets.iter().all(|(f, e)| f == families || f.len() > families.len() || *e <= evidence - CLEAR)
}

/// The families that the set which stands in a pool names, where it leads clearly.
fn clear(pool: &[Hypothesis<'_>]) -> Option<Vec<&'static str>> {
    let best = best_of(pool)?;
    let sets: Vec<(Vec<&str>, f64)> = pool.iter().map(|h| (h.families(), h.log_evidence)).collect();
    leads_clearly(best, &sets).then(|| pool[best].families())
}

/// The number of effects of the best set where these are several and it leads clearly over all sets of fewer, of sets by their size and evidence; 0 where it
/// does not.
fn composed(best: usize, sets: &[(usize, f64)]) -> usize {
    let (effects, evidence) = sets[best];
    let leads = sets.iter().all(|&(size, other)| size >= effects || other <= evidence - CLEAR);
    if effects > 1 && leads { effects } else { 0 }
}

/// The same of the set that stands in a pool.
fn settled(pool: &[Hypothesis<'_>]) -> usize {
    let sets: Vec<(usize, f64)> = pool.iter().map(|h| (h.effects.len(), h.log_evidence)).collect();
    best_of(pool).map_or(0, |best| composed(best, &sets))
}

/// Log evidence by which shorter steps may move the gain of a set and have told nothing.
const MOVED: f64 = 2.0;

/// What each set gains over the simulation without effects.
fn gains(none: &Hypothesis<'_>, sets: &[Hypothesis<'_>]) -> Vec<(Key, f64)> {
    sets.iter().map(|h| (h.key(), h.log_evidence - none.log_evidence)).collect()
}

/// Whether shorter steps tell nothing of sets: those within [`CLEAR`] of the best, with the one steps or the other, gain as much more or less as the likeliest, which comes
/// first, and that gains no less. What all of them gain the simulation without effects has lost.
fn unmoved(before: &[(Key, f64)], now: &[(Key, f64)]) -> bool {
    let both = now.iter().map(|(key, gain)| Some((before.iter().find(|(k, _)| k == key)?.1, *gain)));
    let Some(both) = both.collect::<Option<Vec<(f64, f64)>>>() else { return false };
    let Some(&(first, then)) = both.first() else { return false };
    let highest = |of: fn(&(f64, f64)) -> f64| both.iter().map(of).fold(f64::NEG_INFINITY, f64::max) - CLEAR;
    let (far, farther) = (highest(|b| b.0), highest(|b| b.1));
    let near = both.iter().filter(|(before, now)| *before > far || *now > farther);
    let moved = |(before, now): &(f64, f64)| now - before - (then - first);
    then - first > -MOVED && near.map(moved).all(|m| m.abs() < MOVED)
}

/// Puts what a glance has fitted into a pool, and tells what it was.
fn put<'d>(pool: &mut Vec<Hypothesis<'d>>, fitted: Vec<Hypothesis<'d>>) -> Vec<Key> {
    let keys = fitted.iter().map(Hypothesis::key).collect();
    fitted.into_iter().for_each(|h| add(pool, h));
    keys
}

/// Gives the laws of the likeliest of these sets the forms that have the most evidence under this noise: plain squares, with as many samples as are
/// independent, may have had none for them.
fn reform<'d>(setting: &Setting<'d>, none: &Hypothesis<'d>, sets: &mut [Hypothesis<'d>]) {
    let most = sets.iter().map(|h| h.log_evidence).fold(f64::NEG_INFINITY, f64::max);
    sets.par_iter_mut().filter(|h| h.log_evidence > most - CLEAR).for_each(|set| {
        for index in 0..set.effects.len() {
            if let Some(other) = finer(setting, none, set, index) {
                *set = other;
            }
        }
    });
}

/// Looks for what is missing around a calibrated simulation; where that teaches something of the simulation itself, once more, up to so many
/// times.
pub fn explore<'a, 'd>(
    setting: &Setting<'d>,
    base: Base<'d>,
    request: &Request<'_>,
    hooks: &'a Hooks<'a>,
    lessons: usize,
) -> Explored<'a, 'd> {
    let lesson = match attempt(setting, base, request, hooks, lessons) {
        Ok(found) => return found,
        Err(lesson) => lesson,
    };
    (hooks.progress)(lesson.doing);
    let next = Setting { substeps: lesson.substeps, ..setting.clone() };
    let mut found = explore(&next, lesson.base, request, hooks, lessons - 1);
    found.notes.insert(0, lesson.note);
    found
}

/// The same, up to what it teaches: what a search holds is forgotten before the next one begins.
fn attempt<'a, 'd>(
    setting: &Setting<'d>,
    base: Base<'d>,
    request: &Request<'_>,
    hooks: &'a Hooks<'a>,
    lessons: usize,
) -> Result<Explored<'a, 'd>, Box<Lesson<'d>>> {
    let learned = |search: &Search<'_, 'd>, none: &Hypothesis<'d>, pool: &[Hypothesis<'d>], done: Done| {
        (lessons > 0).then(|| lesson(setting, &search.setting, none, pool, done)).flatten()
    };
    let options = request.options;
    let mut notes = Vec::new();
    let setting = &Setting { rounded: rounded(setting, &base), ..setting.clone() };
    let none = setting.hypothesis(Vec::new(), base);

    (hooks.progress)("looking for what could be missing");
    let evidence = none.base.evidence();
    let mut candidates = setting.lacking(&none, &evidence, Columns::Kept);
    let residual = setting.data.layout.rms(&none.base.fit.residual);
    let detectable = detectability(&candidates);
    let search = Search::new(setting.clone(), options, hooks);
    let test = search.test(&candidates, &none.base, &evidence);
    setting.include_further(&mut candidates, &none);
    let mut p_value = test.p_value;
    // Where the residual is mismatch throughout, the plain sum of squares decides, with as many samples as are independent.
    let tau = correlation_time(&setting.data.layout, &none.base.fit.residual);
    let plainly = Search::new(setting.in_plain_squares(1.0 / (1.0 + 2.0 * tau as f64)), options, hooks);
    let murky = none.base.gross() || none.base.far();
    let shown = test.tells(options.alpha);
    let mut significant = shown;
    // A slight colour matters where nothing is seen under it.
    let colour = none.base.coloured() || none.base.driven() || (!significant && !none.base.whitener.is_white());
    let heard = murky || (colour && !setting.budget.omits(Step::OtherNoise));
    let plain_start = if heard { plainly.start(&none) } else { None };
    let (mut gross, under_white) = if murky { (plain_start, None) } else { (None, plain_start) };
    let mut pool = Vec::new();
    // What of the pool a glance has fitted to the simulation from which the search goes on.
    let mut glanced: Vec<Key> = Vec::new();
    // A coloured noise model takes part of a mismatch for noise: what plain squares would find is heard too.
    if let Some((start, found)) = &under_white {
        (hooks.progress)("refitting the likeliest effects without a noise model");
        pool = search.under_noise(&none, &plainly.glance(start, found));
        reform(setting, &none, &mut pool);
    }
    // Evidence counts all samples alike: where the noise is not, what is fitted gains as much by chance.
    if test.unequal {
        notes.push("the residual is far larger at some samples than at others, and noise that is so at the same samples makes more of the effects there than noise of one size does: evidence is compared with what such noise does".into());
    }
    if !significant && !test.unequal {
        (hooks.progress)("taking a second look");
        let seen = match &gross {
            Some((start, found)) => {
                let fitted = plainly.glance(start, found);
                let seen = plainly.on_blocks(start, &fitted);
                glanced = put(&mut pool, fitted);
                seen
            }
            None => {
                glanced = put(&mut pool, search.glance(&none, &candidates));
                search
                    .by_chance(&none, &pool, candidates.len())
                    .or_else(|| search.by_steps(&none, &pool, candidates.len()))
                    .or_else(|| search.by_rehearsal(&none, &pool, &candidates, under_white.as_ref()))
            }
        };
        if let Some(p) = seen.or_else(|| search.by_terms(&none)) {
            notes.push(format!(
                "surrogates of the residual do not tell the mismatch from noise (p = {}); effects that were fitted to it do (p = {p:.1e})",
                number(test.p_value)
            ));
            p_value = p.min(p_value);
            significant = true;
        }
    }
    if !significant {
        pool.clear();
    }
    // What could be missing in it takes a quarter of the memory of a search.
    let least = under_white.map(|(start, _)| start);
    // Plain squares take what a random force does for mismatch, also where the simulation is linear.
    let mut forced = None;
    let mut set_aside = None;
    if significant && let Some((start, mut found)) = gross.take() {
        plainly.singles(&start, &found, &mut pool, &glanced);
        if let Some(lesson) = learned(&plainly, &start, &pool, Done::Singles) {
            return Err(Box::new(lesson));
        }
        plainly.combine(&start, &mut found, &mut pool, !glanced.is_empty(), 0);
        glanced.clear();
        let sets = search.under_noise(&none, &pool);
        let fine = best_of(&sets).is_some_and(|b| !sets[b].effects.is_empty() && !sets[b].base.gross());
        if fine {
            set_aside = Some((start, found, std::mem::replace(&mut pool, sets)));
        } else {
            forced = search.by_a_force(&none, &sets, found.len());
            significant = forced.is_none();
            gross = Some((start, found));
        }
    }
    if significant && gross.is_none() {
        search.singles(&none, &candidates, &mut pool, &glanced);
        if let Some(lesson) = learned(&search, &none, &pool, Done::Singles) {
            return Err(Box::new(lesson));
        }
        // Where what plain squares have composed leads under the noise model too, only what could stand in its members' place is heard.
        let settled = if set_aside.is_some() { settled(&pool) } else { 0 };
        // Where a random force explains what the likeliest single effects do, sets of them would take it bit by bit.
        forced = search.by_a_force_alone(&none, &pool, candidates.len());
        if forced.is_none() && !search.is_read(&pool) {
            search.combine(&none, &mut candidates, &mut pool, !glanced.is_empty(), settled);
        }
        // A noise model under which the best set explains nothing has taken the mismatch for noise: plain squares decide after all.
        if let Some((start, found, sets)) = set_aside
            && best_of(&pool).is_some_and(|best| leaves_more(&pool[best], &start))
        {
            pool = sets;
            gross = Some((start, found));
            // Of a force plain squares know nothing.
            forced = None;
        }
    }
    let (search, none) = match gross {
        Some((start, found)) if significant => {
            candidates = found;
            (plainly, start)
        }
        _ => (search, none),
    };
    let (search, none) = match learned(&search, &none, &pool, Done::Whole).filter(|_| significant && forced.is_none()) {
        Some(lesson) if lesson.steps_only => {
            (hooks.progress)("fitting the likeliest sets with shorter steps");
            let next = Setting { substeps: lesson.substeps, ..search.setting.clone() };
            let finely = Search::new(next, options, hooks);
            // The next search begins under the first noise model; here everything is judged under the one that decided.
            let Some(base) = recalibrated(&finely.setting, &lesson.base, None) else {
                return Err(Box::new(lesson));
            };
            let coarsely = gains(&none, &pool);
            let none = finely.setting.hypothesis(Vec::new(), base);
            let sets = finely.under_noise(&none, &pool);
            // Where the matter is not as clear with shorter steps, their error may have misled the whole search; not where it has moved nothing.
            let settled = clear(&pool).is_some_and(|families| clear(&sets).is_some_and(|now| now == families))
                || unmoved(&coarsely, &gains(&none, &sets));
            if !settled && !lesson.only_fits {
                return Err(Box::new(lesson));
            }
            notes.push(lesson.fitted_note());
            pool = sets;
            (finely, none)
        }
        Some(lesson) => return Err(Box::new(lesson)),
        None => (search, none),
    };
    if significant && forced.is_none() && parts(&none) {
        forced = search.by_a_force(&none, &pool, candidates.len());
    }
    if let Some(p) = forced {
        notes.push("predicted from sample to sample, the simulation as it is follows the recording better than any set of effects that was fitted to its free run: random forces that act on the machine explain what is left".into());
        (significant, p_value) = (false, p);
        pool.clear();
    }
    if significant && let Some(note) = search.by_rounding(&none, &mut pool, candidates.len()) {
        notes.push(note);
        (significant, p_value) = (false, 1.0);
        pool.clear();
    }
    for question in request.questions {
        (hooks.progress)("weighing what was asked");
        match search.answer(&none, question) {
            Some(h) => add(&mut pool, h),
            None => notes.push(format!("{} could not be fitted", words(question))),
        }
    }
    pool.insert(0, none);
    Ok(Explored { search, pool, candidates, significant, shown, p_value, residual, detectable, least, notes })
}

#[cfg(test)]
mod tests {
    use super::{composed, leads_clearly, unmoved};

    #[test]
    fn shorter_steps_tell_nothing_where_no_gain_moves() {
        let set = |slot: &str, gain: f64| (vec![("delay", slot.to_owned())], gain);
        let before = [set("input:u", 140.0), set("output:y", 139.0), set("input:w", 20.0)];
        assert!(unmoved(&before, &[set("output:y", 139.4), set("input:u", 141.0)]));
        assert!(unmoved(&before, &[set("input:u", 170.0), set("output:y", 169.4)]), "all of them by as much");
        assert!(!unmoved(&before, &[set("input:u", 110.0), set("output:y", 109.0)]), "they lose what they had");
        let other = |gain: f64| unmoved(&before, &[set("input:u", 140.0), set("input:w", gain)]);
        assert!(other(110.0) && !other(132.0), "what is far behind, and what is no more");
        assert!(!unmoved(&before, &[set("output:y", 139.4), set("input:u", 100.0)]));
        assert!(!unmoved(&before, &[set("input:z", 139.4)]) && !unmoved(&before, &[]));
    }

    #[test]
    fn a_composed_set_is_settled_where_it_leads_over_smaller_ones() {
        let of =
            |single: f64, pair: f64, best: usize| composed(best, &[(0, 0.0), (1, single), (2, pair), (2, pair - 1.0)]);
        assert_eq!(of(50.0, 100.0, 2), 2);
        assert_eq!(of(95.0, 100.0, 2), 0);
        assert_eq!(of(50.0, 52.0, 1), 0, "one effect is no composition");
    }

    #[test]
    fn a_lead_is_clear_over_other_families_only() {
        let pair = |evidence| (vec!["clearance", "dry_friction"], evidence);
        let check = |others: &[(Vec<&'static str>, f64)], expected| {
            let sets: Vec<(Vec<&str>, f64)> = std::iter::once(pair(300.0)).chain(others.iter().cloned()).collect();
            assert_eq!(leads_clearly(0, &sets), expected, "{others:?}");
        };
        check(&[], true);
        // Other members of the same families, and sets of more effects, are no other answer.
        check(&[pair(299.0), (vec!["clearance", "dry_friction", "gravity"], 305.0)], true);
        check(&[(vec!["clearance", "presliding"], 289.0), (vec!["presliding"], 100.0)], true);
        check(&[(vec!["clearance", "presliding"], 295.0)], false);
        check(&[(vec!["presliding"], 299.0)], false);
    }
}
