//! The recipe: families compete on the held-out free run, the best grow on, the winner is refined on everything.

use hysid_narx::{Coefficient, Fit, NarxModel, Parts, Refine};
use hysid_signal::Recording;
use rayon::prelude::*;

use super::blocks::best_block;
use super::coloured::with_noise;
use super::criterion::by_criterion;
use super::data::{Samples, gather};
use super::desk::{Desk, within_chance};
use super::families::families;
use super::family::Family;
use super::growth::{Budget, Stage, grow, start};
use super::linear::{Linear, best, good, ladder};
use super::options::Options;
use super::path::{PathPoint, path};
use super::plays::best_plays;
use super::rates::{PREFER_OWN_RATE, rates};
use super::verify::{horizon, warnings};
use super::{Horizon, IdentifyError};

/// What to learn from: recordings and the names of their columns.
#[derive(Debug, Clone, Copy)]
pub struct Source<'a> {
    /// The estimation recordings.
    pub recordings: &'a [Recording],
    /// Columns of the inputs.
    pub inputs: &'a [String],
    /// Column of the output.
    pub output: &'a str,
}

/// What an identification found.
#[derive(Debug, Clone)]
pub struct Identified {
    /// The model.
    pub model: NarxModel,
    /// The linear model of the same kind, identified and refined the same way, as a yardstick.
    pub linear: NarxModel,
    /// What was decided and why, in order.
    pub decisions: Vec<String>,
    /// What the user should be wary of.
    pub warnings: Vec<String>,
    /// Free-run error on the held-out blocks before the final refinement.
    pub held_rmse: f64,
    /// How far ahead it holds on the held-out blocks.
    pub horizon: Horizon,
    /// The path to the model.
    pub path: Vec<PathPoint>,
}

/// Told what is being done, from any thread.
pub type Progress<'a> = &'a (dyn Fn(&str) + Sync);

/// Asked, from any thread, whether to give up.
pub type Stop<'a> = &'a (dyn Fn() -> bool + Sync);

/// Samples that the first and the second round look at.
const LOOKS: [usize; 2] = [4000, 9000];
/// Samples for each linear term that it looks at, at least: with fewer a long model fits what is by chance in them.
pub(super) const PER_TERM: usize = 100;
/// Terms that a family grows by in the first round.
const FIRST_TERMS: usize = 8;
/// Families that grow on, of different kinds.
const KEPT: usize = 3;
/// One more is kept: the one with the shortest memory of those whose score is within this share of the best.
const SHORT_AND_NEAR: f64 = 0.15;
/// A family with more linear terms than this is grown with less care.
const LARGE: usize = 60;
/// Terms that may be exchanged at the end of a path.
const EXCHANGES: usize = 8;
/// Terms of a model whose number nobody has decided: at most this, or the linear terms and half as many again.
const MOST_TERMS: usize = 25;
/// The shortest model whose score is within this share of the lowest is taken.
const NEAR: f64 = 0.02;
/// Families whose scores differ by less than this share are equally good.
const EQUAL: f64 = 0.05;
/// Samples at the beginning of a stretch during which derived inputs find their state, at most; and as a share of it.
const SETTLE: (usize, f64) = (200, 0.1);
/// Refinement steps on all samples.
const FINAL_STEPS: usize = 12;

/// From recordings a model whose free run is good and stable on held-out blocks of them.
///
/// # Errors
/// [`IdentifyError`]: what is wrong with the recordings or the options.
pub fn identify(source: Source<'_>, options: &Options, progress: Progress<'_>) -> Result<Identified, IdentifyError> {
    identify_until(source, options, progress, &|| false)
}

/// As [`identify`], given up where `stop` says so: it is asked before each round of each family.
///
/// # Errors
/// [`IdentifyError`]; [`IdentifyError::Stopped`] where it was given up.
pub fn identify_until(
    source: Source<'_>,
    options: &Options,
    progress: Progress<'_>,
    stop: Stop<'_>,
) -> Result<Identified, IdentifyError> {
    if let Some(problem) = options.problem() {
        return Err(IdentifyError::Option(problem));
    }
    if source.inputs.is_empty() {
        return Err(IdentifyError::Nothing("input"));
    }
    let samples = gather(source)?;
    check(source, &samples)?;
    let (rates, mut decisions) = rates(&samples, options);
    let mut found: Option<Winner<'_>> = None;
    let mut refused = None;
    for rate in rates {
        let desk = Desk::new(source, options, &samples, rate, stop)?;
        match compete(desk, progress) {
            Err(IdentifyError::Stopped) => return Err(IdentifyError::Stopped),
            Err(e) => refused = refused.or(Some(e)),
            Ok(w) => {
                decisions.push(format!(
                    "every {rate} sample(s): held-out free run {:.4e} by {}",
                    w.stage.held.rmse, w.family.name
                ));
                let bar = found.as_ref().map_or(f64::INFINITY, |f| f.score * PREFER_OWN_RATE);
                if w.score < bar || found.is_none() {
                    found = Some(w);
                }
            }
        }
    }
    match (found, refused) {
        (Some(winner), _) => finish(winner, decisions, progress),
        (None, e) => Err(e.unwrap_or(IdentifyError::Nothing("stable model"))),
    }
}

fn check(source: Source<'_>, samples: &[Samples]) -> Result<(), IdentifyError> {
    let constant = |column: &str, values: Vec<&Vec<f64>>| {
        let mut there = values.iter().flat_map(|v| v.iter()).filter(|v| v.is_finite());
        let Some(&first) = there.next() else { return Err(IdentifyError::Empty(column.to_string())) };
        if there.all(|v| *v == first) {
            return Err(IdentifyError::Constant { column: column.to_string(), value: first });
        }
        Ok(())
    };
    constant(source.output, samples.iter().map(|s| &s.y).collect())?;
    for (i, name) in source.inputs.iter().enumerate() {
        constant(name, samples.iter().map(|s| &s.inputs[i]).collect())?;
    }
    Ok(())
}

/// The best model at one rate.
struct Winner<'a> {
    desk: Desk<'a>,
    family: Family,
    stage: Stage,
    score: f64,
    linear: Linear,
    decisions: Vec<String>,
    path: Vec<PathPoint>,
}

/// A family under way.
#[derive(Clone)]
struct Runner {
    family: Family,
    stage: Stage,
    score: f64,
    /// The stages that it has passed through.
    passed: Vec<Stage>,
    /// Mean squared errors on parts of the held-out blocks.
    parts: Vec<f64>,
}

impl Runner {
    /// Whether its score is within this share of the best one's, or no further away than the standard error of the
    /// difference, part by part of the held-out blocks.
    fn level_with(&self, best: &Self, share: f64) -> bool {
        if self.score <= (1.0 + share) * best.score {
            return true;
        }
        let raised = |r: &Self| {
            let factor = if r.stage.held.rmse > 0.0 { (r.score / r.stage.held.rmse).powi(2) } else { 1.0 };
            r.parts.iter().map(|p| factor * p).collect::<Vec<f64>>()
        };
        within_chance(&raised(self), &raised(best))
    }

    /// Samples that the model reaches back.
    fn memory(&self) -> usize {
        self.stage.fit.terms.iter().map(hysid_dictionary::Term::reach).max().unwrap_or(0)
    }
}

fn compete<'a>(mut desk: Desk<'a>, progress: Progress<'_>) -> Result<Winner<'a>, IdentifyError> {
    let mut decisions = Vec::new();
    let ladder = ladder(&desk, progress)?;
    let Some(linear) = best(&ladder).cloned() else { return Err(IdentifyError::Nothing("stable linear model")) };
    let good = good(&ladder).map(|l| (&l.stage.fit, l.family.given()));
    desk.calibrate_trials(good)?;
    for l in &ladder {
        decisions.push(format!("{}: held-out free run {:.4e}", l.family.name, l.stage.held.rmse));
    }
    progress("block structures");
    let block = best_block(&desk, &ladder)?;
    let mut starts: Vec<(Family, Option<Stage>)> = families(&desk, &ladder).into_iter().map(|f| (f, None)).collect();
    starts.extend(block.map(|(f, s)| (f, Some(s))));
    progress("operators with memory");
    starts.extend(best_plays(&desk, &ladder)?.into_iter().map(|(f, s)| (f, Some(s))));
    let mut runners: Vec<Runner> = starts
        .into_par_iter()
        .map(|(family, stage)| first_round(&desk, family, stage, progress))
        .collect::<Result<Vec<_>, _>>()?
        .into_iter()
        .flatten()
        .collect();
    runners.sort_by(|a, b| a.score.total_cmp(&b.score));
    for r in &runners {
        decisions.push(format!(
            "{}: {} candidates, {} terms at first: held-out free run {:.4e}, score {:.4e}",
            r.family.name,
            r.family.candidates.len(),
            r.stage.fit.terms.len(),
            r.stage.held.rmse,
            r.score
        ));
    }
    // Families of one kind are near copies of each other: the best of each kind goes on.
    let mut seen = std::collections::HashSet::new();
    runners.retain(|r| seen.insert(r.family.kind()));
    let level = |r: &Runner| runners.first().is_some_and(|best| r.level_with(best, SHORT_AND_NEAR));
    let short = (0..runners.len()).filter(|&i| level(&runners[i])).min_by_key(|&i| runners[i].memory());
    if let Some(i) = short.filter(|&i| i >= KEPT) {
        runners.swap(i, KEPT);
        runners.truncate(KEPT + 1);
    } else {
        runners.truncate(KEPT);
    }
    let grown = runners
        .into_par_iter()
        .map(|r| second_round(&desk, r, progress))
        .collect::<Result<Vec<_>, _>>()?
        .into_iter()
        .flatten();
    let mut finalists = Vec::new();
    for r in grown {
        decisions.push(format!(
            "{}: grown to {} terms: held-out free run {:.4e}, score {:.4e}",
            r.family.name,
            r.stage.fit.terms.len(),
            r.stage.held.rmse,
            r.score
        ));
        finalists.push(r);
    }
    // Of models that are about equally good the one with the shortest memory, then with the fewest terms, is the soundest.
    let yardstick = Runner {
        score: desk.score(&linear.stage, linear.family.given())?,
        parts: desk.held_parts(&linear.stage.fit, linear.family.given())?,
        family: linear.family.clone(),
        stage: linear.stage.clone(),
        passed: Vec::new(),
    };
    finalists.sort_by(|a, b| a.score.total_cmp(&b.score));
    let lowest = finalists.first().filter(|f| f.score < yardstick.score).unwrap_or(&yardstick);
    let mut sound: Vec<&Runner> = finalists.iter().filter(|f| f.level_with(lowest, EQUAL)).collect();
    // The linear model must be level but for chance: a share would hide what is small beside the noise.
    sound.extend(Some(&yardstick).filter(|y| y.level_with(lowest, 0.0)));
    let winner = sound.into_iter().min_by_key(|f| (f.memory(), f.stage.fit.terms.len()));
    let mut runner = winner.unwrap_or(&yardstick).clone();
    let path = path(&desk, &runner.family, &runner.passed)?;
    if let Some(stage) = by_criterion(&desk, &runner.family, &runner.stage.fit.derived)? {
        decisions.push(format!(
            "{:?} of one-step regression decided on {} terms: held-out free run {:.4e}",
            desk.options.criterion,
            stage.fit.terms.len(),
            stage.held.rmse
        ));
        runner.stage = stage;
    }
    Ok(Winner { desk, family: runner.family, stage: runner.stage, score: runner.score, linear, decisions, path })
}

/// What refinement may move in this family while it grows.
fn movable(family: &Family) -> Refine {
    if family.derived.is_empty() { Refine::Coefficients } else { Refine::CoefficientsAndDerived }
}

/// Samples that the search in this family looks at in a round.
fn look(family: &Family, round: usize) -> usize {
    LOOKS[round].max(PER_TERM * family.linear.len())
}

fn first_round(
    desk: &Desk<'_>,
    family: Family,
    stage: Option<Stage>,
    progress: Progress<'_>,
) -> Result<Option<Runner>, IdentifyError> {
    desk.go_on()?;
    progress(&family.name);
    let mut trainer = desk.trainer(&family.derived, family.given())?;
    let s = desk.split(&trainer, look(&family, 0))?;
    let stage = match stage {
        Some(stage) => Some(stage),
        None => start(&mut trainer, &family, &s.search, &s.hold)?,
    };
    let Some(stage) = stage else { return Ok(None) };
    let budget = Budget { terms: stage.fit.terms.len() + FIRST_TERMS, patience: FIRST_TERMS, steps: 4, exchanges: 0 };
    let path = grow(&mut trainer, &family, stage, &s.search, &s.hold, budget, Refine::Coefficients)?;
    let mut best: Option<(f64, Stage)> = None;
    for stage in &path {
        let score = desk.score(stage, family.given())?;
        if best.as_ref().is_none_or(|b| score < b.0) {
            best = Some((score, stage.clone()));
        }
    }
    let Some((score, stage)) = best.filter(|b| b.0.is_finite()) else { return Ok(None) };
    let parts = desk.held_parts(&stage.fit, family.given())?;
    Ok(Some(Runner { family, stage, score, passed: path, parts }))
}

fn second_round(desk: &Desk<'_>, runner: Runner, progress: Progress<'_>) -> Result<Option<Runner>, IdentifyError> {
    let Runner { family, stage, score, mut passed, .. } = runner;
    desk.go_on()?;
    progress(&format!("growing {}", family.name));
    let mut trainer = desk.trainer(&family.derived, family.given())?;
    let large = family.linear.len() > LARGE;
    let s = desk.split(&trainer, look(&family, usize::from(!large)))?;
    let most = desk.options.terms.unwrap_or(MOST_TERMS.max(family.linear.len() + family.linear.len() / 2));
    // With very many terms every step is dear, and few of them matter.
    let (patience, steps, exchanges) = if large { (3, 3, 0) } else { (6, 6, EXCHANGES) };
    let budget = Budget { terms: most, patience, steps, exchanges };
    let (fit, taught) = trainer.refine(stage.fit.clone(), &s.search, 10, movable(&family))?;
    let held = trainer.error(&fit, &s.hold)?;
    let first = Stage { fit, taught, held };
    let stages = grow(&mut trainer, &family, first, &s.search, &s.hold, budget, movable(&family))?;
    // Refinement may have made the stage that came here worse on held-out blocks.
    let mut scored = vec![(score, &stage)];
    for stage in &stages {
        scored.push((desk.score(stage, family.given())?, stage));
    }
    let lowest = scored.iter().map(|s| s.0).fold(f64::INFINITY, f64::min);
    let near = |s: &&(f64, &Stage)| s.0 <= (1.0 + NEAR) * lowest;
    let pick = scored.iter().filter(near).min_by_key(|s| s.1.fit.terms.len());
    let pick = pick.map(|(score, stage)| (*score, (*stage).clone()));
    passed.extend(stages);
    let Some((score, stage)) = pick else { return Ok(None) };
    let parts = desk.held_parts(&stage.fit, family.given())?;
    Ok(Some(Runner { family, stage, score, passed, parts }))
}

fn finish(winner: Winner<'_>, mut decisions: Vec<String>, progress: Progress<'_>) -> Result<Identified, IdentifyError> {
    let Winner { desk, family, stage, linear, path, .. } = winner;
    decisions.extend(winner.decisions);
    progress("refining on all samples");
    let (model, fit, note) = whole(&desk, &family, &stage, movable(&family))?;
    decisions.push(note);
    let (model, note) = with_noise(&desk, model, &fit)?;
    decisions.push(note);
    let (yardstick, _, _) = whole(&desk, &linear.family, &linear.stage, Refine::Coefficients)?;
    let horizon = horizon(&desk, &family, &stage)?;
    let warnings = warnings(&desk, &family, &stage, &fit, &linear, horizon)?;
    let held_rmse = stage.held.rmse;
    Ok(Identified { model, linear: yardstick, decisions, warnings, held_rmse, horizon, path })
}

/// The stage's model refined on all samples, unless that makes it less sound.
fn whole(
    desk: &Desk<'_>,
    family: &Family,
    stage: &Stage,
    what: Refine,
) -> Result<(NarxModel, Fit, String), IdentifyError> {
    let mut trainer = desk.trainer(&stage.fit.derived, family.given())?;
    let mut windows = trainer.whole_windows();
    if !stage.fit.derived.is_empty() {
        // What a derived input remembered before the recording began is not known.
        for w in &mut windows {
            w.range.start += SETTLE.0.min((SETTLE.1 * w.range.len() as f64) as usize);
        }
    }
    let (fit, error) = trainer.refine(stage.fit.clone(), &windows, FINAL_STEPS, what)?;
    let before = desk.failed_trials(&stage.fit, family.given())?;
    let after = desk.failed_trials(&fit, family.given())?;
    let sound = error.rmse.is_finite() && after <= before;
    let (fit, note) = if sound {
        (fit, format!("refined on all samples: free run {:.4e}", error.rmse))
    } else {
        (
            stage.fit.clone(),
            "refining on all samples made the model less sound; the one of the search is kept".to_string(),
        )
    };
    let errors = trainer.standard_errors(&fit, &windows)?;
    let reduction = trainer.error_reduction(&fit.terms, &windows)?;
    let coefficients = fit
        .terms
        .iter()
        .zip(&fit.theta)
        .zip(errors.into_iter().zip(reduction))
        .map(|((t, &theta), (standard_error, err))| Coefficient { term: t.clone(), theta, standard_error, err })
        .collect();
    let model = NarxModel::new(Parts {
        signals: trainer.signals().clone(),
        derived: fit.derived.clone(),
        coefficients,
        noise: vec![],
        limit: desk.limit(),
        period_s: desk.source.recordings.first().map(|r| r.clock().period_s),
        decimation: desk.decimation,
    })?;
    Ok((model, fit, note))
}
