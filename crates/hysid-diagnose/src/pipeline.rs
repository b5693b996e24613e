//! The steps of a diagnosis, in order: intake, calibration, test, screening, refit, composition, verdict, hold-out.

use hysid_plant::Simulation;
use rayon::prelude::*;

use crate::answer::draw::{Sitting, picture};
use crate::answer::picture::Picture;
use crate::answer::reached::one_sided;
use crate::answer::records::*;
use crate::budget::{Budget, Step};
use crate::calibration::fair::calibrate;
use crate::data::DataSet;
use crate::data::glitches::{mended, told};
use crate::data::intake::{Intake, intake};
use crate::error::DiagnoseError;
use crate::evidence::NoiseModel;
use crate::experiment::astray::astray;
use crate::experiment::gamble::{gamble, safest};
use crate::experiment::separating;
use crate::file::*;
use crate::model::Count;
use crate::model::base::NoiseKind;
use crate::model::force::pushed;
use crate::model::hold::free_run;
use crate::model::hypothesis::{Effect, Hypothesis, Setting};
use crate::openset::in_words;
use crate::request::{Hooks, Request};
use crate::search::explore::{Explored, LESSONS, explore};
use crate::search::gentle::take_gentlest;
use crate::search::profile::{centre_moments, take_intervals};
use crate::search::rounding::Converter;
use crate::search::shaken::shake;
use crate::slot::{with_balances, with_turns, with_used_turns};
use crate::text::number;
use crate::verdict::elsewhere::elsewhere;
use crate::verdict::judgement::Judgement;
use crate::verdict::reliability::recalibrate;
use crate::verdict::remaining::left_by;
use crate::verdict::trifles::Trifle;

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

/// Diagnoses a simulation.
///
/// Equations are trees as deep as their sums are long, up to 10 000 symbols: threads of a pool of one's own need a stack of 32 MiB for the longest ones, as
/// the command's have; 2 MiB do for 4000 symbols.
///
/// # Errors
/// Bad input; never a numerical event.
pub fn diagnose(request: &Request<'_>, hooks: &Hooks<'_>) -> Result<Diagnosis, DiagnoseError> {
    let user = request.simulation;
    let prepared = with_turns(&with_balances(user));
    let request = &Request { simulation: &prepared, ..*request };
    let (simulation, options) = (request.simulation, request.options);
    let Intake { whole, held, mut notes } = intake(request, hooks)?;
    (hooks.progress)("calibrating the simulation");
    let budget = Budget::new(hooks.expired);
    let recorded = whole.thinned();
    let mut setting = Setting {
        data: &recorded,
        original: simulation.clone(),
        pushed: pushed(simulation),
        substeps: 2,
        rounded: Vec::new(),
        own_unknowns: Count::default(),
        iterations: 12,
        noise: NoiseKind::Coloured,
        budget: &budget,
    };
    let mut base = calibrate(&mut setting, request)?;
    // A mean over many samples hides what stands out of them: glitches are looked for in the samples.
    let mended = base.residual_on(&whole).and_then(|residual| mended(simulation, &whole, &residual));
    let mended = mended.as_ref().map(DataSet::thinned);
    if let Some(data) = mended.as_deref() {
        setting.data = data;
        base = calibrate(&mut setting, request)?;
    }
    let fresh: Vec<String> = setting.data.notes.iter().filter(|n| !notes.contains(n)).cloned().collect();
    notes.extend(fresh);
    (hooks.accepted)();
    setting.own_unknowns = base.model.count();
    let mut found = explore(&setting, base, request, hooks, LESSONS);
    shake(&found.search.setting, &mut found.pool, request.options.seed);
    let most = found.pool.iter().map(|h| h.log_evidence).fold(f64::NEG_INFINITY, f64::max);
    let could_stand = |h: &&mut Hypothesis<'_>| h.log_evidence > most - COULD_STAND;
    found.pool.par_iter_mut().filter(could_stand).for_each(|h| {
        take_gentlest(&found.search.setting, h);
        centre_moments(&found.search.setting, h);
    });
    notes.extend(found.notes.iter().cloned());
    notes.extend(answers(&found.pool, request.questions));

    (hooks.progress)("weighing the evidence");
    let mut judged = Judgement::of(&found);
    take_intervals(&mut found.pool[judged.told]);
    let mut file = statement(request, &found, &judged, notes, hooks);

    let Written { set, modelled } = written(&found, &mut judged, &mut file, hooks);
    let (search, pool) = (&found.search, &found.pool);
    let (setting, best) = (&search.setting, &pool[judged.winner]);
    let wanders = judged.wanders().map(str::to_owned);
    let Judgement { rest, uneven, wandering, converters, lacking, cut_short, runs_away, .. } = judged;
    let spectrum = rest
        .spectrum
        .then_some("a memory with many time scales, a fractional element or a spectrum of relaxation times");
    let (correction, varying) = rest.believed().unzip();
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

    if !converters.is_empty() && converters.len() < file.effects.len() {
        // From the last: the places before it stay.
        for converter in converters.iter().rev() {
            let EffectRecord { mechanism, slot, .. } = file.effects.remove(converter.member);
            file.alternatives.retain(|a| a.mechanism != mechanism || a.slot != slot);
        }
        file.notes.push(Converter::note(&converters));
    }

    (hooks.progress)("scoring on the hold-out");
    let baseline = with_used_turns(&pool[0].base.document(), user);
    let kept = if set > 0 { &pool[set] } else { best };
    let last = modelled.as_ref().unwrap_or(kept);
    let augmented = modelled.as_ref().or((set > 0).then_some(kept)).map(|h| with_used_turns(&h.base.document(), user));
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
    file.notes.extend(one_sided(best));
    let unequal = (!unequal.is_empty()).then(|| unequal.join("; "));
    let loudest = file.correction.as_ref().and_then(CorrectionRecord::loudest);
    let told = loudest.and_then(|t| in_words(&t.term));
    // What wanders in the place of an effect is not what a correction that is written describes.
    let varying = told.or(varying).or(wanders.filter(|_| modelled.is_none()));
    file.summary = summary(&file, varying.as_deref().or(spectrum), unequal.as_deref());
    if let Some(refutation) = refutation(&file.fit, &file.effects) {
        file.summary = format!("{} {refutation}", file.summary);
    }
    if runs_away {
        file.summary = "The simulation runs away by itself: no free run of it can follow the recording, and nothing can be said of what it lacks.".into();
        file.notes.push("a deviation of the initial state too small to be seen grows beyond the output within the recording, as in a plant that only a controller holds: put the controller into the simulation, with the reference as its input, or give many short recordings".into());
    }
    if let Some(note) = budget.note() {
        if cut_short {
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
        data: setting.data,
        none: &pool[0],
        best: last,
        held: &held,
        before: before.as_ref(),
        after: after.as_ref(),
        noise: &noise,
    });
    let unexplained = picture.unexplained();
    if file.verdict == VerdictKind::NoSignificantMismatch && !runs_away && !budget.unfinished() {
        file.summary = without_mismatch(&unexplained).unwrap_or(file.summary);
    }
    Ok(Diagnosis { file, baseline, augmented, picture })
}

/// Log evidence by which a set may trail the best one and still come to be told or written.
const COULD_STAND: f64 = 10.0;

/// What is stated of the mismatch: where it is, what is missing, what else it could be, and what would tell.
fn statement(
    request: &Request<'_>,
    found: &Explored<'_, '_>,
    judged: &Judgement<'_>,
    notes: Vec<String>,
    hooks: &Hooks<'_>,
) -> DiagnosisFile {
    let Explored { search, pool, candidates, significant, p_value, residual, detectable, .. } = found;
    let (setting, simulation, seed) = (&search.setting, request.simulation, request.options.seed);
    let best = &pool[judged.winner];
    let unsupported = *significant && judged.kind == VerdictKind::NoSignificantMismatch;
    let significant = &(*significant && !unsupported);
    let residual_rms = by_column(simulation, residual);
    let noise: Vec<f64> = best.base.whitener.models.iter().map(NoiseModel::noise_rms).collect();
    let noise_rms = if *significant { by_column(simulation, &noise) } else { residual_rms.clone() };
    let detectable = detectable.clone();
    let mut file = DiagnosisFile {
        schema: SCHEMA.into(),
        verdict: judged.kind,
        summary: String::new(),
        mismatch: MismatchRecord { p_value: finite(*p_value), residual_rms, noise_rms, detectable },
        location: None,
        effects: effects(&pool[judged.told], &judged.support),
        alternatives: Vec::new(),
        fit: Vec::new(),
        remaining: judged.remaining.clone(),
        correction: None,
        experiment: None,
        calibrated_parameters: Vec::new(),
        notes,
        seed,
    };
    if *significant && !judged.runs_away {
        let contest = judged.contest(pool);
        file.alternatives = alternatives(&contest, judged.within);
        file.location = location(&pool[0], best, candidates);
        if let (Some(l), Some(parted)) = (&mut file.location, from_moment(&file.effects, setting.data)) {
            l.time_s = vec![parted];
        }
        let ties = matches!(judged.within, VerdictKind::Family | VerdictKind::Ambiguous);
        if ties && judged.winner > 0 && !setting.budget.omits(Step::Experiment) {
            (hooks.progress)("looking for an experiment");
            file.experiment = separating(setting, &contest, &mut file.alternatives, seed, hooks.expired);
        }
    }
    if !*significant {
        file.notes.extend(taken_for_forces(simulation, &best.base.whitener.models));
    }
    file.notes.extend(judged.trifles.iter().map(Trifle::words));
    if *significant {
        file.notes.extend(elsewhere(pool, judged.told));
    }
    if let Some(why) = judged.veto {
        file.notes.push(format!("{why}, and these effects are not written"));
    }
    if judged.rest.pushed {
        file.notes.push("predicted from sample to sample, the simulation with these effects follows the recording far better than anything does that could be fitted to what its free run leaves: random forces that act on the machine explain that".into());
    }
    if unsupported {
        file.notes.push(format!(
            "surrogates of the residual hardly come by what is left (p = {}), but no effect and no generic term outweighs what its parameters cost: it is taken for noise",
            number(*p_value)
        ));
    }
    if judged.unexplained() {
        file.notes.push("simulation and recording differ by more than noise does, but no effect and no generic term outweighs what its parameters cost: what is told is the likeliest, and no augmented simulation is written".into());
    }
    file
}

/// What of a residual is taken for the work of unknown forces, in words: a law that is missing and wanders like one would pass for it.
fn taken_for_forces(simulation: &Simulation, noise: &[NoiseModel]) -> Vec<String> {
    let outputs = simulation.outputs.iter().zip(noise);
    outputs
        .filter_map(|(output, model)| {
            let (sensor, all) = (model.beside_a_force()?, model.noise_rms());
            Some(format!(
                "what is left of `{}` wanders as if an unknown force acted on the machine, beside a noise of {} of the sensor ({} in all), and is taken for that; if nothing acts there, something is missing that this recording does not tell from it",
                output.column,
                number(sensor),
                number(all)
            ))
        })
        .collect()
}

/// The effects of a set, for people.
fn listed(set: &Hypothesis<'_>) -> String {
    let each: Vec<String> = set.effects.iter().map(|e| format!("{} at {}", e.mechanism.id, e.slot)).collect();
    each.join(" and ")
}

/// What is written as the augmented simulation.
struct Written<'d> {
    /// The set of effects, as a place in the pool; 0 where none is written.
    set: usize,
    /// A correction that the catalogue does not have, in its place.
    modelled: Option<Hypothesis<'d>>,
}

/// Decides what is written into the simulation, and notes why.
fn written<'d>(
    found: &Explored<'_, 'd>,
    judged: &mut Judgement<'d>,
    file: &mut DiagnosisFile,
    hooks: &Hooks<'_>,
) -> Written<'d> {
    let (search, pool) = (&found.search, &found.pool);
    let (winner, vetoed) = (judged.winner, judged.veto.is_some());
    let foreign = judged.rest.imitation;
    let risk = if winner > 0 && !vetoed { gamble(&search.setting, &judged.contest(pool)) } else { None };
    let may_be_written = |i| Judgement::may_be_written(found, i);
    // Where the catalogue does not hold what is missing, no other set of it is written either.
    let instead = risk.filter(|_| file.verdict != VerdictKind::NotInCatalogue);
    let instead = instead.and_then(|_| safest(&search.setting, &judged.contest(pool), may_be_written));
    if let Some(share) = risk {
        let words = match instead {
            Some(i) => format!(
                "the set of {} is written, which is nearly as likely and goes less far astray",
                listed(&pool[i])
            ),
            None => "these effects are not written, since they may be worse than nothing there".into(),
        };
        file.notes.push(format!("on the recorded inputs mirrored, reversed in time or doubled the sets of effects that remain differ: each taken for the true one with its probability, the set that is told would make {} of the squared errors that it and the simulation as it is make together (a half: no better than that): {words}", number(share)));
    }
    // Another recording sees another course of what wanders: what follows this one is worse than nothing there.
    let believed = winner > 0 && !vetoed && risk.is_none();
    let wanders = judged.wanders().filter(|_| believed);
    let overdone = judged.overdone(pool).filter(|_| believed);
    let steady = if wanders.is_some() || overdone.is_some() { judged.steady(pool) } else { winner };
    let set = if foreign {
        0
    } else if believed {
        steady
    } else {
        instead.unwrap_or(0)
    };
    let written = if set > 0 { "it is not written, and the other effects are" } else { "the effects are not written" };
    if let Some(Effect { mechanism, slot, .. }) = overdone {
        file.notes.push(format!(
            "{} at {slot} is as strong as its law allows, and stands for something else: {written}",
            mechanism.id
        ));
    }
    if let Some(words) = wanders {
        file.notes.push(format!("{words}: that is likelier than a change that the catalogue has, and another recording sees another course, so that {written}"));
    }
    let modelled = if file.verdict == VerdictKind::NotInCatalogue {
        (hooks.progress)("writing the correction into the simulation");
        // On top of what is not written nothing is.
        let trusted = winner == 0 || (believed && steady == winner);
        judged.rest.modelled(search, pool, winner, trusted, set)
    } else {
        None
    };
    let strayed = modelled.as_ref().is_some_and(|h| astray(&search.setting, &pool[0].base, &h.base));
    let modelled = modelled.filter(|_| !strayed);
    if let Some(h) = &modelled {
        file.remaining = left_by(search, &pool[0], h);
    }
    let note = if modelled.is_some() {
        "the augmented simulation holds the sparse correction, refitted, and no physics that has a name: it predicts blocks of the recordings that it was not fitted to better, and says nothing outside their range"
    } else if strayed {
        "on the recorded inputs mirrored, reversed in time or doubled the sparse correction leads far from the simulation as it is, or runs away: it is told, and not written"
    } else if judged.rest.spectrum {
        "several relaxations stand beside each other: a memory with many time scales (a fractional element, a spectrum of relaxation times), which the catalogue does not have; within the band of the recording their sum follows it"
    } else if judged.rest.foreign && !foreign {
        "generic terms explain far more than the effects that were fitted in time: more is missing than these"
    } else if foreign && !vetoed {
        "the best set of effects imitates something that the catalogue does not have: generic terms explain far more; no augmented simulation is written, since an imitation may be worse than nothing on another input"
    } else if file.verdict == VerdictKind::NotInCatalogue && set > 0 && !judged.rest.walks() {
        "refitted in the equations the sparse correction is no improvement on the effects that were found: the augmented simulation holds those without it"
    } else {
        return Written { set, modelled };
    };
    file.notes.push(note.into());
    Written { set, modelled }
}
