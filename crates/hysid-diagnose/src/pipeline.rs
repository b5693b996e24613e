//! The steps of a diagnosis, in order: intake, calibration, test, screening, refit, composition, verdict, hold-out.

use std::cell::RefCell;
use std::collections::BTreeMap;

use hysid_plant::Simulation;
use hysid_signal::Recording;
use rayon::prelude::*;

use crate::base::{Base, NoiseKind};
use crate::bootstrap::{ratio_of_rms, rms};
use crate::compose::{
    Hypothesis, Key, SearchOptions, Setting, add, best_of, block_score, compose, refit_all, short_list,
};
use crate::data::{DataSet, held_out_blocks};
use crate::draw::{Sitting, picture};
use crate::error::DiagnoseError;
use crate::evidence::{
    FeatureGroup, SurrogateTest, TestOptions, correlation_time, detectable_amplitude, norm2, surrogate_test,
};
use crate::experiment::{present_separation, propose};
use crate::file::*;
use crate::hold::{FreeRun, free_run};
use crate::locate;
use crate::mechanism::{Mechanism, number_with_unit};
use crate::model::{Model, Values};
use crate::openset::correction;
use crate::picture::Picture;
use crate::report_values::{reported, sentence};
use crate::screen::{Candidate, screen};
use crate::slot::Slot;
use crate::verdict::{Claim, FIRM, Hypothesis as Weighed, NOT_FIRM, Support, probabilities, supports, verdict};

/// Options of a diagnosis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Level of the mismatch test.
    pub alpha: f64,
    /// Seed of everything random.
    pub seed: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self { alpha: 0.01, seed: 1 }
    }
}

/// What a diagnosis is asked.
#[derive(Debug)]
pub struct Request<'a> {
    /// The user's simulation.
    pub simulation: &'a Simulation,
    /// Its file, for messages.
    pub file: &'a str,
    /// Recordings to estimate from.
    pub estimation: &'a [Recording],
    /// Recordings that only score; none: blocks of the estimation recordings are held out.
    pub holdout: &'a [Recording],
    /// Options.
    pub options: Options,
}

/// How the caller follows and limits the work.
pub struct Hooks<'a> {
    /// Told at the start of each step.
    pub progress: &'a (dyn Fn(&str) + Sync),
    /// Whether time is up: optional steps are then left out.
    pub expired: &'a (dyn Fn() -> bool + Sync),
}

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

/// Most samples that the search works on; a longer recording is used in windows.
const MOST_SAMPLES: usize = 24_000;
/// A correction is believed where the whitened error on blocks that it was not fitted to falls below this share.
const BETTER: f64 = 0.97;
/// Composition goes on while the mismatch that remains is significant at this level.
const STOP_LEVEL: f64 = 0.02;
/// Weight of the log evidence in the probabilities.
pub const EVIDENCE_WEIGHT: f64 = 0.4;
/// The same where something significant is left of the best set: all models are then known to be wrong.
const IMPERFECT_WEIGHT: f64 = 0.2;
/// Log likelihood below which a law that contains another has gained nothing on it, and the weight of the evidence between the two.
const NESTED_GAIN: f64 = 2.0;
const NESTED_WEIGHT: f64 = 0.9;
/// Log evidence that a further effect must bring before it counts.
const PRICE_OF_AN_EFFECT: f64 = 4.0;

/// Diagnoses a simulation.
///
/// # Errors
/// Bad input; never a numerical event.
pub fn diagnose(request: &Request<'_>, hooks: &Hooks<'_>) -> Result<Diagnosis, DiagnoseError> {
    let options = request.options;
    if !(options.alpha > 0.0 && options.alpha < 0.5) {
        return Err(DiagnoseError::Option {
            option: "--alpha",
            given: options.alpha.to_string(),
            allowed: "above 0 and below 0.5",
        });
    }
    let simulation = request.simulation;
    dead_outputs(request)?;
    (hooks.progress)("reading the recordings");
    let free = simulation.parameters.iter().filter(|p| !p.fixed).count();
    let all = DataSet::new(simulation, request.estimation, free)?;
    let (full, held) = if request.holdout.is_empty() {
        split_blocks(&all)
    } else {
        if let Some(same) = request
            .holdout
            .iter()
            .find(|h| request.estimation.iter().any(|e| e.channels() == h.channels() && e.clock() == h.clock()))
        {
            return Err(DiagnoseError::SameData(same.name().to_owned()));
        }
        (all, DataSet::new(simulation, request.holdout, 0)?)
    };
    let mut notes = full.notes.clone();
    if request.holdout.is_empty() {
        notes.push("no hold-out recording was given: blocks of the recordings were held out and score the fit".into());
    }
    let data = full.within(MOST_SAMPLES);
    notes.extend(data.notes.iter().filter(|n| !full.notes.contains(n)).cloned());

    (hooks.progress)("calibrating the simulation");
    let own_states: Vec<String> = simulation.states.iter().map(|s| s.name.clone()).collect();
    let mut setting = Setting {
        data: &data,
        original: simulation.clone(),
        own_states,
        substeps: 2,
        own_unknowns: 0,
        iterations: 12,
        noise: NoiseKind::Coloured,
    };
    let base = calibrate(&mut setting, request)?;
    setting.own_unknowns = base.model.unknowns().len();
    let log_evidence = setting.evidence(&base);
    let mut none = Hypothesis { effects: Vec::new(), base, log_evidence };

    (hooks.progress)("looking for what could be missing");
    let evidence = none.base.evidence();
    let mut candidates = screen(&none.base, simulation, &evidence, &|_, _| true);
    let test = test_of(&candidates, &none.base, &evidence, options);
    let baseline = none.base.document();
    let residual_rms = by_column(simulation, &data.layout.rms(&none.base.fit.residual));
    let detectable = detectability(&candidates);
    let mut file = DiagnosisFile {
        schema: SCHEMA.into(),
        verdict: VerdictKind::NoSignificantMismatch,
        summary: String::new(),
        mismatch: MismatchRecord {
            p_value: finite(test.p_value),
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
    let tests: Tests = RefCell::default();
    let mut pool: Vec<Hypothesis<'_>> = Vec::new();
    let significant = test.p_value < options.alpha;
    if significant {
        search(&setting, &none, &candidates, &mut pool, simulation, options, &tests, hooks);
    }
    if significant && !(hooks.expired)() && absorbed(&none, &pool) {
        // An autoregression explains a slow mismatch by its own past: then the mismatch is no noise, and the plain sum of squares decides,
        // with as many samples as are independent.
        let tau = correlation_time(&data.layout, &none.base.fit.residual);
        setting.noise = NoiseKind::White(1.0 / (1.0 + 2.0 * tau as f64));
        if let Some(base) = setting.fit(simulation, &none.base.values(), None, 2, 20) {
            let log_evidence = setting.evidence(&base);
            let plain = Hypothesis { effects: Vec::new(), base, log_evidence };
            let evidence = plain.base.evidence();
            let again = screen(&plain.base, simulation, &evidence, &|_, _| true);
            let mut other = Vec::new();
            search(&setting, &plain, &again, &mut other, simulation, options, &tests, hooks);
            let gained =
                best_of(&other).is_some_and(|b| other[b].log_evidence > plain.log_evidence + PRICE_OF_AN_EFFECT);
            if gained {
                (none, candidates, pool) = (plain, again, other);
            } else {
                setting.noise = NoiseKind::Coloured;
            }
        }
    }
    pool.insert(0, none);

    (hooks.progress)("weighing the evidence");
    let weighed: Vec<Weighed> = pool.iter().map(weigh).collect();
    let blocks = block_scores(&setting, &pool, hooks.expired);
    let winner = if significant { tie_broken(&pool, &blocks) } else { 0 };
    let remaining = (!pool[winner].effects.is_empty()).then(|| remains(&pool[winner], simulation, options, &tests));
    let imperfect = remaining.as_ref().is_some_and(|t| t.p_value < options.alpha);
    let log = log_weights(&pool, &blocks, winner, if imperfect { IMPERFECT_WEIGHT } else { EVIDENCE_WEIGHT });
    let probability = probabilities(&log, 1.0);
    let claims = weighed[winner].claims.clone();
    let mut support = supports(&claims, &weighed, &probability);
    // A set that leaves something significant is not the truth: its members may stand in for something else. Three members imitate almost
    // anything: on development cases such sets were wrong more often than right.
    if (imperfect && claims.len() > 1) || claims.len() > 2 {
        support.iter_mut().for_each(Support::weaken);
    }
    // Two members of one family in one set: something of that kind, but neither of them as it stands.
    for i in 0..claims.len() {
        if claims.iter().enumerate().any(|(j, c)| i != j && c.family == claims[i].family) {
            support[i].weaken();
        }
    }
    file.verdict = verdict(&support);
    let best = &pool[winner];
    file.effects = best
        .effects
        .iter()
        .zip(&support)
        .map(|(e, s)| {
            let parameters = reported(&best.base, e);
            EffectRecord {
                mechanism: e.mechanism.id.into(),
                family: e.mechanism.family.name().into(),
                slot: e.slot.label.clone(),
                probability: s.mechanism,
                family_probability: s.family,
                concealment: e.concealment,
                sentence: sentence(e, &parameters),
                parameters,
            }
        })
        .collect();
    if significant {
        file.alternatives = alternatives(&pool, &weighed, &probability, winner, file.verdict);
        file.location = location(&pool[0], best, &candidates);
        // A change at one moment is where the recordings part from then on.
        let moment = file
            .effects
            .iter()
            .filter(|e| e.mechanism == "abrupt_change")
            .find_map(|e| e.parameters.iter().find(|p| p.name == "t_0"));
        if let (Some(l), Some(moment), Some(last)) =
            (&mut file.location, moment, data.stretches.iter().filter(|s| s.recording == 0).next_back())
        {
            l.time_s = vec![[moment.value, last.start_s + last.len() as f64 * data.period_s]];
        }
        let noise = best.base.whitener.models.iter().map(|m| m.noise_rms()).collect::<Vec<_>>();
        file.mismatch.noise_rms = by_column(simulation, &noise);
    }
    let vetoed = !best.effects.is_empty() && worse_on_blocks(&blocks, winner);
    if vetoed {
        file.verdict = VerdictKind::Ambiguous;
        for e in &mut file.effects {
            e.probability = e.probability.min(NOT_FIRM);
            e.family_probability = e.family_probability.min(NOT_FIRM);
        }
        file.notes.push("the best set of effects predicts held-out blocks of the recordings worse than the simulation as it is: it is no improvement outside the data it was fitted to, and no augmented simulation is written".into());
    }
    if significant && matches!(file.verdict, VerdictKind::Family | VerdictKind::Ambiguous) && !(hooks.expired)() {
        (hooks.progress)("looking for an experiment");
        file.experiment = rival_of(&pool, &weighed, winner).and_then(|rival| {
            let present = present_separation(&setting, best, &pool[rival]);
            if let Some(d) = present {
                for e in &pool[rival].effects {
                    let listed =
                        file.alternatives.iter_mut().find(|a| a.mechanism == e.mechanism.id && a.slot == e.slot.label);
                    if let Some(a) = listed {
                        a.separation = finite(d);
                    }
                }
            }
            propose(&setting, best, &pool[rival], present, options.seed)
        });
    }
    if let Some(remaining) = remaining {
        let noise = noise_floor(best);
        let left =
            |e: &[f64]| data.layout.rms(e).iter().zip(&noise).map(|(r, n)| (r * r - n * n).max(0.0)).sum::<f64>();
        let share =
            (left(&best.base.fit.residual) / left(&pool[0].base.fit.residual).max(f64::MIN_POSITIVE)).sqrt().min(1.0);
        let share = if share.is_finite() { share } else { 0.0 };
        file.remaining = Some(RemainingRecord { p_value: remaining.p_value, share });
        if remaining.p_value < options.alpha && !(hooks.expired)() {
            (hooks.progress)("modelling what remains");
            if let Some(open) = correction(&best.base)
                && open.block_ratio < BETTER
            {
                // An effect that is really there is still named; what most of the mismatch is decides the verdict.
                if share > 0.5 || (share > 0.2 && support.iter().all(|s| s.family < FIRM)) {
                    file.verdict = VerdictKind::NotInCatalogue;
                }
                file.correction = Some(CorrectionRecord { ratio: finite(open.block_ratio), ..open.record });
            }
        }
    } else if significant && let Some(open) = correction(&best.base) {
        file.verdict = VerdictKind::NotInCatalogue;
        file.correction = Some(CorrectionRecord { ratio: finite(open.block_ratio), ..open.record });
    }

    (hooks.progress)("scoring on the hold-out");
    let augmented = (!best.effects.is_empty() && !vetoed).then(|| best.base.document());
    let before = free_run(&baseline, &held, &setting.own_states, setting.substeps);
    let after = augmented.as_ref().and_then(|a| free_run(a, &held, &setting.own_states, setting.substeps));
    file.fit = fits(simulation, &held, before.as_ref(), after.as_ref(), options.seed, request.holdout.is_empty());
    file.calibrated_parameters = calibrated(&best.base, simulation);
    file.notes.extend(absorbing(&pool[0].base, simulation));
    for e in &best.effects {
        let candidate = candidates.iter().find(|c| c.mechanism.id == e.mechanism.id && c.slot.label == e.slot.label);
        if let Some(lacking) = candidate.and_then(|c| c.lacking.as_ref()) {
            file.notes
                .push(format!("{}: for a firmer answer the recording lacks something: {lacking}", e.mechanism.id));
        }
    }
    file.summary = summary(&file);
    let noise: Vec<f64> = simulation.outputs.iter().map(|o| file.mismatch.noise_rms[&o.column]).collect();
    let picture = picture(&Sitting {
        simulation,
        data: &data,
        none: &pool[0],
        best,
        held: &held,
        before: before.as_ref(),
        after: after.as_ref(),
        noise: &noise,
    });
    Ok(Diagnosis { file, baseline, augmented, picture })
}

/// An output that nothing moves cannot be diagnosed.
fn dead_outputs(request: &Request<'_>) -> Result<(), DiagnoseError> {
    for o in &request.simulation.outputs {
        let symbols = o.expression.symbols();
        let alive = symbols.iter().any(|s| {
            request.simulation.state(s).is_some()
                || request.simulation.input(s).is_some()
                || s == "t"
                || request.simulation.parameter(s).is_some()
        });
        if !alive {
            return Err(DiagnoseError::DeadOutput { file: request.file.to_owned(), column: o.column.clone() });
        }
    }
    Ok(())
}

/// Blocks of the estimation recordings as hold-out.
fn split_blocks(all: &DataSet) -> (DataSet, DataSet) {
    let weights = held_out_blocks(&all.layout, &all.y);
    let mut out = std::collections::BTreeSet::new();
    for s in &all.layout.series {
        for (n, row) in s.rows.clone().enumerate() {
            if weights[row] == 0.0 {
                out.insert((s.stretch, s.first + n));
            }
        }
    }
    (all.keep(|s, n, _| !out.contains(&(s, n))), all.keep(|s, n, _| out.contains(&(s, n))))
}

/// Whether the noise model has absorbed the mismatch: nothing was found under it, or what was found leaves the error as large as it was
/// while the residual is far larger than its innovations.
fn absorbed(none: &Hypothesis<'_>, pool: &[Hypothesis<'_>]) -> bool {
    let Some(best) = best_of(pool) else { return true };
    if pool[best].log_evidence < none.log_evidence + PRICE_OF_AN_EFFECT {
        return true;
    }
    let left = (norm2(&pool[best].base.fit.residual) / norm2(&none.base.fit.residual).max(f64::MIN_POSITIVE)).sqrt();
    let coloured = none.base.whitener.models.iter().any(|m| m.noise_rms() > 15.0 * m.innovation());
    left > 0.7 && coloured
}

/// Refits the short list, compares the numerics, and composes.
#[allow(clippy::too_many_arguments)]
fn search<'d>(
    setting: &Setting<'d>,
    none: &Hypothesis<'d>,
    candidates: &[Candidate],
    pool: &mut Vec<Hypothesis<'d>>,
    simulation: &Simulation,
    options: Options,
    tests: &Tests,
    hooks: &Hooks<'_>,
) {
    (hooks.progress)("refitting the likeliest effects");
    let list = short_list(candidates, 10);
    for h in refit_all(setting, none, &list) {
        add(pool, h);
    }
    if let Some(h) = crate::numerics_check::artefact(setting, none) {
        add(pool, h);
    }
    (hooks.progress)("looking for a second and third effect");
    let unexplained = |h: &Hypothesis<'_>| remains(h, simulation, options, tests).p_value < STOP_LEVEL;
    compose(setting, none, pool, SearchOptions { depth: 3, beam: 2, most: 6 }, &unexplained, hooks.expired);
}

/// Tests of what remains, by statement: composition and the verdict ask for the same ones.
type Tests = RefCell<BTreeMap<Key, SurrogateTest>>;

/// The test of what remains of a hypothesis' residual.
fn remains(h: &Hypothesis<'_>, simulation: &Simulation, options: Options, tests: &Tests) -> SurrogateTest {
    let mut key = h.key();
    // A better fit of the same statement is tested anew.
    key.push(("", format!("{:.3}", h.log_evidence)));
    if let Some(known) = tests.borrow().get(&key) {
        return known.clone();
    }
    let evidence = h.base.evidence();
    let rest = screen(&h.base, simulation, &evidence, &|_, _| true);
    let test = test_of(&rest, &h.base, &evidence, options);
    tests.borrow_mut().insert(key, test.clone());
    test
}

/// Scores on held-out blocks of the hypotheses that are close to the best; `None` for the others.
fn block_scores(
    setting: &Setting<'_>,
    pool: &[Hypothesis<'_>],
    expired: &(dyn Fn() -> bool + Sync),
) -> Vec<Option<(f64, Vec<f64>)>> {
    let top = pool.iter().map(|h| h.log_evidence).fold(f64::NEG_INFINITY, f64::max);
    let mut near: Vec<usize> = (0..pool.len()).filter(|&i| pool[i].log_evidence > top - 8.0).collect();
    near.sort_by(|&a, &b| pool[b].log_evidence.total_cmp(&pool[a].log_evidence));
    near.truncate(5);
    (0..pool.len())
        .into_par_iter()
        .map(|i| {
            if (near.contains(&i) || i == 0) && pool.len() > 1 && !expired() {
                block_score(setting, &pool[i])
            } else {
                None
            }
        })
        .collect()
}

/// The standing set, or one of its size that ties in evidence and predicts the held-out blocks better.
fn tie_broken(pool: &[Hypothesis<'_>], blocks: &[Option<(f64, Vec<f64>)>]) -> usize {
    let Some(standing) = best_of(pool) else { return 0 };
    let score = |i: usize| blocks[i].as_ref().map_or(f64::NEG_INFINITY, |b| b.0);
    (0..pool.len())
        .filter(|&i| {
            pool[i].effects.len() == pool[standing].effects.len()
                && pool[i].log_evidence > pool[standing].log_evidence - 3.0
        })
        .filter(|&i| i == standing || score(i) > score(standing) + 3.0)
        .max_by(|&a, &b| score(a).total_cmp(&score(b)))
        .unwrap_or(standing)
}

/// Whether the winner predicts the held-out blocks worse than the simulation as it is, by more than two standard errors.
fn worse_on_blocks(blocks: &[Option<(f64, Vec<f64>)>], winner: usize) -> bool {
    let (Some(Some((_, none))), Some(Some((_, best)))) = (blocks.first(), blocks.get(winner)) else { return false };
    // Sums over stretches of 20 rows: neighbouring errors are no independent witnesses.
    let differences: Vec<f64> =
        best.chunks(20).zip(none.chunks(20)).map(|(b, n)| b.iter().sum::<f64>() - n.iter().sum::<f64>()).collect();
    let count = differences.len() as f64;
    let mean = differences.iter().sum::<f64>() / count;
    let variance = differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (count - 1.0).max(1.0);
    count > 4.0 && mean > 2.0 * (variance / count).sqrt()
}

/// Logarithms of the weights of the hypotheses.
///
/// Evidence counts with `weight`; what the held-out blocks say is part of it. A law that contains the winner's as a special case and gains
/// nothing on it pays nearly the full price of its further parameters: data that settle a parameter at its neutral value do speak.
fn log_weights(pool: &[Hypothesis<'_>], blocks: &[Option<(f64, Vec<f64>)>], winner: usize, weight: f64) -> Vec<f64> {
    let best_block = blocks[winner].as_ref().map(|b| b.0);
    let best = &pool[winner];
    pool.iter()
        .enumerate()
        .map(|(i, h)| {
            let mut log = weight * (h.log_evidence - PRICE_OF_AN_EFFECT * h.effects.len() as f64);
            if let (Some(own), Some(best)) = (&blocks[i], best_block) {
                log += 0.5 * weight * (own.0 - best).clamp(-10.0, 10.0);
            }
            let gain = h.base.log_likelihood - best.base.log_likelihood;
            let contains =
                h.effects.iter().any(|e| best.effects.iter().any(|w| e.mechanism.contains.contains(&w.mechanism.id)));
            if i != winner && h.effects.len() == best.effects.len() && contains && gain < NESTED_GAIN {
                log += (NESTED_WEIGHT - weight).max(0.0) * (h.log_evidence - best.log_evidence).min(0.0);
            }
            log
        })
        .collect()
}

/// The user's simulation, calibrated fairly: from the user's values and, where that is not enough, from others within the bounds.
fn calibrate<'d>(setting: &mut Setting<'d>, request: &Request<'_>) -> Result<Base<'d>, DiagnoseError> {
    let simulation = request.simulation;
    let bad =
        |e: hysid_plant::Error| DiagnoseError::Simulation { file: request.file.to_owned(), problem: e.to_string() };
    let model = Model::new(simulation, setting.data, &setting.own_states, setting.substeps).map_err(bad)?;
    let start = model.theta(&Values::default());
    let diverged = model.simulate(&start).1;
    let mut best: Option<Base<'d>> = None;
    let (starts, substeps) = crate::calibrate::starts(&model, simulation, request.options.seed);
    setting.substeps = substeps;
    for from in starts {
        let Some(b) = setting.fit(simulation, &from, None, 1, 25) else { continue };
        let cost = |b: &Base<'_>| crate::evidence::norm2(&b.fit.residual);
        if best.as_ref().is_none_or(|x| cost(&b) < cost(x)) {
            best = Some(b);
        }
    }
    let Some(best) = best else {
        let (stretch, sample) = diverged.unwrap_or((0, 0));
        let s = &setting.data.stretches[stretch];
        return Err(DiagnoseError::Explodes {
            file: request.file.to_owned(),
            recording: setting.data.recordings[s.recording].clone(),
            at_s: s.start_s + sample as f64 * setting.data.period_s,
        });
    };
    // Under its own noise, twice.
    let polished = setting.fit(simulation, &best.values(), Some(&best.whitener), 2, 20);
    Ok(match polished {
        Some(p) if p.log_likelihood > best.log_likelihood => p,
        _ => best,
    })
}

/// The mismatch test over all candidates' kept columns.
fn test_of(
    candidates: &[Candidate],
    base: &Base<'_>,
    evidence: &(crate::evidence::Projector, Vec<f64>),
    options: Options,
) -> SurrogateTest {
    let groups: Vec<&FeatureGroup> =
        candidates.iter().flat_map(|c| c.points.iter().filter_map(|p| p.group.as_ref())).collect();
    surrogate_test(
        &groups,
        &base.model.data().layout,
        &evidence.0,
        &evidence.1,
        TestOptions { alpha: options.alpha, seed: options.seed },
    )
}

fn by_column(simulation: &Simulation, values: &[f64]) -> BTreeMap<String, f64> {
    simulation.outputs.iter().map(|o| o.column.clone()).zip(values.iter().copied()).collect()
}

/// The smallest effects that this recording would have shown.
fn detectability(candidates: &[Candidate]) -> Vec<DetectableRecord> {
    let count: usize = candidates.iter().map(|c| c.points.len()).sum();
    let mut out: Vec<DetectableRecord> = candidates
        .iter()
        .filter_map(|c| {
            let amplitude = c.refit.amplitudes.first()?;
            let point = c.points.iter().filter(|p| p.norm > 0.0).max_by(|a, b| a.norm.total_cmp(&b.norm))?;
            let group = FeatureGroup::of_norm(point.norm);
            let unit = c
                .refit
                .simulation
                .parameter(&amplitude.name)?
                .unit
                .as_ref()
                .map(ToString::to_string)
                .unwrap_or_default();
            let smallest = detectable_amplitude(&group, 1.0, count);
            smallest.is_finite().then(|| DetectableRecord {
                mechanism: c.mechanism.id.into(),
                slot: c.slot.label.clone(),
                smallest,
                unit,
            })
        })
        .collect();
    out.sort_by(|a, b| (&a.slot, &a.mechanism).cmp(&(&b.slot, &b.mechanism)));
    out.dedup_by(|a, b| a.mechanism == b.mechanism && a.slot == b.slot);
    out
}

fn claim(mechanism: &Mechanism, slot: &Slot) -> Claim {
    Claim { mechanism: mechanism.id, family: mechanism.family.name(), slot: slot.label.clone() }
}

fn weigh(h: &Hypothesis<'_>) -> Weighed {
    Weighed {
        claims: h.effects.iter().map(|e| claim(e.mechanism, &e.slot)).collect(),
        log_evidence: h.log_evidence - PRICE_OF_AN_EFFECT * h.effects.len() as f64,
    }
}

/// The likeliest set that names another mechanism than the winner.
fn rival_of(pool: &[Hypothesis<'_>], weighed: &[Weighed], winner: usize) -> Option<usize> {
    let names = |i: usize, id: &str| pool[i].effects.iter().any(|e| e.mechanism.id == id);
    (0..pool.len())
        .filter(|&i| pool[i].effects.iter().any(|e| !names(winner, e.mechanism.id)))
        .max_by(|&a, &b| weighed[a].log_evidence.total_cmp(&weighed[b].log_evidence))
}

/// Rival explanations: for each effect that is not in the winning set, the likeliest set that has it.
fn alternatives(
    pool: &[Hypothesis<'_>],
    weighed: &[Weighed],
    probability: &[f64],
    winner: usize,
    kind: VerdictKind,
) -> Vec<AlternativeRecord> {
    let mut out: Vec<AlternativeRecord> = Vec::new();
    let mut order: Vec<usize> = (0..pool.len()).collect();
    order.sort_by(|&a, &b| weighed[b].log_evidence.total_cmp(&weighed[a].log_evidence));
    for i in order {
        for e in &pool[i].effects {
            let winning =
                pool[winner].effects.iter().any(|w| w.mechanism.id == e.mechanism.id && w.slot.label == e.slot.label);
            let listed = out.iter().any(|a| a.mechanism == e.mechanism.id && a.slot == e.slot.label);
            if listed || (winning && kind != VerdictKind::Ambiguous) {
                continue;
            }
            let total: f64 = weighed
                .iter()
                .zip(probability)
                .filter(|(w, _)| w.claims.iter().any(|c| c.mechanism == e.mechanism.id && c.slot == e.slot.label))
                .map(|(_, p)| p)
                .sum();
            out.push(AlternativeRecord {
                mechanism: e.mechanism.id.into(),
                family: e.mechanism.family.name().into(),
                slot: e.slot.label.clone(),
                probability: total.min(1.0),
                evidence_gap: 2.0 * (weighed[winner].log_evidence - weighed[i].log_evidence),
                separation: None,
            });
        }
    }
    out.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    out.truncate(12);
    out
}

/// Where the strongest effect of the best set shows.
fn location(none: &Hypothesis<'_>, best: &Hypothesis<'_>, candidates: &[Candidate]) -> Option<LocationRecord> {
    let effect = best.effects.first();
    let candidate = match effect {
        Some(e) => candidates.iter().find(|c| c.mechanism.id == e.mechanism.id && c.slot.label == e.slot.label)?,
        None => candidates.first()?,
    };
    let data = none.base.model.data();
    let (_, r) = none.base.evidence();
    // What the effects took away, whitened: evidence in output space.
    let white = none.base.whitener.apply(&data.layout, &none.base.fit.residual);
    let taken: Vec<f64> = none.base.fit.residual.iter().zip(&best.base.fit.residual).map(|(b, a)| b - a).collect();
    let g = if best.effects.is_empty() { white } else { none.base.whitener.apply(&data.layout, &taken) };
    let mut time_s: Vec<[f64; 2]> = Vec::new();
    for s in &data.layout.series {
        if data.stretches[s.stretch].recording != 0 {
            continue;
        }
        let start = data.stretches[s.stretch].start_s + s.first as f64 * data.period_s;
        for rows in locate::active_rows(s, &r, &g) {
            let at = |row: usize| start + (row - s.rows.start) as f64 * data.period_s;
            time_s.push([at(rows.start), at(rows.end.max(1) - 1)]);
        }
    }
    let longest = data.layout.series.iter().max_by_key(|s| s.rows.len())?;
    let band_hz = locate::bands(
        &none.base.fit.residual[longest.rows.clone()],
        &best.base.fit.residual[longest.rows.clone()],
        data.period_s,
    );
    let region = crate::region::words(none, best).unwrap_or_else(|| "everywhere on the trajectory".into());
    Some(LocationRecord {
        slot: candidate.slot.label.clone(),
        block: candidate.mechanism.block_at(&candidate.slot).name().into(),
        time_s,
        band_hz,
        region,
    })
}

/// The noise that the best model leaves, by output.
fn noise_floor(best: &Hypothesis<'_>) -> Vec<f64> {
    best.base.whitener.models.iter().map(|m| m.innovation().min(m.noise_rms())).collect()
}

fn fits(
    simulation: &Simulation,
    held: &DataSet,
    before: Option<&FreeRun>,
    after: Option<&FreeRun>,
    seed: u64,
    blocks: bool,
) -> Vec<FitRecord> {
    let mut out = Vec::new();
    for (r, name) in held.recordings.iter().enumerate() {
        for (o, output) in simulation.outputs.iter().enumerate() {
            let errors = |run: &FreeRun| -> Vec<f64> {
                held.layout
                    .series
                    .iter()
                    .filter(|s| s.output == o && held.stretches[s.stretch].recording == r)
                    .flat_map(|s| s.rows.clone())
                    .filter(|&row| before.is_none_or(|b| b.scored[row]) && after.is_none_or(|a| a.scored[row]))
                    .map(|row| held.y[row] - run.prediction[row])
                    .collect()
            };
            let b = before.map(errors);
            let a = after.map(errors);
            let rmse_before = b.as_ref().map(|e| rms(e)).and_then(finite);
            let rmse_after = a.as_ref().map(|e| rms(e)).and_then(finite);
            let ratio = match (&a, &b) {
                (Some(a), Some(b)) => Some(ratio_of_rms(a, b, seed)),
                _ => None,
            };
            out.push(FitRecord {
                recording: if blocks { format!("{name}: held-out blocks") } else { name.clone() },
                output: output.column.clone(),
                rmse_before,
                rmse_after,
                ratio: ratio.and_then(|r| finite(r.value)),
                ratio_low: ratio.and_then(|r| finite(r.low)),
                ratio_high: ratio.and_then(|r| finite(r.high)),
                rmse_black_box: None,
            });
        }
    }
    out
}

fn calibrated(base: &Base<'_>, simulation: &Simulation) -> Vec<ParameterRecord> {
    base.intervals()
        .into_iter()
        .filter_map(|(name, value, low, high, _)| {
            let p = simulation.parameter(&name)?;
            let unit = p.unit.as_ref().map(ToString::to_string).unwrap_or_default();
            Some(ParameterRecord { name, value, low: finite(low), high: finite(high), unit })
        })
        .collect()
}

/// Parameters of the calibrated simulation that stand at a bound or far from what the user gave.
fn absorbing(base: &Base<'_>, simulation: &Simulation) -> Vec<String> {
    let mut out = Vec::new();
    for (name, value, low, high, at_bound) in base.intervals() {
        let Some(p) = simulation.parameter(&name) else { continue };
        let unit = p.unit.as_ref();
        if at_bound {
            out.push(format!("parameter `{name}` of the recalibrated simulation stands at a bound ({}): it may be absorbing something", number_with_unit(value, unit)));
        } else if p.value != 0.0
            && (value / p.value > 2.0 || value / p.value < 0.5)
            && (p.value < low || p.value > high)
        {
            out.push(format!(
                "parameter `{name}` of the recalibrated simulation is {}, the file says {}",
                number_with_unit(value, unit),
                number_with_unit(p.value, unit)
            ));
        }
    }
    out
}

/// The verdict in a sentence or two.
fn summary(file: &DiagnosisFile) -> String {
    let sentences = || file.effects.iter().map(|e| e.sentence.clone()).collect::<Vec<_>>().join(" ");
    let rivals = || {
        file.alternatives
            .iter()
            .take(3)
            .map(|a| format!("{} at {} ({:.0} %)", a.mechanism, a.slot, 100.0 * a.probability))
            .collect::<Vec<_>>()
            .join(", ")
    };
    match file.verdict {
        VerdictKind::NoSignificantMismatch => {
            "The recalibrated simulation and the recording differ by no more than the noise.".into()
        }
        VerdictKind::Named => sentences(),
        VerdictKind::Family => {
            let families: Vec<&str> = file.effects.iter().map(|e| e.family.as_str()).collect();
            format!("The family is firm ({}), the member is not. The likeliest: {}", families.join(", "), sentences())
        }
        VerdictKind::Ambiguous => {
            format!("Several explanations remain: {}. The likeliest set: {}", rivals(), sentences())
        }
        VerdictKind::NotInCatalogue => {
            "Something is missing that no mechanism of the catalogue explains; a sparse correction describes it.".into()
        }
    }
}
