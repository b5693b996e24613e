//! Weighing fitted hypotheses: evidence, blocks that were held out of the fit, and what a law that contains another must pay.

use std::f64::consts::TAU;

use rayon::prelude::*;

use super::wordings::{collapses, shared, wordings};
use super::{Claim, FIRM, Hypothesis as Weighed, probabilities};
use crate::budget::Step;
use crate::mechanism::Family;
use crate::model::base::Base;
use crate::model::hypothesis::{Effect, Hypothesis, OnBlocks, Setting, block_score};
use crate::search::compose::best_of;
use crate::search::given_up::leaves_more;

/// Weight of the log evidence in the probabilities.
pub const EVIDENCE_WEIGHT: f64 = 0.4;
/// The same where something significant is left of the best set: all models are then known to be wrong.
pub const IMPERFECT_WEIGHT: f64 = 0.2;
/// Weight of the evidence between members of one family: two laws of one kind differ by how they are written as much as by what they say.
const SIBLING_WEIGHT: f64 = 0.25;
/// Log likelihood below which a law that contains another has gained nothing on it, and the weight of the evidence between the two.
pub const NESTED_GAIN: f64 = 2.0;
const NESTED_WEIGHT: f64 = 0.9;
/// Log evidence that a further effect must bring before it counts.
const PRICE_OF_AN_EFFECT: f64 = 4.0;

/// A fitted set as the verdict sees it: what it claims, and its evidence less the price of its effects.
pub fn weigh(h: &Hypothesis<'_>) -> Weighed {
    let claim =
        |e: &Effect| Claim { mechanism: e.mechanism.id, family: e.mechanism.family.name(), slot: e.slot.label.clone() };
    Weighed {
        claims: h.effects.iter().map(claim).collect(),
        log_evidence: h.log_evidence - PRICE_OF_AN_EFFECT * h.effects.len() as f64,
    }
}

/// The set with the most evidence of those that claim something.
pub fn likeliest(weighed: &[Weighed]) -> Option<usize> {
    (0..weighed.len())
        .filter(|&i| !weighed[i].claims.is_empty() && weighed[i].log_evidence.is_finite())
        .max_by(|&a, &b| weighed[a].log_evidence.total_cmp(&weighed[b].log_evidence))
}

/// The sets that were fitted, as they stand against each other.
#[derive(Debug, Clone, Copy)]
pub struct Contest<'a, 'd> {
    /// The sets; the first is the simulation without effects.
    pub pool: &'a [Hypothesis<'d>],
    /// Their claims and evidence.
    pub weighed: &'a [Weighed],
    /// Their probabilities.
    pub probability: &'a [f64],
    /// The one that is told.
    pub winner: usize,
}

/// Sets that contradict the winner, one by evidence and one by probability: each names a mechanism that the other does not (a set with more or
/// fewer members than the winner says the same of those that they share). Two, since one of them is often the winner's law in other words.
pub fn rivals_of(contest: &Contest<'_, '_>) -> Vec<usize> {
    let Contest { pool, weighed, probability, winner } = *contest;
    let lacks = |i: usize, j: usize| {
        pool[i].effects.iter().any(|e| pool[j].effects.iter().all(|other| other.mechanism.id != e.mechanism.id))
    };
    let rivals = || (0..pool.len()).filter(|&i| lacks(i, winner) && lacks(winner, i));
    let by_evidence = rivals().max_by(|&a, &b| weighed[a].log_evidence.total_cmp(&weighed[b].log_evidence));
    let likeliest =
        rivals().max_by(|&a, &b| probability[a].total_cmp(&probability[b])).filter(|r| Some(*r) != by_evidence);
    by_evidence.into_iter().chain(likeliest).collect()
}

/// Squared distance of a rival's best imitation, in units of the noise, from which on an experiment (or the recording itself) settles it.
pub const SETTLED: f64 = 25.0;

/// Whether the recording has settled the matter between two sets: what it makes of them is far apart, and the odds are firm. What keeps such
/// a verdict from being firm is something else, and no experiment between the two is needed.
pub fn settled(winner: f64, rival: f64, separation: Option<f64>) -> bool {
    separation.is_some_and(|s| s >= SETTLED) && winner >= FIRM * (winner + rival)
}

/// Scores on held-out blocks of the hypotheses that are close to the best; `None` for the others.
pub fn block_scores(setting: &Setting<'_>, pool: &[Hypothesis<'_>]) -> Vec<Option<OnBlocks>> {
    let top = pool.iter().map(|h| h.log_evidence).fold(f64::NEG_INFINITY, f64::max);
    let mut near: Vec<usize> = (0..pool.len()).filter(|&i| pool[i].log_evidence > top - 8.0).collect();
    near.sort_by(|&a, &b| pool[b].log_evidence.total_cmp(&pool[a].log_evidence));
    near.truncate(5);
    (0..pool.len())
        .into_par_iter()
        .map(|i| {
            if (near.contains(&i) || i == 0)
                && pool.len() > 1
                && (i == 0 || pool[i].log_evidence >= top || !setting.budget.omits(Step::Blocks))
            {
                block_score(setting, &pool[i])
            } else {
                None
            }
        })
        .collect()
}

/// The standing set; where it leaves a larger error than the simulation as it is, calling noise what its effects do not explain, the best of those
/// with more evidence that explain: the price of a further effect is asked where there is something to lose by it.
pub fn standing(pool: &[Hypothesis<'_>], least: &Hypothesis<'_>) -> Option<usize> {
    let standing = best_of(pool)?;
    if pool[standing].effects.is_empty() || !leaves_more(&pool[standing], least) {
        return Some(standing);
    }
    let better = (0..pool.len()).filter(|&i| pool[i].log_evidence > pool[standing].log_evidence);
    let explaining = better.filter(|&i| !leaves_more(&pool[i], least));
    explaining.max_by(|&a, &b| pool[a].log_evidence.total_cmp(&pool[b].log_evidence)).or(Some(standing))
}

/// Log evidence within which sets of one size tie, and log likelihood of the held-out blocks by which one of them must lead to be preferred.
const TIE: f64 = 3.0;

/// The standing set, or one of its size that ties in evidence and predicts the held-out blocks better; of those that tie, the best whose families are the
/// likeliest by all that was fitted: what is told first must not be what the alternatives outweigh.
pub fn tie_broken(pool: &[Hypothesis<'_>], weighed: &[Weighed], standing: usize, blocks: &[Option<OnBlocks>]) -> usize {
    let score = |i: usize| blocks[i].as_ref().map_or(f64::NEG_INFINITY, |b| b.0);
    let tying: Vec<usize> = (0..pool.len())
        .filter(|&i| {
            pool[i].effects.len() == pool[standing].effects.len()
                && pool[i].log_evidence > pool[standing].log_evidence - TIE
        })
        .collect();
    let by_blocks = |among: &[usize], first: usize| {
        let better = among.iter().copied().filter(|&i| i == first || score(i) > score(first) + TIE);
        better.max_by(|&a, &b| score(a).total_cmp(&score(b))).unwrap_or(first)
    };
    let preferred = by_blocks(&tying, standing);
    let probability = probabilities(&log_weights(pool, weighed, blocks, preferred, EVIDENCE_WEIGHT), 1.0);
    let families = likeliest_families(&tying, preferred, weighed, &probability);
    let agreeing: Vec<usize> = tying.into_iter().filter(|&i| pool[i].families() == families).collect();
    let first = agreeing.iter().copied().max_by(|&a, &b| pool[a].log_evidence.total_cmp(&pool[b].log_evidence));
    first.map_or(preferred, |first| by_blocks(&agreeing, first))
}

/// Of some sets the families of the one whose families have the most probability together; those of `preferred` where no others have more.
fn likeliest_families(sets: &[usize], preferred: usize, weighed: &[Weighed], probability: &[f64]) -> Vec<&'static str> {
    let families = |i: usize| {
        let mut all: Vec<&'static str> = weighed[i].claims.iter().map(|c| c.family).collect();
        all.sort_unstable();
        all
    };
    let mass = |wanted: &[&str]| -> f64 {
        let all = |i: &usize| wanted.iter().all(|f| weighed[*i].claims.iter().any(|c| c.family == *f));
        (0..weighed.len()).filter(all).map(|i| probability[i]).sum()
    };
    let mut best = (families(preferred), mass(&families(preferred)));
    for &i in sets {
        let (theirs, of_theirs) = (families(i), mass(&families(i)));
        if of_theirs > best.1 {
            best = (theirs, of_theirs);
        }
    }
    best.0
}

/// Whether a parameter of the effect stands at a bound: the law is not what the recording shows, a sibling may be meant.
pub fn bounded(base: &Base<'_>, effect: &Effect) -> bool {
    any_at_bound(base, effect.written.parameters_of().iter())
}

/// Whether an amplitude of the effect stands at a bound other than nothing: the law is stretched to what it was not made for, something else may be meant. One
/// of several that is nothing (a friction that a load makes, without a constant part) stretches nothing.
pub fn stretched(base: &Base<'_>, effect: &Effect) -> bool {
    let places: Vec<usize> = effect.written.amplitudes.iter().filter_map(|a| base.model.place_of(&a.name)).collect();
    let nothing = |place: &usize| base.fit.theta[*place] == 0.0;
    let far = places.iter().any(|place| base.fit.at_bound[*place] && !nothing(place));
    far || (!places.is_empty() && places.iter().all(nothing))
}

/// Whether an effect that the clock drives is as strong as its law allows: a parameter that jumps to four times its value, a disturbance beyond all forces.
/// It stands for something else, and another recording has it at other times.
pub fn overdone(base: &Base<'_>, effect: &Effect) -> bool {
    let by_the_clock = matches!(effect.mechanism.family, Family::TimeVariation | Family::ExternalDisturbance);
    let mut places = effect.written.amplitudes.iter().filter_map(|a| base.model.place_of(&a.name));
    by_the_clock && places.any(|place| base.fit.at_bound[place] && base.fit.theta[place] != 0.0)
}

fn any_at_bound<'n>(base: &Base<'_>, mut names: impl Iterator<Item = &'n String>) -> bool {
    names.any(|name| base.model.place_of(name).is_some_and(|place| base.fit.at_bound[place]))
}

/// Whether two sets say the same of families and slots and differ in members only.
fn siblings(a: &Hypothesis<'_>, b: &Hypothesis<'_>) -> bool {
    fn kinds<'h>(h: &'h Hypothesis<'_>) -> Vec<(&'h str, &'h str)> {
        let mut all: Vec<_> = h.effects.iter().map(|e| (e.mechanism.family.name(), e.slot.label.as_str())).collect();
        all.sort_unstable();
        all
    }
    kinds(a) == kinds(b)
}

/// How much of the price of its further parameters a set pays too much that contains another as a special case.
///
/// Half of `ln n` is right for a parameter that the recording settles as well as one of its samples times the number of samples. A power that
/// hardly shows is settled far worse, and that it may have any value then says nothing against it: its price is the logarithm of
/// how many times its interval goes into what was allowed beforehand (Laplace's approximation), for those that are settled worst. A further
/// amplitude is another matter: the recording settles that it is zero.
fn overpriced(general: &Hypothesis<'_>, special: &Hypothesis<'_>) -> f64 {
    let amplitudes = |h: &Hypothesis<'_>| h.effects.iter().map(|e| e.written.amplitudes.len()).sum::<usize>();
    let price = |h: &Hypothesis<'_>| h.base.log_likelihood - h.log_evidence;
    let further = general.base.model.count().beyond(special.base.model.count()).lasting;
    let paid = price(general) - price(special);
    if further == 0 || paid <= 0.0 || amplitudes(general) != amplitudes(special) {
        return 0.0;
    }
    let unit = paid / further as f64;
    let base = &general.base;
    let covariance = base.covariance();
    let mut prices: Vec<f64> = general
        .effects
        .iter()
        .flat_map(|e| e.written.widths())
        .filter_map(|(name, width)| {
            let place = base.model.place_of(&name)?;
            let variance = covariance[place * (base.fit.theta.len() + 1)];
            let times = if variance > 0.0 { width / (TAU * variance).sqrt() } else { 1.0 };
            // At a bound the law is the special case or stretched: nothing was settled badly.
            (!base.fit.at_bound[place]).then(|| times.max(1.0).ln().min(unit))
        })
        .collect();
    prices.sort_by(f64::total_cmp);
    prices.iter().take(further).map(|price| unit - price).sum()
}

/// Logarithms of the weights of the hypotheses.
///
/// Evidence counts with `weight`; what the held-out blocks say is part of it. A law that contains the winner's as a special case and gains
/// nothing on it pays nearly the full price of its further parameters: data that settle a parameter at its neutral value do speak.
pub fn log_weights(
    pool: &[Hypothesis<'_>],
    weighed: &[Weighed],
    blocks: &[Option<OnBlocks>],
    winner: usize,
    weight: f64,
) -> Vec<f64> {
    let best_block = blocks[winner].as_ref().map(|b| b.0);
    let best = &pool[winner];
    let wordings = wordings(pool, winner);
    let logs: Vec<f64> = (pool.iter().enumerate())
        .map(|(i, h)| {
            let sibling = i != winner && siblings(h, best);
            let contains = i != winner
                && h.effects.len() == best.effects.len()
                && h.effects
                    .iter()
                    .any(|e| best.effects.iter().any(|w| e.mechanism.contains.contains(&w.mechanism.id)));
            let behind = (h.log_evidence - best.log_evidence).min(0.0);
            // What it trails by for its price alone; no set becomes likelier than the winner by it.
            let refund = if contains && sibling { overpriced(h, best).min(-behind) } else { 0.0 };
            let behind = behind + refund;
            let mut log = weight * (weighed[i].log_evidence + refund);
            if let (Some(own), Some(best)) = (&blocks[i], best_block) {
                log += 0.5 * weight * (own.0 - best).clamp(-10.0, 10.0);
            }
            if sibling {
                log = log.max(log + (SIBLING_WEIGHT - weight) * behind);
            }
            if contains && h.base.log_likelihood - best.base.log_likelihood < NESTED_GAIN {
                log += (NESTED_WEIGHT - weight).max(0.0) * behind;
            }
            log - (wordings[i] as f64).ln()
        })
        .collect();
    shared(logs, &collapses(pool))
}

#[cfg(test)]
mod tests {
    use std::slice::from_ref;

    use hysid_plant::Simulation;

    use super::*;
    use crate::budget::Budget;
    use crate::model::base::NoiseKind;
    use crate::model::hypothesis::calibrated;
    use crate::openset::varying::tests::{BASELINE, recorded};
    use crate::request::{Hooks, Options};
    use crate::search::Search;

    #[test]
    fn a_change_to_the_end_of_what_its_law_allows_is_overdone() {
        let data = recorded(6, |t| if t > 6.0 { 1.3 } else { 1.0 }, 0.02);
        let budget = Budget::new(&|_| false);
        let original = Simulation::parse(BASELINE, "test.sim.toml").unwrap();
        let (setting, none) = calibrated(original, &data, NoiseKind::Coloured, &budget);
        let search = Search::new(setting, Options::default(), &Hooks::SILENT);
        let Hypothesis { mut base, effects, .. } =
            search.answer(&none, &vec![("abrupt_change".to_owned(), "parameter:k".to_owned())]).unwrap();
        let place = base.model.place_of(&effects[0].written.amplitudes[0].name).unwrap();
        assert!(base.fit.theta[place] > 0.0 && !overdone(&base, &effects[0]));
        base.fit.at_bound[place] = true;
        assert!(overdone(&base, &effects[0]));
        assert!(stretched(&base, &effects[0]));
        // At zero the law does nothing, which is no strength, and where nothing else of it does either it is no law.
        base.fit.theta[place] = 0.0;
        assert!(!overdone(&base, &effects[0]) && stretched(&base, &effects[0]));
    }

    #[test]
    fn what_is_told_first_is_not_outweighed_by_the_alternatives() {
        let claim = |mechanism, family| Claim { mechanism, family, slot: "state:v".into() };
        let set = |claims: &[Claim]| Weighed { claims: claims.to_vec(), log_evidence: 0.0 };
        let (pinching, dahl) = (claim("pinching", "hysteretic_spring"), claim("dahl_friction", "presliding"));
        let (lugre, delay) = (claim("lugre_friction", "presliding"), claim("delay", "signal_path_lag"));
        let alone = [set(from_ref(&pinching)), set(from_ref(&dahl)), set(&[lugre])];
        let told = |p: [f64; 3]| likeliest_families(&[0, 1], 0, &alone, &p);
        assert_eq!(told([0.4, 0.3, 0.3]), ["presliding"]);
        assert_eq!(told([0.6, 0.2, 0.2]), ["hysteretic_spring"]);
        assert_eq!(told([0.5, 0.25, 0.25]), ["hysteretic_spring"]);
        // A set of more effects says the same of the families that it shares.
        let pairs = [set(&[pinching, delay.clone()]), set(&[delay.clone(), dahl.clone()]), set(&[dahl, delay])];
        assert_eq!(likeliest_families(&[0, 1, 2], 0, &pairs, &[0.4, 0.3, 0.3]), ["presliding", "signal_path_lag"]);
    }
}
