//! The competition at one rate: families are judged by the held-out free run, the best of each kind grow on.

use hysid_narx::Refine;
use rayon::prelude::*;

use super::IdentifyError;
use super::blocks::best_block;
use super::criterion::by_criterion;
use super::desk::{Desk, within_chance};
use super::families::families;
use super::family::Family;
use super::growth::{Budget, Stage, grow, start};
use super::linear::{Linear, best, good, ladder};
use super::path::{PathPoint, path};
use super::plays::best_plays;
use super::recipe::Progress;

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

/// The best model at one rate.
pub(super) struct Winner<'a> {
    /// Where it was judged.
    pub(super) desk: Desk<'a>,
    /// Its family.
    pub(super) family: Family,
    /// The model.
    pub(super) stage: Stage,
    /// What it was judged by: the held-out error, raised for what is unsound.
    pub(super) score: f64,
    /// The linear yardstick.
    pub(super) linear: Linear,
    /// What was decided and why.
    pub(super) decisions: Vec<String>,
    /// The path to the model.
    pub(super) path: Vec<PathPoint>,
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

/// Lets the families compete at one rate.
///
/// # Errors
/// [`IdentifyError`]: no stable linear model, or what went wrong on the way.
pub(super) fn compete<'a>(mut desk: Desk<'a>, progress: Progress<'_>) -> Result<Winner<'a>, IdentifyError> {
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
pub(super) fn movable(family: &Family) -> Refine {
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
