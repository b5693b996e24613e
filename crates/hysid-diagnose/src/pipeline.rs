//! The steps of a diagnosis, in order: intake, calibration, test, screening, refit, composition, verdict, hold-out.

use hysid_plant::Simulation;

use crate::answer::draw::{Sitting, picture};
use crate::answer::file::*;
use crate::answer::picture::Picture;
use crate::answer::records::*;
use crate::answer::text::number;
use crate::calibration::fair::calibrate;
use crate::data::glitches::{mended, told};
use crate::data::intake::{Intake, intake};
use crate::error::DiagnoseError;
use crate::experiment::fresh::gamble;
use crate::experiment::separating;
use crate::model::Count;
use crate::model::base::NoiseKind;
use crate::model::force::pushed;
use crate::model::hold::free_run;
use crate::openset::left::Left;
use crate::openset::{uneven, wanders};
use crate::request::{Hooks, Request};
use crate::search::budget::{Budget, Step};
use crate::search::explore::{Explored, LESSONS, explore};
use crate::search::hypothesis::{Hypothesis, Setting};
use crate::search::leaves_more;
use crate::verdict::firmness::{firmness, likelihoods};
use crate::verdict::reliability::recalibrate;
use crate::verdict::weigh::*;
use crate::verdict::{FIRM, Hypothesis as Weighed, NOT_FIRM, Support, verdict};

/// The outcome of a diagnosis.
#[derive(Debug, Clone)]
pub struct Diagnosis {
    /// The verdict as it is written to `diagnosis.json`.
    pub file: DiagnosisFile,
    /// The user's simulation with its calibrated parameters.
    pub baseline: Simulation,
    /// The simulation with the effects in it, calibrated; `None` where no effect was named or modelled.
    pub augmented: Option<Simulation>,
    /// The series behind the verdict.
    pub picture: Picture,
}

/// What speaks against writing a set into the simulation, in words; `least` is the simulation as it is with the least error.
fn veto(best: &Hypothesis<'_>, least: &Hypothesis<'_>, worse_on_blocks: bool) -> Option<&'static str> {
    if worse_on_blocks {
        Some(
            "the best set of effects predicts held-out blocks of the recordings no better than the simulation as it is: it is no improvement outside the data it was fitted to",
        )
    } else if leaves_more(best, least) {
        Some(
            "the best set of effects leaves a larger error than the simulation as it is, and what it gains is that the error looks more like noise: it explains nothing",
        )
    } else {
        None
    }
}

/// Diagnoses a simulation.
///
/// # Errors
/// Bad input; never a numerical event.
pub fn diagnose(request: &Request<'_>, hooks: &Hooks<'_>) -> Result<Diagnosis, DiagnoseError> {
    let options = request.options;
    let simulation = request.simulation;
    let Intake { data: recorded, held, mut notes } = intake(request, hooks)?;

    (hooks.progress)("calibrating the simulation");
    let budget = Budget::new(hooks.expired);
    let mut setting = Setting {
        data: &recorded,
        original: simulation.clone(),
        pushed: pushed(simulation),
        substeps: 2,
        own_unknowns: Count::default(),
        iterations: 12,
        noise: NoiseKind::Coloured,
        budget: &budget,
    };
    let mut base = calibrate(&mut setting, request)?;
    let mended = mended(simulation, &recorded, &base.fit.residual);
    if let Some(data) = &mended {
        notes.extend_from_slice(&data.notes[recorded.notes.len()..]);
        setting.data = data;
        base = calibrate(&mut setting, request)?;
    }
    let data = setting.data;
    (hooks.accepted)();
    setting.own_unknowns = base.model.count();
    let found = explore(&setting, base, request, hooks, LESSONS)?;
    let Explored { search, pool, candidates, significant, p_value, residual, detectable, least, notes: heard } = found;
    let (search, setting) = (&search, &search.setting);
    let residual_rms = by_column(simulation, &residual);
    let mut file = DiagnosisFile {
        schema: SCHEMA.into(),
        verdict: VerdictKind::NoSignificantMismatch,
        summary: String::new(),
        mismatch: MismatchRecord {
            p_value: finite(p_value),
            residual_rms: residual_rms.clone(),
            noise_rms: residual_rms,
            detectable,
        },
        location: None,
        effects: Vec::new(),
        alternatives: Vec::new(),
        fit: Vec::new(),
        remaining: None,
        correction: None,
        experiment: None,
        calibrated_parameters: Vec::new(),
        notes,
        seed: options.seed,
    };
    file.notes.extend(heard);
    let baseline = pool[0].base.document();
    file.notes.extend(answers(&pool, request.questions));

    (hooks.progress)("weighing the evidence");
    let weighed: Vec<Weighed> = pool.iter().map(weigh).collect();
    let blocks = block_scores(setting, &pool);
    let winner = if significant { tie_broken(&pool, &blocks) } else { 0 };
    let mut left = Left::of(search, &pool, winner, significant);
    let probability = likelihoods(&pool, &weighed, &blocks, winner, left.imperfect);
    let mut support = firmness(&pool, &weighed, &probability, winner, left.imperfect);
    // Where something is left, or rivals were not heard, nothing is firm anyway, and what is missing looks like a strength that varies.
    let uneven = if left.imperfect || budget.unfinished() {
        vec![None; pool[winner].effects.len()]
    } else {
        uneven(&pool[winner].base, setting.noise, &pool[winner].effects)
    };
    for (s, u) in support.iter_mut().zip(&uneven) {
        s.discount(u.map_or(0.0, |u| u.probability));
    }
    // Nor is a parameter that changes once told from one that wanders by its name alone.
    let wandering = wanders(search, &pool, winner);
    for (s, w) in support.iter_mut().zip(&wandering) {
        s.discount(w.as_ref().map_or(0.0, |w| w.probability));
    }
    // On four turns a play and a sum of plays are one law: what a law needs to be told from its neighbours it needs to be told firmly.
    let lacking = lacking(&pool[winner], &candidates);
    support.iter_mut().zip(&lacking).filter(|(_, l)| l.is_some()).for_each(|(s, _)| s.weaken());
    // A search that was cut short has not heard all rivals.
    if budget.unfinished() {
        support.iter_mut().for_each(Support::weaken);
    }
    file.verdict = verdict(&support);
    // A mismatch that is significant stays one, though nothing that was fitted in time explains it.
    let unexplained = significant && winner == 0 && budget.unfinished();
    if unexplained {
        file.verdict = VerdictKind::Ambiguous;
    }
    let best = &pool[winner];
    let contest = Contest { pool: &pool, weighed: &weighed, probability: &probability, winner };
    file.effects = effects(best, &support);
    if significant {
        file.alternatives = alternatives(&contest, file.verdict);
        file.location = location(&pool[0], best, &candidates);
        if let (Some(l), Some(parted)) = (&mut file.location, from_moment(&file.effects, &data)) {
            l.time_s = vec![parted];
        }
        let noise = best.base.whitener.models.iter().map(|m| m.noise_rms()).collect::<Vec<_>>();
        file.mismatch.noise_rms = by_column(simulation, &noise);
    }
    // Under a noise of its own a simulation may leave more than it has to.
    let least = least.as_ref().unwrap_or(&pool[0]);
    let veto = if winner > 0 { veto(best, least, worse_on_blocks(&blocks, winner)) } else { None };
    let vetoed = veto.is_some();
    if let Some(why) = veto {
        file.verdict = VerdictKind::Ambiguous;
        for e in &mut file.effects {
            e.support = e.support.min(NOT_FIRM);
            e.family_support = e.family_support.min(NOT_FIRM);
        }
        file.notes.push(format!("{why}, and no augmented simulation is written"));
    }
    if significant
        && matches!(file.verdict, VerdictKind::Family | VerdictKind::Ambiguous)
        && winner > 0
        && !budget.omits(Step::Experiment)
    {
        (hooks.progress)("looking for an experiment");
        file.experiment = separating(setting, &contest, &mut file.alternatives, options.seed, hooks.expired);
    }
    file.remaining = left.record(&pool, winner);
    let elsewhere = uneven.iter().flatten().any(|u| u.probability >= FIRM);
    if (elsewhere || left.is_outside(&support, file.remaining.as_ref())) && !budget.unfinished() {
        file.verdict = VerdictKind::NotInCatalogue;
    }
    // What is significant stays so, though no set outweighs its price: the likeliest is told, neither believed nor written.
    if significant && file.verdict == VerdictKind::NoSignificantMismatch {
        file.verdict = VerdictKind::Ambiguous;
        if let Some(likeliest) = likeliest(&weighed) {
            file.effects = effects(&pool[likeliest], &firmness(&pool, &weighed, &probability, likeliest, true));
        }
        file.notes.push("simulation and recording differ by more than noise does, but no effect and no generic term outweighs what its parameters cost: what is told is the likeliest, and no augmented simulation is written".into());
    }
    let gamble = if winner > 0 && !vetoed { gamble(setting, &contest) } else { None };
    if let Some(share) = gamble {
        file.notes.push(format!("on the recorded inputs mirrored and reversed in time the sets of effects that remain differ: each taken for the true one with its probability, the set that is told would make {} of the squared errors that it and the simulation as it is make together (a half: no better than that): no augmented simulation is written, since it may be worse than nothing there", number(share)));
    }
    let named = if winner > 0 && !vetoed && gamble.is_none() && !left.foreign { winner } else { 0 };
    let modelled = if file.verdict == VerdictKind::NotInCatalogue {
        (hooks.progress)("writing the correction into the simulation");
        left.modelled(search, &pool, winner, named)
    } else {
        None
    };
    if modelled.is_some() {
        file.notes.push("the augmented simulation holds the sparse correction, refitted, and no physics that has a name: it predicts blocks of the recordings that it was not fitted to better, and says nothing outside their range".into());
    } else if left.spectrum {
        file.notes.push("several relaxations stand beside each other: a memory with many time scales (a fractional element, a spectrum of relaxation times), which the catalogue does not have; within the band of the recording their sum follows it".into());
    } else if left.foreign && !vetoed && budget.unfinished() {
        file.notes.push("generic terms explain far more than the effects that were fitted in time; no augmented simulation is written".into());
    } else if left.foreign && !vetoed {
        file.notes.push("the best set of effects imitates something that the catalogue does not have: generic terms explain far more; no augmented simulation is written, since an imitation may be worse than nothing on another input".into());
    }
    let written = modelled.as_ref().or((named > 0).then_some(best));
    let last = modelled.as_ref().unwrap_or(best);
    let spectrum = left
        .spectrum
        .then_some("a memory with many time scales, a fractional element or a spectrum of relaxation times");
    let (correction, varying) = left.believed().unzip();
    file.correction = correction;
    // What is not of the catalogue lives where the correction acts, not where an effect imitates it.
    if let (VerdictKind::NotInCatalogue, Some(location), Some(c)) = (file.verdict, &mut file.location, &file.correction)
    {
        location.slot.clone_from(&c.slot);
        location.block = block_of(c).name().into();
    }
    let varying = varying.flatten();
    file.notes.extend(varying.iter().map(|words| format!("what is left looks like something that varies: {words}")));

    recalibrate(&mut file);
    let unequal: Vec<String> = (best.effects.iter().zip(&uneven).zip(&file.effects))
        .filter_map(|((e, u), told)| u.as_ref()?.beside(told.support, told.probability).words(e))
        .collect();
    file.notes.extend(unequal.iter().map(|words| format!("{words}: the catalogue has no such law")));
    file.notes.extend(best.effects.iter().zip(&wandering).filter_map(|(e, w)| w.as_ref()?.in_place_of(e)));

    (hooks.progress)("scoring on the hold-out");
    let augmented = written.map(|h| h.base.document());
    let before = free_run(&baseline, &held, setting.substeps);
    let after = augmented.as_ref().and_then(|a| free_run(a, &held, setting.substeps));
    if let Some(run) = &before {
        let errors: Vec<f64> = held.y.iter().zip(&run.prediction).map(|(y, p)| y - p).collect();
        file.notes.extend(told(simulation, &held, &errors));
    }
    file.fit = fits(simulation, &held, before.as_ref(), after.as_ref(), options.seed, request.holdout.is_empty());
    file.calibrated_parameters = calibrated(&last.base, simulation);
    file.notes.extend(absorbing(&pool[0].base, simulation));
    file.notes.extend(lacking.into_iter().flatten());
    let unequal = (!unequal.is_empty()).then(|| unequal.join("; "));
    file.summary = summary(&file, varying.as_deref().or(spectrum), unequal.as_deref());
    if let Some(note) = budget.note() {
        if unexplained {
            file.summary = "Something is missing; the search was cut short by the time limit before an effect was found that explains it.".into();
        } else if budget.unfinished() && file.verdict == VerdictKind::NoSignificantMismatch {
            file.summary =
                "The search was cut short by the time limit; what was done of it shows no significant mismatch.".into();
        }
        file.notes.push(note);
    }
    let noise: Vec<f64> = simulation.outputs.iter().map(|o| file.mismatch.noise_rms[&o.column]).collect();
    let picture = picture(&Sitting {
        simulation,
        data: &data,
        none: &pool[0],
        best: last,
        held: &held,
        before: before.as_ref(),
        after: after.as_ref(),
        noise: &noise,
    });
    Ok(Diagnosis { file, baseline, augmented, picture })
}
