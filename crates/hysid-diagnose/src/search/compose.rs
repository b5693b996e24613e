//! Composition of effects: pairs found together, a beam over sets, backward drops and swaps.

use rayon::prelude::*;

use super::assemble::{Part, SKETCH, assemble, carried_on, without};
use super::candidate::{Candidate, Columns};
use super::finer::{finer, inherited};
use super::fitting::{refit_all, refit_beside};
use super::joint::{fitted_pairs, likeliest_pairs, superposed};
use super::looks::{Looks, Seen};
use super::parted::parted;
use super::rivals::{include, rivals_of, short_list};
use super::simpler::simplify;
use super::turned::turned;
use crate::budget::Step;
use crate::model::hypothesis::{Effect, Hypothesis, Setting};

/// How a search is bounded.
#[derive(Debug, Clone, Copy)]
pub struct SearchOptions {
    /// Effects of the smallest sets that are looked for.
    pub first: usize,
    /// Most effects in a set.
    pub depth: usize,
    /// Sets that are extended at each depth.
    pub beam: usize,
    /// Candidates that are refitted for each set.
    pub most: usize,
}

/// What composition asks of the search that it is a part of.
pub struct Ask<'a, 'd> {
    /// Whether something significant is left of a hypothesis' residual.
    pub unexplained: &'a dyn Fn(&Hypothesis<'d>) -> bool,
    /// What could be missing around a hypothesis.
    pub around: &'a (dyn Fn(&Hypothesis<'d>, Columns) -> Vec<Candidate> + Sync),
    /// Effects that its noise model may have taken for noise.
    pub absorbed: &'a (dyn Fn(&Hypothesis<'d>) -> Vec<Candidate> + Sync),
    /// The hypothesis under white noise, with what could be missing around it there; `None` where its noise is white.
    pub plainly: &'a dyn Fn(&Hypothesis<'d>) -> Option<(Hypothesis<'d>, Vec<Candidate>)>,
    /// Whether an unknown force on the machine explains what sets of more effects add to one that stands.
    pub pushed: &'a dyn Fn(&Hypothesis<'d>, &[Hypothesis<'d>]) -> bool,
    /// Whether generic terms explain so much more than a set that no further effect makes up for it.
    pub outdone: &'a dyn Fn(&Hypothesis<'d>) -> bool,
    /// Whether pairs of what could be missing in the simulation without effects were fitted before.
    pub paired: bool,
}

/// Log evidence that another effect must add.
pub const LEAST_GAIN: f64 = 4.0;

/// Most rounds of drops and swaps: one may bring another best set, whose members have other rivals.
const ROUNDS: usize = 4;

/// Log evidence by which what is fitted in the place of a member may trail the best set after a few iterations and still be fitted to the end.
const FAR_BEHIND: f64 = 100.0;

/// Log evidence by which the second best set may trail and still have its members' rivals heard.
const NEARLY: f64 = 6.0;

/// Candidates that are fitted where the test sees nothing more, and the score from which on they are.
const UNSEEN: (usize, f64) = (3, 16.0);

/// A set with one more effect where no test sees anything more: surrogates of what is left carry the effect itself. One that was found among so many
/// by looking at the residual must pay for their number.
fn unseen<'d>(setting: &Setting<'d>, parent: &Hypothesis<'d>, candidates: &[Candidate]) -> Vec<Hypothesis<'d>> {
    let likely = candidates.iter().filter(|c| c.score() > UNSEEN.1 && !c.mechanism.family.is_slow_noise());
    let list: Vec<&Candidate> = likely.take(UNSEEN.0).collect();
    let least = parent.log_evidence + LEAST_GAIN + (candidates.len().max(1) as f64).ln();
    let mut found = refit_all(setting, parent, &list);
    found.retain(|h| h.log_evidence > least);
    found
}

/// Extends the hypotheses of `pool` (all of one effect or more) until evidence stops growing, prunes the best and tries swaps.
///
/// `candidates` are those of the simulation without effects; their columns are dropped once its likeliest pairs are known. All hypotheses that were fitted stay in the pool: the verdict's probabilities are over them.
pub fn compose<'d>(
    setting: &Setting<'d>,
    none: &Hypothesis<'d>,
    candidates: &mut [Candidate],
    pool: &mut Vec<Hypothesis<'d>>,
    options: SearchOptions,
    ask: &Ask<'_, 'd>,
) {
    let Ask { unexplained, around, absorbed, .. } = ask;
    let enough = || setting.budget.omits(Step::Composition);
    let mut looks = Looks::default();
    let likeliest =
        if ask.paired || options.first > 2 || enough() { Vec::new() } else { likeliest_pairs(none, candidates) };
    // A long recording's are hundreds of megabytes, and those around a set of effects are as many.
    candidates.iter_mut().for_each(Candidate::drop_columns);
    for depth in options.first..=options.depth {
        if enough() {
            return;
        }
        // Where nothing significant is left there is nothing to add but what the noise model holds.
        let Some(standing) = best_below(pool, depth).filter(|&b| pool[b].effects.len() + 1 >= depth) else { break };
        let more = unexplained(&pool[standing]);
        if more && (ask.outdone)(&pool[standing]) {
            return;
        }
        let best = pool[standing].log_evidence;
        let parents = beam(pool, depth - 1, options.beam);
        let mut found = if depth == 2 { parted(setting, none, pool, candidates) } else { Vec::new() };
        if more && depth == 2 {
            found.extend(fitted_pairs(setting, none, candidates, &likeliest, options.most));
        }
        if !more {
            found.extend(unseen(setting, &pool[standing], &around(&pool[standing], Columns::Dropped)));
        }
        let beside = |&p: &usize| {
            let mut seen = Seen::default();
            if enough() {
                return seen;
            }
            let parent = &pool[p];
            if more {
                let candidates = around(parent, Columns::Dropped);
                let list = worth_adding(&candidates, options.most, None);
                seen.found.extend(refit_all(setting, parent, &list));
                seen.fitted.extend(list.iter().map(|c| c.key()));
                seen.fresh = Some(candidates);
            }
            seen.found.extend(refit_all(setting, parent, &absorbed(parent).iter().collect::<Vec<_>>()));
            seen
        };
        let extended: Vec<_> = parents.par_iter().map(beside).collect();
        for (&p, seen) in parents.iter().zip(extended) {
            found.extend(looks.keep(&pool[p], seen));
        }
        if found.is_empty() {
            break;
        }
        found.extend(turned(setting, none, &found, pool));
        let reached = found.iter().map(|h| h.log_evidence).fold(f64::NEG_INFINITY, f64::max);
        // What moves the machine at random is in its free run, where further effects take some of it, one after the other. Two that are there take more of it together
        // than a force can.
        if reached >= best + LEAST_GAIN && (ask.pushed)(&pool[standing], &found) {
            let room = depth < options.depth && !enough();
            let together = if room { two_at_once(setting, &pool[standing], options, ask) } else { Vec::new() };
            if together.is_empty() || (ask.pushed)(&pool[standing], &together) {
                break;
            }
            found.extend(together);
        }
        for h in found {
            add(pool, h);
        }
        let reached = reached.max(recast(setting, none, pool, depth));
        if reached < best + LEAST_GAIN {
            let stands = best_below(pool, depth).filter(|_| more && depth < options.depth && !enough());
            let together = stands.map(|s| two_at_once(setting, &pool[s], options, ask));
            together.into_iter().flatten().for_each(|h| add(pool, h));
            break;
        }
    }
    // Backward: drop each member of the best set, put another in its place.
    for _ in 0..ROUNDS {
        let Some(best) = best_of(pool) else { return };
        let n = pool[best].effects.len();
        if n < 2 || setting.budget.omits(Step::Drops) || (ask.outdone)(&pool[best]) {
            return;
        }
        let (before, evidence) = (pool[best].key(), pool[best].log_evidence);
        let rests: Vec<(usize, Hypothesis<'d>)> =
            (0..n).into_par_iter().filter_map(|i| Some((i, without(setting, none, &pool[best], i)?))).collect();
        // What remains may come to rest where it had not come alone: then the other was no more than the way there.
        if rests.iter().any(|(_, rest)| rest.log_evidence > evidence - LEAST_GAIN) {
            rests.into_iter().for_each(|(_, rest)| add(pool, rest));
            continue;
        }
        let set = &pool[best];
        let instead = |(index, rest): &(usize, Hypothesis<'d>)| {
            if enough() {
                return Seen::default();
            }
            let known = looks.around(rest);
            let fresh = known.is_none().then(|| around(rest, Columns::Dropped));
            let candidates = known.map_or(fresh.as_deref().unwrap_or_default(), |look| &look.candidates);
            let mut found = swapped(setting, none, set, *index, candidates);
            let mut list = worth_adding(candidates, options.most, Some(&set.effects[*index]));
            list.retain(|c| known.is_none_or(|look| !look.fitted.contains(&c.key())));
            found.extend(refit_beside(setting, rest, &list, evidence - FAR_BEHIND));
            let fitted = list.iter().map(|c| c.key()).collect();
            Seen { fresh, fitted, found }
        };
        let replaced: Vec<_> = rests.par_iter().map(instead).collect();
        let mut found = Vec::new();
        for ((_, rest), seen) in rests.iter().zip(replaced) {
            found.extend(looks.keep(rest, seen));
        }
        found.extend(rests.into_iter().map(|(_, rest)| rest));
        for h in found {
            add(pool, h);
        }
        if best_of_size(pool, n).is_some_and(|b| pool[b].log_evidence > evidence) {
            recast(setting, none, pool, n);
        }
        let stands = |pool: &[Hypothesis<'_>]| best_of(pool).is_none_or(|b| pool[b].key() == before);
        if stands(pool) && !enough() {
            beside_the_second(setting, none, pool, n, ask);
        }
        if stands(pool) {
            simplify(setting, none, pool);
        }
        if stands(pool) {
            break;
        }
    }
}

/// What stands with two more effects at once: two that nearly cancel each other add nothing one after the other, and of two that are slow a coloured noise
/// model takes for noise what either leaves.
fn two_at_once<'d>(
    setting: &Setting<'d>,
    stands: &Hypothesis<'d>,
    options: SearchOptions,
    ask: &Ask<'_, 'd>,
) -> Vec<Hypothesis<'d>> {
    let mut found = superposed(setting, stands, &(ask.around)(stands, Columns::Kept), options.most);
    if let Some((plain, candidates)) = (ask.plainly)(stands) {
        found.extend(superposed(setting, &plain, &candidates, options.most));
    }
    found
}

/// Adds what comes of the second best set of so many effects, where it is nearly as likely as the best, by putting in the place of each member what
/// is easily taken for it: where both members of the best set stand for something else, no single swap leads from it to what they stand for.
fn beside_the_second<'d>(
    setting: &Setting<'d>,
    none: &Hypothesis<'d>,
    pool: &mut Vec<Hypothesis<'d>>,
    effects: usize,
    ask: &Ask<'_, 'd>,
) {
    let mut order: Vec<usize> = (0..pool.len()).filter(|&i| pool[i].effects.len() == effects).collect();
    order.sort_by(|&a, &b| pool[b].log_evidence.total_cmp(&pool[a].log_evidence));
    let [best, second, ..] = order[..] else { return };
    if pool[second].log_evidence < pool[best].log_evidence - NEARLY {
        return;
    }
    let set = &pool[second];
    let instead = |index: usize| {
        if setting.budget.omits(Step::Composition) {
            return Vec::new();
        }
        let Some(rest) = without(setting, none, set, index) else { return Vec::new() };
        let mut found = swapped(setting, none, set, index, &(ask.around)(&rest, Columns::Dropped));
        found.push(rest);
        found
    };
    let found: Vec<Hypothesis<'d>> = (0..effects).into_par_iter().flat_map_iter(instead).collect();
    found.into_iter().for_each(|h| add(pool, h));
}

/// A set with what is easily taken for one of its members in that member's place, the others as they are: fitted alone first, they may come to rest
/// where nothing leads back from.
fn swapped<'d>(
    setting: &Setting<'d>,
    none: &Hypothesis<'d>,
    set: &Hypothesis<'d>,
    index: usize,
    candidates: &[Candidate],
) -> Vec<Hypothesis<'d>> {
    let values = set.base.values();
    let sketched = rivals_of(&set.effects[index], candidates).into_par_iter().filter_map(|rival| {
        if setting.budget.omits(Step::Composition) {
            return None;
        }
        let amplitudes = rival.points.first().map_or(&[][..], |p| &p.amplitudes);
        let mut parts: Vec<Part> = set.effects.iter().map(|e| Part::of_effect(e, &values)).collect();
        parts[index] = Part::of_candidate(rival, 0, amplitudes);
        let begun = |parts: &[Part]| assemble(setting, none, &values, parts, &set.base.whitener, SKETCH);
        let own = begun(&parts);
        // A relative begins where the member stands, too, and so does a law that contains the member's: it follows the recording no worse.
        let member = &set.effects[index];
        let wider = rival.mechanism.contains.contains(&member.mechanism.id);
        let related = wider || rival.mechanism.family == member.mechanism.family;
        let inheriting = related && rival.slot.label == member.slot.label;
        let heir = inheriting.then(|| {
            let law = rival.mechanism.law_at(&rival.slot, rival.refit.purpose);
            parts[index].values = inherited((rival.mechanism, &law), &parts[index].values, member, &values);
            begun(&parts)
        });
        carried_on(setting, own.into_iter().chain(heir.flatten()), set)
    });
    sketched.collect()
}

/// Adds the best set of so many effects with the law of each member in the form that has the most evidence beside the others: a member that
/// was written before another was known may show more, or have less to show, beside it. Returns the evidence of what was added.
fn recast<'d>(setting: &Setting<'d>, none: &Hypothesis<'d>, pool: &mut Vec<Hypothesis<'d>>, effects: usize) -> f64 {
    let mut reached = f64::NEG_INFINITY;
    for index in 0..effects {
        let Some(best) = best_of_size(pool, effects) else { break };
        if let Some(other) = finer(setting, none, &pool[best], index) {
            reached = other.log_evidence;
            add(pool, other);
        }
    }
    reached
}

/// The likeliest of what could be missing around a set, and the family of the effect that was taken out of it.
fn worth_adding<'c>(candidates: &'c [Candidate], most: usize, dropped: Option<&Effect>) -> Vec<&'c Candidate> {
    if candidates.first().is_none_or(|c| c.score() < 2.0) {
        return Vec::new();
    }
    let mut list = short_list(candidates, most);
    for rival in dropped.map_or_else(Vec::new, |d| rivals_of(d, candidates)) {
        include(&mut list, rival);
    }
    list
}

/// Adds a hypothesis, or replaces the same statement with less evidence; not one that states the same law twice.
pub fn add<'d>(pool: &mut Vec<Hypothesis<'d>>, h: Hypothesis<'d>) {
    if h.repeats_itself() {
        return;
    }
    let key = h.key();
    match pool.iter_mut().find(|p| p.key() == key) {
        Some(same) => {
            if h.log_evidence > same.log_evidence {
                *same = h;
            }
        }
        None => pool.push(h),
    }
}

/// The set that stands: most evidence, where each further effect must have added [`LEAST_GAIN`].
pub fn best_of(pool: &[Hypothesis<'_>]) -> Option<usize> {
    best_below(pool, usize::MAX)
}

/// The set of so many effects with the most evidence.
pub fn best_of_size(pool: &[Hypothesis<'_>], effects: usize) -> Option<usize> {
    (0..pool.len())
        .filter(|&i| pool[i].effects.len() == effects)
        .max_by(|&a, &b| pool[a].log_evidence.total_cmp(&pool[b].log_evidence))
}

/// The set that stands among those of fewer effects than this.
fn best_below(pool: &[Hypothesis<'_>], effects: usize) -> Option<usize> {
    let most = pool.iter().map(|h| h.effects.len()).filter(|&n| n < effects).max()?;
    let mut standing: Option<usize> = None;
    for size in 0..=most {
        let Some(i) = best_of_size(pool, size) else { continue };
        match standing {
            Some(s)
                if pool[i].log_evidence < pool[s].log_evidence + LEAST_GAIN * (size - pool[s].effects.len()) as f64 => {
            }
            _ => standing = Some(i),
        }
    }
    standing
}

/// The best sets of one size, of different families where there are any.
fn beam(pool: &[Hypothesis<'_>], size: usize, width: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..pool.len()).filter(|&i| pool[i].effects.len() == size).collect();
    order.sort_by(|&a, &b| pool[b].log_evidence.total_cmp(&pool[a].log_evidence));
    let mut chosen: Vec<usize> = Vec::new();
    for &i in &order {
        if chosen.len() < width && !chosen.iter().any(|&c| pool[c].families() == pool[i].families()) {
            chosen.push(i);
        }
    }
    chosen
}
