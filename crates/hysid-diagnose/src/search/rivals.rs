//! Who is heard: the candidates that are worth a fit, and what is easily taken for an effect that was fitted.

use super::candidate::Candidate;
use super::compose::best_of_size;
use super::given_up::HOPELESS;
use crate::mechanism::Mechanism;
use crate::model::hypothesis::{Effect, Hypothesis, Key};

/// The candidates worth a refit: the best by score, at most `most`, one for each slot and family that is not far behind, and what the recording shows
/// by itself.
pub fn short_list(candidates: &[Candidate], most: usize) -> Vec<&Candidate> {
    let Some(top) = candidates.first().map(Candidate::score) else { return Vec::new() };
    let mut list: Vec<&Candidate> = Vec::new();
    for (i, c) in candidates.iter().enumerate() {
        let fresh = !list.iter().any(|l| l.mechanism.family == c.mechanism.family && l.slot.label == c.slot.label);
        let near = c.score() > top - 40.0 && c.score() > 0.0;
        if i < most || (fresh && near && list.len() < most + 6) {
            list.push(c);
        }
    }
    // Siblings of the best must be heard: the verdict turns on them.
    if let Some(best) = candidates.first() {
        for c in candidates {
            if rivals(best.mechanism, c.mechanism) && c.slot.label == best.slot.label {
                include(&mut list, c);
            }
        }
    }
    candidates.iter().filter(|c| c.is_shown()).for_each(|c| include(&mut list, c));
    list
}

/// Adds a candidate that is not in the list yet.
pub fn include<'c>(list: &mut Vec<&'c Candidate>, c: &'c Candidate) {
    if !list.iter().any(|l| std::ptr::eq(*l, c)) {
        list.push(c);
    }
}

/// Whether two mechanisms are easily taken for each other.
fn rivals(a: &Mechanism, b: &Mechanism) -> bool {
    let names = |a: &Mechanism, b: &Mechanism| a.contains.contains(&b.id) || a.confusable.contains(&b.id);
    a.family == b.family || a.family.twin() == Some(b.family) || names(a, b) || names(b, a)
}

/// Rivals that are heard at other slots than that of the effect whose rivals they are.
const ELSEWHERE: usize = 3;
/// Rivals that are fitted to the end after the best single effect is known.
const SECOND_HEARING: usize = 4;

/// The candidates that are easily taken for an effect: all at its slot, the best few at others.
pub fn rivals_of<'c>(effect: &Effect, candidates: &'c [Candidate]) -> Vec<&'c Candidate> {
    let (here, elsewhere): (Vec<&Candidate>, Vec<&Candidate>) = candidates
        .iter()
        .filter(|c| rivals(effect.mechanism, c.mechanism))
        .partition(|c| c.slot.label == effect.slot.label);
    here.into_iter().chain(elsewhere.into_iter().take(ELSEWHERE)).collect()
}

/// What is easily taken for the best single effect of a pool and was not fitted yet, or given up after a few iterations.
///
/// `given` are statements that were heard to the end.
pub fn unheard<'c>(pool: &[Hypothesis<'_>], candidates: &'c [Candidate], given: &[Key]) -> Vec<&'c Candidate> {
    let Some(best) = best_of_size(pool, 1).map(|i| &pool[i]) else { return Vec::new() };
    let heard = |c: &&Candidate| {
        let key = c.key();
        given.contains(&key) || pool.iter().any(|h| h.key() == key && h.log_evidence > best.log_evidence - HOPELESS)
    };
    rivals_of(&best.effects[0], candidates).into_iter().filter(|c| !heard(c)).take(SECOND_HEARING).collect()
}

/// Log evidence by which a single effect may trail the best and the laws that contain its own still be asked to follow as well.
const NEAR: f64 = 12.0;
/// Single effects of which that is asked.
const SPECIAL: usize = 3;

/// Candidates whose law contains that of one of the best single effects of a pool, at its slot, and which do not follow the recording as well although
/// they can: their fit came to rest somewhere else, or was given up. Each with the place of that effect in the pool.
pub fn outdone_by_a_special_case<'c>(
    pool: &[Hypothesis<'_>],
    candidates: &'c [Candidate],
) -> Vec<(usize, &'c Candidate)> {
    let mut singles: Vec<usize> = (0..pool.len()).filter(|&i| pool[i].effects.len() == 1).collect();
    singles.sort_by(|&a, &b| pool[b].log_evidence.total_cmp(&pool[a].log_evidence));
    let Some(&best) = singles.first() else { return Vec::new() };
    singles.retain(|&i| pool[i].log_evidence > pool[best].log_evidence - NEAR);
    let mut found: Vec<(usize, &Candidate)> = Vec::new();
    for i in singles.into_iter().take(SPECIAL) {
        let (special, reached) = (&pool[i].effects[0], pool[i].base.log_likelihood);
        let follows =
            |c: &Candidate| pool.iter().any(|h| h.key() == c.key() && h.base.log_likelihood >= reached - 1e-3);
        let wider = candidates.iter().filter(|c| {
            c.mechanism.contains.contains(&special.mechanism.id) && c.slot.label == special.slot.label && !follows(c)
        });
        for c in wider {
            if !found.iter().any(|(_, known)| std::ptr::eq(*known, c)) {
                found.push((i, c));
            }
        }
    }
    found
}
