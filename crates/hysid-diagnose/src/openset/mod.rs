//! What no mechanism explains: generic families of signals injected at the slots, a sparse correction, and its signature.
//!
//! The families have no physics in their names: hinges and monomials of displacement and velocity, plays, lags, functions of time, hinges of
//! the input and of the output. Each signal is added at its slot and pushed through the tangent of the fitted simulation, so that a
//! correction lives where it acts and not at the output. Terms are chosen by orthogonal forward regression with PRESS, under the fit's noise
//! model and, where that is coloured and may have taken mismatch for noise, by plain squares too. Whether the correction is worth anything is
//! judged by the evidence that it gains with a noise model of its own, and on blocks that its coefficients were not fitted to.
//!
//! Reference: P. Martins and L. A. Aguirre, Sufficient conditions for rate-independent hysteresis in autoregressive identified models,
//! MSSP 75 (2016): memory without rate needs an operator with memory, which no static term imitates.

pub mod needed;
mod past;
mod regress;
mod shapes;
mod signature;
mod sites;
mod switches;
mod terms;
pub mod uneven;
pub mod varying;
mod view;
mod written;

use hysid_linalg::Matrix;
use hysid_select::{Criterion, Options as Selecting, select};

use crate::data::held_out_blocks;
use crate::evidence::{Whitener, norm2};
use crate::file::{CorrectionRecord, SignatureRecord, TermRecord};
use crate::model::Count;
use crate::model::base::{Base, MAX_AR, NoiseKind, log_likelihood, spared};
use regress::regress;
use shapes::{Kind, told_rate};
use signature::signature;
use switches::told_switch;
use terms::{Term, terms};
use varying::course::Course;
use varying::written::WrittenVariation;
use varying::{LikelyVariation, Variation, varying};
use view::View;
use written::Sparse;

/// What a term tells, in words, where it says more than a formula does.
pub fn in_words(term: &str) -> Option<String> {
    told_rate(term).or_else(|| told_switch(term))
}

/// A correction with what decides whether it is believed.
#[derive(Debug, Clone)]
pub struct OpenSet {
    /// As it is reported.
    pub record: CorrectionRecord,
    /// Rms error on blocks that its coefficients were not fitted to, over that without it, whitened by the noise that it leaves.
    pub block_ratio: f64,
    /// Log evidence that it adds: its terms pay for their coefficients, and for having been chosen out of many.
    pub gain: f64,
    /// What of it is paid for the choice.
    pub choice: f64,
    /// The fitted simulation with the correction in it, not yet refitted, without terms that are functions of the time beside others that are not;
    /// `None` where a parameter walks.
    pub writable: Option<Writable>,
    /// What it says in words, where it says more than that something is missing.
    pub words: Option<String>,
    /// Others that gain less on the tangent and can be written: terms beside a parameter that varies, or the other way round, what stands behind a walk, and
    /// other ways in which a parameter follows its signal.
    pub rivals: Vec<OpenSet>,
}

/// Odds against a mismatch before the recording is looked at. The noise model is an estimate: on recordings in which nothing is missing the best
/// of the sets gains more than chance alone would give it, and the odds must allow for that.
pub const ODDS_AGAINST: f64 = 1000.0;
/// Odds against something more where a mismatch is known.
pub const ODDS_AGAINST_MORE: f64 = 10.0;

/// A bound for the probability that log evidence is gained by chance (Markov), at these odds against a mismatch.
pub fn gains_by_chance(gain: f64, odds_against: f64) -> f64 {
    (odds_against * (-gain).exp()).min(1.0)
}

impl OpenSet {
    /// A bound for the probability that a correction gains so much where nothing is missing; 1 where it does not help on held-out blocks.
    pub fn by_chance(&self, odds_against: f64) -> f64 {
        if self.block_ratio < 1.0 { self.gains_by_chance(odds_against) } else { 1.0 }
    }

    /// The same without a look at blocks: on the tangent a term that acts at a few moments may spoil those in which it does not, and not when it is refitted.
    pub fn gains_by_chance(&self, odds_against: f64) -> f64 {
        gains_by_chance(self.gain, odds_against)
    }

    /// As a parameter that varies was fitted.
    fn fitted(&self, (what, err): (Variation, &[f64])) -> Self {
        let mut fitted = self.clone();
        fitted.record.terms = what.terms(err);
        fitted.words = Some(what.words());
        fitted
    }
}

/// A correction that can be written into a simulation.
#[derive(Debug, Clone)]
pub enum Writable {
    /// Generic terms.
    Sparse(Sparse),
    /// A parameter that oscillates or follows a signal.
    Varying(WrittenVariation),
}

/// Most terms of a correction.
const MOST_TERMS: usize = 8;

/// A part of a whitened column that lies outside the simulation's own tangent space and is smaller than this is rounding (squared norms).
const RANK_TOLERANCE: f64 = 1e-8;

/// Terms that were chosen under one noise model.
struct Chosen {
    terms: Vec<usize>,
    err: Vec<f64>,
    coefficients: Vec<f64>,
    /// The noise of what is left.
    left: Whitener,
    gain: f64,
    choice: f64,
}

/// The correction of what is left of a fitted simulation's residual: sparse terms or a parameter that varies, whichever has more evidence; `None`
/// where there is neither.
pub fn correction(base: &Base<'_>, kind: NoiseKind) -> Option<OpenSet> {
    let noises = noises(base, kind);
    let terms = terms(base);
    // Where a parameter stands at a bound the tangent goes on, and what it gains there is no correction's.
    let none = kind.share() * View::new(base, &base.whitener).log_likelihood(base);
    let chosen = noises.iter().filter_map(|noise| choose(base, kind, &terms, noise, none));
    let sparse = chosen.max_by(|a, b| a.gain.total_cmp(&b.gain));
    // A walk cannot be written, and stands beside nothing.
    let most = sparse.as_ref().map_or(f64::NEG_INFINITY, |s| s.gain);
    let stands = |v: &LikelyVariation| v.gain > most || !matches!(v.what.course, Course::Walk(_));
    let varying = varying(base, kind, &noises).into_iter().filter(stands).map(|found| of_varying(base, found));
    let mut all: Vec<OpenSet> =
        sparse.map(|sparse| of_terms(base, &terms, sparse)).into_iter().chain(varying).collect();
    all.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    let mut all = all.into_iter();
    let likeliest = all.next()?;
    Some(OpenSet { rivals: all.collect(), ..likeliest })
}

/// The noise models under which a correction is looked for: the fit's own, and plain squares where that is coloured and may have taken mismatch for
/// noise.
pub fn noises(base: &Base<'_>, kind: NoiseKind) -> Vec<Whitener> {
    let mut noises = vec![base.whitener.clone()];
    if kind == NoiseKind::Coloured && base.coloured() {
        noises.push(base.model.data().layout.white_noise(&base.fit.residual));
    }
    noises
}

/// Rms error on blocks that the coefficients of these columns were not fitted to, over that without them, whitened by the noise that they leave.
fn block_ratio(base: &Base<'_>, columns: &[&[f64]], left: &Whitener, precision: f64) -> f64 {
    let data = base.model.data();
    let weights = held_out_blocks(&data.layout, &data.y);
    let on_blocks = |columns: &[&[f64]]| -> f64 {
        let (_, after) = regress(base, columns, left, Some(&weights), precision);
        let white = left.apply(&data.layout, &after);
        white.iter().zip(&weights).filter(|(_, w)| **w == 0.0).map(|(e, _)| e * e).sum()
    };
    let (before, after) = (on_blocks(&[]), on_blocks(columns));
    if before > 0.0 { (after / before).sqrt() } else { 1.0 }
}

/// A correction by sparse terms.
fn of_terms(base: &Base<'_>, terms: &[Term], best: Chosen) -> OpenSet {
    let columns: Vec<&[f64]> = best.terms.iter().map(|&i| terms[i].column.as_slice()).collect();
    let records = best
        .terms
        .iter()
        .zip(&best.coefficients)
        .zip(&best.err)
        .map(|((&i, c), err)| TermRecord {
            term: terms[i].text.clone(),
            slot: terms[i].slot.clone(),
            coefficient: *c,
            err: *err,
        })
        .collect();
    let signature = signature(base, terms, &best.left, &best.terms, &best.coefficients);
    // A term that is a function of the time in this recording, beside others that are not, mends what those leave of the mismatch on the tangent, and
    // says nothing of another recording.
    let lasting: Vec<usize> = best.terms.iter().copied().filter(|&i| terms[i].kind != Kind::Time).collect();
    let (kept, coefficients) = if lasting.is_empty() || lasting.len() == best.terms.len() {
        (best.terms.clone(), best.coefficients.clone())
    } else {
        let picked: Vec<&[f64]> = lasting.iter().map(|&i| terms[i].column.as_slice()).collect();
        let (coefficients, _) = regress(base, &picked, &best.left, None, 0.0);
        (lasting, coefficients)
    };
    let slot = terms[kept[0]].slot.clone();
    let bare = |i: usize| Term { column: Vec::new(), ..terms[i].clone() };
    let sparse = Sparse::new(base.document(), kept.iter().map(|&i| bare(i)).zip(coefficients));
    OpenSet {
        record: CorrectionRecord { slot, terms: records, signature, ratio: None },
        block_ratio: block_ratio(base, &columns, &best.left, 0.0),
        gain: best.gain,
        choice: best.choice,
        writable: Some(Writable::Sparse(sparse)),
        words: None,
        rivals: Vec::new(),
    }
}

/// A correction by a parameter that varies.
fn of_varying(base: &Base<'_>, found: LikelyVariation) -> OpenSet {
    let columns: Vec<&[f64]> = found.columns.iter().map(Vec::as_slice).collect();
    let what = &found.what;
    let side = if matches!(what.course, Course::Follows(_)) { "plant" } else { "time" };
    let signature =
        SignatureRecord { memory: "none".into(), rate_dependent: false, symmetry: "odd".into(), side: side.into() };
    let (slot, terms) = (what.slot(), what.terms(&found.err));
    OpenSet {
        record: CorrectionRecord { slot, terms, signature, ratio: None },
        block_ratio: block_ratio(base, &columns, &found.left, found.precision),
        gain: found.gain,
        choice: found.choice,
        writable: WrittenVariation::new(&base.document(), &found).map(Writable::Varying),
        words: Some(what.words()),
        rivals: Vec::new(),
    }
}

/// The terms that explain the residual under a noise model, beside the log likelihood of `none`; `None` where there are none.
fn choose(base: &Base<'_>, kind: NoiseKind, terms: &[Term], noise: &Whitener, none: f64) -> Option<Chosen> {
    let layout = &base.model.data().layout;
    let view = View::new(base, noise);
    let (usable, columns): (Vec<usize>, Vec<Vec<f64>>) = terms
        .iter()
        .enumerate()
        .filter_map(|(i, t)| {
            let (whole, w) = view.column(&t.column);
            (whole.is_finite() && norm2(&w) > RANK_TOLERANCE * whole).then_some((i, w))
        })
        .unzip();
    let phi = Matrix::from_columns(&columns)?;
    // Hundreds of columns of a long recording, twice, are most of the memory of a diagnosis.
    drop(columns);
    let options = Selecting { criterion: Criterion::SearchedPress, max_terms: MOST_TERMS, ..Selecting::default() };
    let selection = select(&phi, &view.r, &options).ok()?;
    if selection.terms.is_empty() {
        return None;
    }
    let chosen: Vec<usize> = selection.terms.iter().map(|&j| usable[j]).collect();
    let picked: Vec<&[f64]> = chosen.iter().map(|&i| terms[i].column.as_slice()).collect();
    let order = if kind == NoiseKind::Coloured { MAX_AR } else { 0 };
    let mut left = noise.clone();
    let (mut coefficients, mut after) = regress(base, &picked, &left, None, 0.0);
    for _ in 0..2 {
        left = layout.fit_noise(&after, order, &base.paths);
        (coefficients, after) = regress(base, &picked, &left, None, 0.0);
    }
    let data = base.model.data();
    let likelihood = kind.share() * (log_likelihood(data, &left, &after) + spared(data, &left, &base.whitener));
    // Generic terms pay for their coefficients what an effect pays for its parameters, and for having been chosen out of many.
    let among: f64 = (0..chosen.len()).map(|k| ((usable.len() - k) as f64 / (k + 1) as f64).ln()).sum();
    let further = Count { lasting: chosen.len(), passing: 0 };
    let price = kind.price(base.model.count().lasting, further, after.len()) + among;
    let err = selection.steps.iter().map(|s| s.err).collect();
    Some(Chosen { terms: chosen, err, coefficients, left, gain: likelihood - none - price, choice: among })
}

#[cfg(test)]
mod tests;
