//! The recipe: families compete at each rate, the winner is refined on everything.

use hysid_narx::{Coefficient, Fit, NarxModel, Parts, Refine};
use hysid_signal::Recording;

use super::coloured::with_noise;
use super::compete::{Winner, compete, movable};
use super::data::{Samples, gather};
use super::desk::Desk;
use super::family::Family;
use super::growth::Stage;
use super::options::Options;
use super::path::PathPoint;
use super::rates::{PREFER_OWN_RATE, rates};
use super::report::every;
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
                    "{}: held-out free run {:.4e} by {}",
                    every(rate),
                    w.stage.held.rmse,
                    w.family.name
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
