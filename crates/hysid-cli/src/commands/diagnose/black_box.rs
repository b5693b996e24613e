//! The yardstick of a diagnosis: the error of a model without any physics on the same hold-out samples.
//!
//! For each output a NARX model is identified from the estimation recordings, as `hysid fit` does, and run free on the hold-out. It starts
//! from the first recorded samples, as it has no other past. Where blocks of the estimation recordings are held out, the model does not
//! see them either. A simulation with its effects that is worse than this model still lacks something that the data show.

use std::collections::BTreeSet;

use hysid::identify::{Columns, Decimate, Factors, FitReport, IdentifyError, Options, Source, Stop, identify_until};
use hysid_diagnose::answer::picture::{Picture, RecordPicture, Role};
use hysid_diagnose::file::{DiagnosisFile, FitRecord, VerdictKind};
use hysid_narx::NarxModel;
use hysid_plant::Simulation;
use hysid_signal::{Channel, Clock, Recording};

use crate::commands::files::{Intake, SAME_PERIOD};

/// A model whose run through whole recordings is worse than this many times the error it had on pieces is not sound.
const SOUND: f64 = 3.0;
/// Longer recordings than this in all are used in the windows of the diagnosis: memory and time stay what they are.
const MOST_SAMPLES: usize = 30_000;
/// Samples of a window that is worth it.
const SHORTEST: usize = 100;

/// A model for each output of the simulation, or why there is none.
pub type Models = Vec<Result<NarxModel, String>>;

/// The models where they learn from whole recordings, so that the diagnosis need not be waited for; `None` where it decides on the samples.
pub fn early(simulation: &Simulation, intake: &Intake, seed: u64) -> Option<impl FnOnce() -> Models + Send> {
    let whole = !intake.holdout.is_empty() && samples(intake) <= MOST_SAMPLES;
    whole.then_some(move || models(&intake.estimation, &intake.holdout, simulation, seed, &|| false))
}

/// The models, learnt from the samples that the diagnosis did not hold out; given up where `stop` says so.
pub fn late(picture: &Picture, simulation: &Simulation, intake: &Intake, seed: u64, stop: Stop<'_>) -> Models {
    let held: Vec<&RecordPicture> = picture.records.iter().filter(|r| r.role == Role::HoldOut).collect();
    let blocks = intake.holdout.is_empty();
    let estimation = if samples(intake) > MOST_SAMPLES {
        &windows(&intake.estimation, picture)
    } else if blocks {
        &without_blocks(&intake.estimation, &held, simulation)
    } else {
        &intake.estimation
    };
    models(estimation, if blocks { &intake.estimation } else { &intake.holdout }, simulation, seed, stop)
}

fn samples(intake: &Intake) -> usize {
    intake.estimation.iter().map(Recording::len).sum()
}

fn models(
    estimation: &[Recording],
    holdout: &[Recording],
    simulation: &Simulation,
    seed: u64,
    stop: Stop<'_>,
) -> Models {
    // Two symbols may stand for one column.
    let columns: BTreeSet<&String> = simulation.inputs.iter().map(|i| &i.column).collect();
    let inputs: Vec<String> = columns.into_iter().cloned().collect();
    let of_output = |output: &hysid_plant::Output| {
        let source = Source { recordings: estimation, inputs: &inputs, output: &output.column };
        rate_of(estimation, holdout).and_then(|()| model(source, seed, stop).map_err(|e| e.to_string()))
    };
    simulation.outputs.iter().map(of_output).collect()
}

/// Fills `rmse_black_box` of the hold-out's entries; a note says why it is missing.
pub fn score(file: &mut DiagnosisFile, models: Models, picture: &Picture, simulation: &Simulation, intake: &Intake) {
    let held: Vec<&RecordPicture> = picture.records.iter().filter(|r| r.role == Role::HoldOut).collect();
    let holdout = if intake.holdout.is_empty() { &intake.estimation } else { &intake.holdout };
    for (o, (output, model)) in simulation.outputs.iter().zip(models).enumerate() {
        let model = match model {
            Ok(model) => model,
            Err(why) => {
                file.notes.push(format!("no black box for `{}` beside the simulation: {why}", output.column));
                continue;
            }
        };
        for record in held.iter().filter(|r| r.output == output.column) {
            let Some(recording) = holdout.get(record.place) else { continue };
            let run = Columns::of(&model, recording).ok().and_then(|c| model.free_run(&c.record()).ok());
            let rmse = run.as_ref().and_then(|run| error(record, &run.y, run.diverged_at));
            if let Some(at) = run.and_then(|r| r.diverged_at) {
                file.notes.push(format!(
                    "the black box for `{}` diverges on {} (at sample {at}): it has no error there",
                    output.column, record.recording
                ));
            }
            if let Some(entry) = file.fit.get_mut(record.place * simulation.outputs.len() + o) {
                entry.rmse_black_box = rmse;
            }
        }
    }
    let nothing = file.verdict == VerdictKind::NoSignificantMismatch;
    let told: Vec<String> = file.fit.iter().filter_map(|fit| contradicted(fit, nothing)).collect();
    if nothing && !told.is_empty() {
        file.summary = "No mechanism of the catalogue is told from noise, but a model without physics predicts the hold-out far better than the recalibrated simulation: something is missing.".into();
    }
    file.notes.extend(told);
}

/// What speaks against a verdict that nothing is missing, or that what is told is all. The verdict stays, since the hold-out decides nothing.
fn contradicted(fit: &FitRecord, nothing: bool) -> Option<String> {
    let (share, FitRecord { recording, output, .. }) = (fit.outdone()?, fit);
    Some(if nothing {
        format!(
            "on {recording} a black box leaves {share:.2} of the simulation's error of `{output}`: something is missing after all, which no mechanism of the catalogue explains and which passed for noise on the recordings for estimation"
        )
    } else if fit.rmse_after.is_some() {
        format!(
            "on {recording} a black box leaves {share:.2} of the augmented simulation's error of `{output}`: more is missing than what was found"
        )
    } else {
        format!(
            "on {recording} a black box leaves {share:.2} of the simulation's error of `{output}`: that much of it is no noise"
        )
    })
}

/// The model of `hysid fit`, found in a narrower search: linear models decide on rate and lags, then families compete at these lags only.
///
/// On development cases the error was the same within a few per cent at a quarter of the time of the whole search. In recordings that
/// blocks cut to pieces, long lags can win on pieces and fail over the whole length: then shorter ones are tried. The hold-out chooses
/// nothing: models are judged by a free run through the recordings that they were made from.
fn model(source: Source<'_>, seed: u64, stop: Stop<'_>) -> Result<NarxModel, IdentifyError> {
    let quiet = |_: &str| {};
    let mut best: Option<(f64, NarxModel)> = None;
    for lags in [None, Some(6), Some(3), Some(2)] {
        let options = Options { lags_output: lags, lags_input: lags, seed, ..Options::default() };
        let linear = Options { degree: Some(1), factors: Factors::Polynomial, ..options.clone() };
        let linear = match (identify_until(source, &linear, &quiet, stop), &best) {
            (Ok(linear), _) => linear,
            (Err(IdentifyError::Stopped), _) => return Err(IdentifyError::Stopped),
            (Err(_), Some(_)) => continue,
            (Err(why), None) => return Err(why),
        };
        let told = FitReport::new(&linear, &[], &[], seed)?.summary;
        let options = Options {
            lags_output: Some(told.lags.output),
            lags_input: Some(told.lags.input),
            decimate: Decimate::By(told.decimation),
            ..options
        };
        let claimed = linear.held_rmse;
        let rich = match identify_until(source, &options, &quiet, stop) {
            Err(IdentifyError::Stopped) => return Err(IdentifyError::Stopped),
            rich => rich.ok(),
        };
        for found in [rich, Some(linear)].into_iter().flatten() {
            let error = whole_run(&found.model, source);
            if best.as_ref().is_none_or(|b| error < b.0) {
                best = Some((error, found.model));
            }
        }
        if best.as_ref().is_some_and(|b| b.0 < SOUND * claimed) {
            break;
        }
    }
    best.map(|b| b.1).ok_or(IdentifyError::Nothing("stable model"))
}

/// Free-run error over the recordings that a model was made from, each run through in one go; infinite where it diverges.
fn whole_run(model: &NarxModel, source: Source<'_>) -> f64 {
    let (mut sum, mut count) = (0.0, 0usize);
    for recording in source.recordings {
        let Ok(columns) = Columns::of(model, recording) else { return f64::INFINITY };
        let Ok(run) = model.free_run(&columns.record()) else { return f64::INFINITY };
        if run.diverged_at.is_some() {
            return f64::INFINITY;
        }
        for e in columns.y.iter().zip(&run.y).map(|(a, b)| a - b).filter(|e| e.is_finite()) {
            sum += e * e;
            count += 1;
        }
    }
    if count > 0 { (sum / count as f64).sqrt() } else { f64::INFINITY }
}

/// A model without equations knows only steps: all recordings must have the same.
fn rate_of(estimation: &[Recording], holdout: &[Recording]) -> Result<(), String> {
    let mut periods = estimation.iter().chain(holdout).map(|r| r.clock().period_s);
    let first = periods.next().unwrap_or(1.0);
    match periods.find(|p| (p - first).abs() > SAME_PERIOD * first) {
        Some(other) => Err(format!("the recordings have different sampling periods ({first} s and {other} s)")),
        None => Ok(()),
    }
}

/// The error on the scored samples; `None` where the run diverged before one of them. Samples before the model has a past do not count.
fn error(record: &RecordPicture, prediction: &[f64], diverged_at: Option<usize>) -> Option<f64> {
    let (mut sum, mut count) = (0.0, 0usize);
    for ((&sample, &scored), &measured) in record.samples.iter().zip(&record.scored).zip(&record.measured) {
        if !scored || !measured.is_finite() {
            continue;
        }
        match prediction.get(sample) {
            Some(y) if y.is_finite() => {
                sum += (measured - y).powi(2);
                count += 1;
            }
            _ if diverged_at.is_some_and(|at| sample >= at) => return None,
            _ => {}
        }
    }
    (count > 0).then(|| (sum / count as f64).sqrt())
}

/// The windows of long recordings that the diagnosis itself worked on.
fn windows(recordings: &[Recording], picture: &Picture) -> Vec<Recording> {
    let mut out: Vec<Recording> = Vec::new();
    let mut seen = BTreeSet::new();
    for record in picture.records.iter().filter(|r| r.role == Role::Estimation) {
        let Some(recording) = recordings.get(record.place) else { continue };
        for run in record.samples.chunk_by(|a, b| b - a <= record.every) {
            let (Some(&from), Some(&to)) = (run.first(), run.last()) else { continue };
            // Each output has the same windows, but for its own gaps.
            if to < from + SHORTEST || !seen.insert((record.place, from)) {
                continue;
            }
            // An entry that is a mean stands for the samples up to the next.
            let end = (to + record.every).min(recording.len());
            let part = |c: &Channel| Channel { name: c.name.clone(), samples: c.samples[from..end].to_vec() };
            let channels = recording.channels().iter().map(part).collect();
            let clock = Clock { start_s: recording.clock().time(from), ..recording.clock() };
            out.extend(Recording::new(recording.name(), clock, channels));
        }
    }
    out
}

/// The recordings with the outputs of the held-out samples missing.
fn without_blocks(recordings: &[Recording], held: &[&RecordPicture], simulation: &Simulation) -> Vec<Recording> {
    let outputs: Vec<&str> = simulation.outputs.iter().map(|o| o.column.as_str()).collect();
    let masked = |(place, r): (usize, &Recording)| {
        let channels = r
            .channels()
            .iter()
            .map(|c| {
                let mut samples = c.samples.clone();
                if outputs.contains(&c.name.as_str()) {
                    let out = held.iter().filter(|h| h.place == place && h.output == c.name);
                    for n in out.flat_map(|h| h.samples.iter().copied()) {
                        if let Some(y) = samples.get_mut(n) {
                            *y = f64::NAN;
                        }
                    }
                }
                Channel { name: c.name.clone(), samples }
            })
            .collect();
        Recording::new(r.name(), r.clock(), channels).unwrap_or_else(|_| r.clone())
    };
    recordings.iter().enumerate().map(masked).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(samples: Vec<usize>, scored: Vec<bool>, measured: Vec<f64>) -> RecordPicture {
        RecordPicture {
            recording: "val.csv".into(),
            output: "y".into(),
            unit: String::new(),
            role: Role::HoldOut,
            place: 0,
            time_s: samples.iter().map(|n| *n as f64).collect(),
            before: measured.clone(),
            after: None,
            noise_rms: 0.0,
            every: 1,
            samples,
            scored,
            measured,
        }
    }

    #[test]
    fn only_scored_samples_with_a_past_count() {
        let r = record(
            vec![2, 3, 4, 5, 5, 9],
            vec![true, false, true, true, false, true],
            vec![9.0, 9.0, 1.0, 2.0, f64::NAN, 3.0],
        );
        // Samples 0 to 3 have no past; sample 4 is exact, 5 is off by 3, 9 by 4.
        let nan = f64::NAN;
        let y = [nan, nan, nan, nan, 1.0, 5.0, 0.0, 0.0, 0.0, -1.0];
        assert_eq!(error(&r, &y, None), Some((25.0f64 / 3.0).sqrt()));
        assert_eq!(error(&r, &[nan; 10], Some(4)), None);
        assert_eq!(error(&r, &[nan; 10], None), None);
    }

    #[test]
    fn a_black_box_that_is_far_better_contradicts_the_verdict() {
        let told = |before: Option<f64>, after: Option<f64>, black_box: Option<f64>| {
            let fit = FitRecord {
                recording: "val.csv".into(),
                output: "h_m".into(),
                rmse_before: before,
                rmse_after: after,
                ratio: None,
                ratio_low: None,
                ratio_high: None,
                rmse_black_box: black_box,
            };
            contradicted(&fit, after.is_none())
        };
        let words = told(Some(0.056), None, Some(0.023)).unwrap();
        assert!(words.contains("val.csv") && words.contains("0.41") && words.contains("`h_m`"), "{words}");
        assert_eq!(told(Some(0.056), None, Some(0.05)), None);
        assert_eq!(told(Some(0.056), None, None), None);
        assert_eq!(told(None, None, Some(0.05)), None);
        // Beside an effect the augmented simulation is what counts.
        let words = told(Some(0.4), Some(0.056), Some(0.023)).unwrap();
        assert!(words.contains("0.41") && words.contains("more is missing"), "{words}");
        assert_eq!(told(Some(0.4), Some(0.02), Some(0.023)), None);
    }

    #[test]
    fn a_long_recording_is_learnt_from_in_windows() {
        let ramp: Vec<f64> = (0..1000).map(f64::from).collect();
        let clock = hysid_signal::Clock { start_s: 5.0, period_s: 0.1 };
        let r = Recording::new("r.csv", clock, vec![Channel { name: "y".into(), samples: ramp }]).unwrap();
        let samples: Vec<usize> = (0..200).chain(300..310).chain(700..900).collect();
        let n = samples.len();
        let mut used = record(samples, vec![false; n], vec![0.0; n]);
        used.role = Role::Estimation;
        let picture = Picture { records: vec![used.clone(), used], ..Picture::default() };
        let found = windows(std::slice::from_ref(&r), &picture);
        assert_eq!(found.len(), 2);
        assert_eq!((found[1].len(), found[1].channels()[0].samples[0], found[1].clock().start_s), (200, 700.0, 75.0));
        // Where each entry is a mean over ten samples the windows have all of them.
        let samples: Vec<usize> = (0..=20).chain(70..90).map(|n| 10 * n).collect();
        let n = samples.len();
        let thinned =
            RecordPicture { role: Role::Estimation, every: 10, ..record(samples, vec![false; n], vec![0.0; n]) };
        let found = windows(&[r], &Picture { records: vec![thinned], ..Picture::default() });
        assert_eq!(found.iter().map(Recording::len).collect::<Vec<_>>(), [210, 200]);
    }

    #[test]
    fn held_out_samples_are_hidden_from_the_model() {
        let simulation = Simulation::parse(
            "[time]\nperiod_s = 1.0\n[inputs]\nu = \"u\"\n[parameters]\nk = { value = 1.0, min = 0.0 }\n[outputs]\ny = \"k*u\"\n",
            "a",
        )
        .unwrap();
        let channel = |name: &str| Channel { name: name.into(), samples: vec![1.0, 2.0, 3.0] };
        let clock = hysid_signal::Clock { start_s: 0.0, period_s: 1.0 };
        let r = Recording::new("r.csv", clock, vec![channel("u"), channel("y")]).unwrap();
        let held = record(vec![1], vec![true], vec![2.0]);
        let seen = without_blocks(&[r], &[&held], &simulation);
        assert_eq!(seen[0].channel("u").unwrap().samples, [1.0, 2.0, 3.0]);
        let y = &seen[0].channel("y").unwrap().samples;
        assert!(y[0] == 1.0 && y[1].is_nan() && y[2] == 3.0);
    }
}
