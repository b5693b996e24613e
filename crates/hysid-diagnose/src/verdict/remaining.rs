//! What is left of the winning set's residual: whether something significant is, whether generic terms find it, and whether the set is then only
//! an imitation of a law that the catalogue does not have.

use super::firmness::is_a_spectrum;
use super::resonance::is_of_the_simulation;
use super::{FIRM, Support};
use crate::budget::Step;
use crate::evidence::better_by_chance;
use crate::evidence::{ForcePaths, SurrogateTest};
use crate::file::{CorrectionRecord, RemainingRecord, finite};
use crate::model::base::{Base, MAX_AR};
use crate::model::hypothesis::{Hypothesis, block_score};
use crate::openset::needed::{Refitted, likelier};
use crate::openset::{ODDS_AGAINST, ODDS_AGAINST_MORE, OpenSet, Writable};
use crate::search::Search;
use crate::search::given_up::leaves_more;
use crate::search::outdone::may_imitate;

/// A correction is believed where the whitened error on blocks that it was not fitted to falls below this share.
const BETTER: f64 = 0.97;
/// Probability of so much better a prediction of the blocks by chance, below which a correction is written into the simulation. The evidence
/// has found it by then; the blocks only have to bear it out.
const BY_CHANCE: f64 = 0.05;
/// Share of a set's evidence that generic terms may add to it, and log evidence by which they may beat it alone, before it is an imitation.
/// On cases of development seed 3 with a law of the catalogue generic terms added nothing (log evidence -8 to 1), and alone they trailed by 4 or more.
const AS_MUCH: f64 = 0.5;
const FAR_MORE: f64 = 5.0;
/// Share of a set's evidence from which generic terms, on the tangent, are worth a fit in its place. Where the mismatch is large the tangent shows but a
/// part of what a term explains once it stands in the equations.
const WORTH_A_FIT: f64 = 0.25;

/// Share of a set's evidence that generic terms must reach in its place before more of them are looked for.
const HALFWAY: f64 = 0.5;

/// What is left of a set's residual.
pub struct Remaining<'d> {
    /// The surrogate test of the residual; `None` where the set is empty or there was no time.
    test: Option<SurrogateTest>,
    /// Generic terms for the residual; `None` where no mismatch is significant or no term is chosen.
    open: Option<OpenSet>,
    /// The same in place of the set, where that explains far more.
    instead: Option<OpenSet>,
    /// Generic terms in its place, refitted, where those explain far more.
    swapped: Option<Refitted<'d>>,
    /// The generic terms of the simulation without effects, refitted, where that was tried and did not explain far more.
    tried: Option<Refitted<'d>>,
    /// What is written into the simulation, as it was refitted.
    written: Option<CorrectionRecord>,
    /// Whether generic terms explain so much more than the set that something is missing in it.
    pub foreign: bool,
    /// Whether that makes an imitation of it: what a search had no time for generic terms find, too, but not so much.
    pub imitation: bool,
    /// Whether the set is a sum of relaxations, which stands for a memory with many time scales.
    pub spectrum: bool,
    /// Whether something significant is left.
    pub imperfect: bool,
    /// Whether an unknown force that acts on the machine explains what is left.
    pub pushed: bool,
    alpha: f64,
}

impl<'d> Remaining<'d> {
    /// Of the `winner` of a pool whose set at `from` is the simulation without effects, but for converters of the recording.
    pub fn of(search: &Search<'_, 'd>, pool: &[Hypothesis<'d>], winner: usize, from: usize, significant: bool) -> Self {
        let (best, none) = (&pool[winner], &pool[from]);
        let alpha = search.options.alpha;
        let budget = search.setting.budget;
        let test = (winner > 0 && !budget.omits(Step::Remains)).then(|| search.remains(best));
        let mut open = if significant { search.open(best) } else { None };
        let told = |o: &OpenSet| o.by_chance(ODDS_AGAINST_MORE) < alpha;
        let any = open.as_ref().is_some_and(told) || test.as_ref().is_some_and(|t| t.tells(alpha));
        // A score is twice a gain in log likelihood.
        let most = open.as_ref().map_or(0.0, |o| o.gain).max(0.5 * test.as_ref().map_or(0.0, |t| t.statistic));
        let pushed = winner > 0 && any && search.force_on(best).is_some_and(|force| most < force);
        if pushed {
            open = None;
        }
        let seen = open.as_ref().filter(|o| told(o));
        let explained = best.log_evidence - none.log_evidence;
        let spectrum = is_a_spectrum(best);
        let imitates = winner > 0 && may_imitate(none, best);
        let generic = if imitates || spectrum { search.open(none) } else { None };
        // That a further resonance has the frequency and the damping of one that the simulation has would be a coincidence.
        let lead = || {
            let own = best.effects.iter().any(|e| is_of_the_simulation(&none.base, &best.base, e));
            if own { -FAR_MORE } else { FAR_MORE }
        };
        let outdone = |o: &OpenSet| told(o) && o.gain > explained + lead();
        let outdone = imitates && generic.as_ref().is_some_and(outdone);
        // What was not looked at is not known to be nothing.
        let left = seen.is_some() || test.as_ref().is_none_or(|t| t.tells(alpha) && !pushed);
        // One law that leaves nothing is no imitation that generic terms could tell from it but by their price.
        let doubtful = imitates && (left || best.effects.len() > 1);
        let (swapped, tried) =
            if doubtful && !outdone { in_place(search, none, best, seen, generic.as_ref()) } else { (None, None) };
        let outdone = outdone || swapped.is_some();
        let foreign = imitates && (outdone || seen.is_some_and(|o| o.gain > AS_MUCH * explained));
        let in_time = || !budget.unfinished() || search.is_outdone(none, best);
        let imitation = foreign && in_time();
        let imperfect = winner > 0 && (foreign || spectrum || left);
        // What is told of an imitation is what it imitates, where that is more than what it leaves.
        let both = explained + open.as_ref().map_or(0.0, |o| o.gain);
        let instead = generic.filter(|g| spectrum || (outdone && swapped.is_none() && g.gain > both));
        Self {
            test,
            open,
            instead,
            swapped,
            tried,
            written: None,
            foreign,
            imitation,
            spectrum,
            imperfect,
            pushed,
            alpha,
        }
    }

    /// Whether what is left is of unequal size in a way that matters: evidence counts its samples alike.
    pub fn is_unequal(&self) -> bool {
        self.test.as_ref().is_some_and(|t| t.unequal)
    }

    /// As it is reported; `None` where it was not looked at.
    pub fn record(&self, pool: &[Hypothesis<'_>], winner: usize) -> Option<RemainingRecord> {
        let p = self.test.as_ref().map(|t| if self.pushed { 1.0 } else { t.p_value })?;
        Some(RemainingRecord {
            p_value: p.min(self.open.as_ref().map_or(1.0, |o| o.by_chance(ODDS_AGAINST_MORE))),
            share: share(&pool[winner], &pool[0]),
        })
    }

    /// Whether the mismatch is none of the catalogue: no set stands and a correction does, the set is an imitation, or most of the mismatch
    /// is left. An effect that is really there is still named; what most of the mismatch is decides.
    pub fn is_outside(&self, support: &[Support], remaining: Option<&RemainingRecord>) -> bool {
        let Some(remaining) = remaining else { return self.open.as_ref().is_some_and(|o| self.stands(o)) };
        let helps = self.open.as_ref().is_some_and(|o| o.block_ratio < BETTER);
        let most = remaining.share > 0.5 || (remaining.share > 0.2 && support.iter().all(|s| s.family < FIRM));
        self.foreign || self.spectrum || (helps && most && self.test.as_ref().is_some_and(|t| t.tells(self.alpha)))
    }

    /// The simulation with a sparse correction in its equations, refitted: on top of the winning set, where that is `trusted` on other inputs, or in its
    /// place, whichever has more evidence. `None` where a parameter walks, and where it leaves more error than what would be written `otherwise` (a place in the pool), under a noise model that takes that
    /// for noise, or predicts blocks that it was not fitted to no better:
    /// three or four blocks tell little of a mismatch far below the noise, so they need not rule out chance where the evidence does.
    pub fn modelled(
        &mut self,
        search: &Search<'_, 'd>,
        pool: &[Hypothesis<'d>],
        winner: usize,
        trusted: bool,
        otherwise: usize,
    ) -> Option<Hypothesis<'d>> {
        // Where a parameter walks, another recording sees another walk: functions of the time that follow this one are no use there.
        if self.walks() {
            return None;
        }
        let setting = &search.setting;
        let swapped = self.swapped.take();
        let replaced = swapped.is_some();
        let (refitted, on_top) = match swapped {
            Some(refitted) => (refitted, false),
            None => {
                let left = self.open.as_ref().filter(|_| trusted);
                let on_top = left.and_then(|o| likelier(setting, &pool[winner], o, f64::NEG_INFINITY));
                let generic = if winner > 0 { search.open(&pool[0]) } else { None };
                let alone = || search.corrected(&pool[0], generic.as_ref()?, f64::NEG_INFINITY);
                let instead = self.tried.take().or_else(alone);
                let both = on_top.map(|r| (r, true)).into_iter().chain(instead.map(|r| (r, false)));
                both.max_by(|(a, _), (b, _)| a.hypothesis.log_evidence.total_cmp(&b.hypothesis.log_evidence))?
            }
        };
        let Refitted { hypothesis: best, terms, of } = refitted;
        let sure = replaced || self.stands_by_evidence(&of);
        let driven = pool[otherwise].base.driven() && best.base.driven();
        if leaves_more(&best, &pool[otherwise]) && !driven {
            return None;
        }
        let (_, before) = block_score(setting, &pool[otherwise])?;
        let (_, after) = block_score(setting, &best)?;
        let ratio = (after.iter().sum::<f64>() / before.iter().sum::<f64>()).sqrt();
        let better = ratio < 1.0;
        let mut record = CorrectionRecord { terms, ratio: finite(ratio), ..of.record.clone() };
        if let Some(slot) = record.loudest().map(|t| t.slot.clone()) {
            record.slot = slot;
        }
        let stands = (sure && better) || better_by_chance(&before, &after).is_some_and(|p| p < BY_CHANCE);
        if replaced || (stands && !on_top) {
            // What stands in the set's place is told.
            let gain = best.log_evidence - pool[0].log_evidence - of.choice;
            self.instead = Some(OpenSet { gain, block_ratio: ratio, ..of });
        } else if on_top {
            self.open = Some(of);
        }
        self.written = (stands && !record.terms.is_empty()).then_some(record);
        stands.then_some(best)
    }

    /// Whether a parameter walks.
    pub fn walks(&self) -> bool {
        self.told().is_some_and(|o| o.words.is_some() && o.writable.is_none())
    }

    /// The correction that is told: in place of the set, or of what it leaves.
    fn told(&self) -> Option<&OpenSet> {
        self.instead.as_ref().or(self.open.as_ref())
    }

    /// Whether a correction is beyond doubt: on blocks that it was not fitted to, or by evidence that noise has nowhere. A mismatch far below the
    /// noise never shows on blocks.
    fn stands(&self, open: &OpenSet) -> bool {
        open.block_ratio < BETTER || self.stands_by_evidence(open)
    }

    /// Whether a correction gains more evidence than noise has anywhere, and helps on blocks.
    fn stands_by_evidence(&self, open: &OpenSet) -> bool {
        open.by_chance(ODDS_AGAINST) < self.alpha
    }

    /// The correction, as it is written, or where it models something that is left and helps where it was not fitted, with what it says in words.
    pub fn believed(mut self) -> Option<(CorrectionRecord, Option<String>)> {
        let written = self.written.take();
        let wanted = self.imperfect || self.test.is_none();
        let open = self.told().filter(|o| wanted && self.stands(o));
        let words = open.and_then(|o| o.words.clone());
        let record =
            written.or_else(|| open.map(|o| CorrectionRecord { ratio: finite(o.block_ratio), ..o.record.clone() }))?;
        Some((record, words))
    }
}

/// Generic terms, refitted in the place of a set, that explain far more: those that the set leaves (`seen`) and those of the simulation without effects. Where none does, those of the simulation without effects as they were refitted, where that was tried.
///
/// Where the set is an imitation, what it leaves is a small part of what is really missing: the right term shows beside the wrong effects. The regression,
/// which knows the simulation without effects only by its tangent, may choose another one there.
fn in_place<'d>(
    search: &Search<'_, 'd>,
    none: &Hypothesis<'d>,
    best: &Hypothesis<'d>,
    seen: Option<&OpenSet>,
    generic: Option<&OpenSet>,
) -> (Option<Refitted<'d>>, Option<Refitted<'d>>) {
    let explained = best.log_evidence - none.log_evidence;
    let halfway = none.log_evidence + HALFWAY * explained;
    let likely =
        |o: &&OpenSet| o.gain > WORTH_A_FIT * explained && o.gains_by_chance(ODDS_AGAINST_MORE) < search.options.alpha;
    let late = || search.setting.budget.omits(Step::Imitation);
    let refitted = |o: &OpenSet| if late() { None } else { likelier(&search.setting, none, o, halfway) };
    let alone = |o: &OpenSet| if late() { None } else { search.corrected(none, o, halfway) };
    // A parameter that varies beside the set is written into the set's simulation.
    let beside = |o: &OpenSet| match o.writable.as_ref()? {
        Writable::Sparse(terms) => {
            let writable = Some(Writable::Sparse(terms.within(none.base.document())));
            refitted(&OpenSet { writable, rivals: Vec::new(), ..o.clone() })
        }
        Writable::Varying(_) => None,
    };
    let lead = |r: &Refitted<'d>| r.hypothesis.log_evidence - best.log_evidence - r.of.choice;
    let (beside, alone) = (seen.and_then(beside), generic.filter(likely).and_then(alone));
    let leads = |swapped: &Option<Refitted<'d>>| swapped.as_ref().map(lead).filter(|l| *l > FAR_MORE);
    match (leads(&beside), leads(&alone)) {
        // One that was left halfway is no correction yet.
        (None, None) => (None, alone.filter(|r| r.hypothesis.log_evidence >= halfway)),
        (Some(a), b) if b.is_none_or(|b| b < a) => (beside, None),
        _ => (alone, None),
    }
}

/// What a simulation leaves that is written in the place of the judged set; `None` where there is no time to look.
pub fn left_by(search: &Search<'_, '_>, none: &Hypothesis<'_>, written: &Hypothesis<'_>) -> Option<RemainingRecord> {
    let looked = !search.setting.budget.omits(Step::Remains);
    looked.then(|| RemainingRecord { p_value: search.remains(written).p_value, share: share(written, none) })
}

/// The noise that the best model leaves, by output: what cannot be told of its residual from its own past. Plain squares take all of the residual for noise,
/// however smooth it is.
fn noise_floor(best: &Hypothesis<'_>) -> Vec<f64> {
    let Base { model, fit, whitener, .. } = &best.base;
    let coloured =
        whitener.is_white().then(|| model.data().layout.fit_noise(&fit.residual, MAX_AR, &ForcePaths::default()));
    let models = &coloured.as_ref().unwrap_or(whitener).models;
    models.iter().map(|m| m.innovation().min(m.noise_rms())).collect()
}

/// Share of the mismatch, above the noise, that a set leaves.
fn share(best: &Hypothesis<'_>, none: &Hypothesis<'_>) -> f64 {
    let layout = &best.base.model.data().layout;
    let (noise, scales) = (noise_floor(best), best.base.model.data().scales());
    let left = |e: &[f64]| {
        let outputs = layout.rms(e).into_iter().zip(&noise).zip(&scales);
        outputs.map(|((r, n), scale)| (r * r - n * n).max(0.0) / (scale * scale)).sum::<f64>()
    };
    let share = (left(&best.base.fit.residual) / left(&none.base.fit.residual).max(f64::MIN_POSITIVE)).sqrt().min(1.0);
    if share.is_finite() { share } else { 0.0 }
}
