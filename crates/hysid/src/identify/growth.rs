//! One family's path: from the linear model on, the term that would help the free run most, then refinement, and again.

use hysid_narx::{Evaluate, Fit, NarxError, Refine, RunError, Trainer, Window};

use super::family::Family;

/// One model on a family's path.
#[derive(Debug, Clone)]
pub(crate) struct Stage {
    pub fit: Fit,
    /// Free-run error on the samples that the search looked at.
    pub taught: RunError,
    /// Free-run error on the held-out samples.
    pub held: RunError,
}

/// How far a path goes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Budget {
    /// Largest number of terms.
    pub terms: usize,
    /// Stop after so many terms without a better held-out error.
    pub patience: usize,
    /// Refinement steps after each term.
    pub steps: usize,
    /// Terms that may be exchanged for better ones at the end.
    pub exchanges: usize,
}

/// A term whose loss would raise the squared error by less than this share goes.
const NEEDED: f64 = 2e-4;

/// Refinement steps of a linear start.
const START_STEPS: usize = 20;

/// The linear start of a family, refined; `None` where no stable one was found.
pub(crate) fn start(
    trainer: &mut Trainer,
    family: &Family,
    search: &[Window],
    hold: &[Window],
) -> Result<Option<Stage>, NarxError> {
    start_from(trainer, family, None, search, hold, START_STEPS, Refine::Coefficients)
}

/// The same from a known fit, or from least squares.
pub(crate) fn start_from(
    trainer: &mut Trainer,
    family: &Family,
    from: Option<Fit>,
    search: &[Window],
    hold: &[Window],
    steps: usize,
    refine: Refine,
) -> Result<Option<Stage>, NarxError> {
    let fit = match from {
        Some(fit) => fit,
        None => trainer.least_squares(&family.linear, search)?,
    };
    let Some(fit) = stabilised(trainer, fit, search)? else { return Ok(None) };
    let (fit, taught) = trainer.refine(fit, search, steps, refine)?;
    let held = trainer.error(&fit, hold)?;
    Ok(Some(Stage { fit, taught, held }))
}

/// The fit, with the output's coefficients drawn towards a stable model as far as the free run needs it.
fn stabilised(trainer: &mut Trainer, fit: Fit, windows: &[Window]) -> Result<Option<Fit>, NarxError> {
    for shrink in [1.0, 0.9999, 0.999, 0.995, 0.98, 0.95, 0.9, 0.7, 0.4] {
        let mut trial = fit.clone();
        for (term, theta) in trial.terms.iter().zip(&mut trial.theta) {
            if term.uses_output() {
                // Scaling lag l by shrink^l moves every pole of the linear part inwards by this factor.
                *theta *= f64::powi(shrink, term.reach() as i32);
            }
        }
        if trainer.error(&trial, windows)?.rmse.is_finite() {
            return Ok(Some(trial));
        }
    }
    Ok(None)
}

/// The stages from `first` on. Every stage free-runs on the search windows.
pub(crate) fn grow(
    trainer: &mut Trainer,
    family: &Family,
    first: Stage,
    search: &[Window],
    hold: &[Window],
    budget: Budget,
    refine: Refine,
) -> Result<Vec<Stage>, NarxError> {
    let mut stages = vec![first];
    let mut since_best = 0;
    let mut best = stages[0].held.rmse;
    // Pruning can take back what growth adds: the number of rounds is bounded, too.
    for _ in 0..2 * budget.terms {
        let current = &stages[stages.len() - 1];
        if current.fit.terms.len() >= budget.terms || since_best >= budget.patience {
            break;
        }
        // The recorded output is the better guide while the model is far from it, its own run when it is near.
        let evaluate = if stages.len() <= 4 { Evaluate::Recorded } else { Evaluate::FreeRun };
        let Some(next) = one_more(trainer, family, current, search, hold, budget, refine, evaluate)? else { break };
        if next.held.rmse < 0.995 * best {
            best = next.held.rmse;
            since_best = 0;
        } else {
            since_best += 1;
        }
        stages.push(next);
    }
    exchange(trainer, family, &mut stages, search, hold, budget, refine)?;
    Ok(stages)
}

/// Terms that the path took early may be needed least at its end.
const GIVE_BACK: usize = 3;
/// An exchange must lower the error by this share.
const BETTER: f64 = 0.003;

/// Gives back one of the terms that the last model needs least and takes the best other one, as long as that helps.
fn exchange(
    trainer: &mut Trainer,
    family: &Family,
    stages: &mut Vec<Stage>,
    search: &[Window],
    hold: &[Window],
    budget: Budget,
    refine: Refine,
) -> Result<(), NarxError> {
    for _ in 0..budget.exchanges {
        let Some(current) = stages.last().cloned() else { return Ok(()) };
        let need = trainer.need_of_terms(&current.fit, search)?;
        let mut order: Vec<usize> = (0..need.len()).collect();
        order.sort_by(|a, b| need[*a].total_cmp(&need[*b]));
        let mut better = None;
        for k in order.into_iter().take(GIVE_BACK) {
            let mut fit = current.fit.clone();
            let given_back = fit.terms.remove(k);
            fit.theta.remove(k);
            let (fit, taught) = trainer.refine(fit, search, budget.steps, refine)?;
            if !taught.rmse.is_finite() {
                continue;
            }
            let shorter = Stage { fit, taught, held: current.held };
            let others = Family {
                candidates: family.candidates.iter().filter(|t| **t != given_back).cloned().collect(),
                ..family.clone()
            };
            let next = one_more(trainer, &others, &shorter, search, hold, budget, refine, Evaluate::FreeRun)?;
            if let Some(next) = next.filter(|n| n.taught.rmse < (1.0 - BETTER) * current.taught.rmse) {
                better = Some(next);
                break;
            }
        }
        let Some(next) = better else { return Ok(()) };
        stages.push(next);
    }
    Ok(())
}

#[expect(clippy::too_many_arguments, reason = "one step of `grow`, which holds them all")]
fn one_more(
    trainer: &mut Trainer,
    family: &Family,
    current: &Stage,
    search: &[Window],
    hold: &[Window],
    budget: Budget,
    refine: Refine,
    evaluate: Evaluate,
) -> Result<Option<Stage>, NarxError> {
    let open: Vec<_> = family.candidates.iter().filter(|t| !current.fit.terms.contains(t)).cloned().collect();
    let gains = trainer.next_terms(&current.fit, &open, search, 3, evaluate)?;
    for gain in gains {
        let mut fit = current.fit.clone();
        fit.terms.push(open[gain.candidate].clone());
        fit.theta.push(0.0);
        let (fit, taught) = trainer.refine(fit, search, budget.steps, refine)?;
        if taught.rmse < current.taught.rmse * (1.0 - 1e-6) {
            let (fit, taught) = pruned(trainer, fit, taught, search, budget, refine)?;
            let held = trainer.error(&fit, hold)?;
            return Ok(Some(Stage { fit, taught, held }));
        }
    }
    Ok(None)
}

/// The fit without the terms that it can do without; the last term stays.
fn pruned(
    trainer: &mut Trainer,
    mut fit: Fit,
    mut error: RunError,
    search: &[Window],
    budget: Budget,
    refine: Refine,
) -> Result<(Fit, RunError), NarxError> {
    loop {
        let need = trainer.need_of_terms(&fit, search)?;
        let least = need.iter().enumerate().take(need.len().saturating_sub(1)).min_by(|a, b| a.1.total_cmp(b.1));
        let Some((k, _)) = least.filter(|(_, n)| **n < NEEDED) else { return Ok((fit, error)) };
        let mut shorter = fit.clone();
        shorter.terms.remove(k);
        shorter.theta.remove(k);
        let (shorter, e) = trainer.refine(shorter, search, budget.steps, refine)?;
        if !(e.rmse < error.rmse * (1.0 + 2.0 * NEEDED)) {
            return Ok((fit, error));
        }
        (fit, error) = (shorter, e);
    }
}
