//! Figure 7: one NARX model against the reduced-frequency model, over several frequencies of a pitching wing.
//!
//! The paper's recordings do not exist in public. The question is put to a surrogate (Goman-Khrabrov) and to the pitching S809 aerofoil of the
//! Ohio State University.

use std::path::Path;

use anyhow::Context;
use hysid_dictionary::{Constant, Dictionary, Model, Record, Signals, Spec, Term};
use hysid_hysteresis::{GomanKhrabrov, GomanKhrabrovParameters, Sampled, Wing};
use hysid_io::{ReadOptions, read_recording};
use hysid_report::figure::{Mark, Plot, Tone};
use hysid_select::{Criterion, Options, Search};
use hysid_validate::{Normaliser, measure};

use super::cell::{Grid, Section};
use super::paper::choose_from;
use super::reduced_frequency::{Fitted, Motion};

/// The NARX model chosen on these motions: orthogonal selection, and of its sizes the one whose free run on the same motions is best.
fn narx(motions: &[Motion], ny: usize, nu: usize, degree: usize) -> anyhow::Result<Model> {
    let dictionary: Dictionary =
        Spec::narx(Signals::siso(), ny, 0..=nu, degree).constant(Constant::Candidate).build()?;
    let records: Vec<Record<'_>> = motions.iter().map(|m| Record::siso(&m.alpha, &m.c_n)).collect();
    let blocks = hysid_dictionary::Design::new(&dictionary, &records)?.rows_of_records();
    let options =
        Options { search: Search::Floating, criterion: Criterion::Blocks(blocks), max_terms: 24, ..Options::default() };
    let chosen = choose_from(dictionary, &records, &options)?;
    let mut best: Option<(f64, Model)> = None;
    for point in &chosen.selection.curve {
        let terms: Vec<Term> =
            point.columns.iter().filter_map(|c| chosen.dictionary.terms().get(*c)).cloned().collect();
        let refit = Dictionary::from_terms(Signals::siso(), terms.iter().cloned())?;
        let size = refit.len();
        let all = Options {
            criterion: Criterion::Terms(size),
            max_terms: size,
            search: Search::Greedy,
            ..Options::default()
        };
        let fitted = choose_from(refit, &records, &all)?;
        let terms: Vec<Term> =
            fitted.selection.terms.iter().filter_map(|c| fitted.dictionary.terms().get(*c)).cloned().collect();
        let model = Model::new(Signals::siso(), terms, fitted.selection.theta.clone())?;
        let score = total_error(motions, |m| free_run(&model, m))?;
        if score.is_finite() && best.as_ref().is_none_or(|b| score < b.0) {
            best = Some((score, model));
        }
    }
    best.map(|b| b.1).context("every size of the NARX model diverges on the motions it was fitted to")
}

/// The free run from the first measured samples; infinite from the sample at which it diverges.
fn free_run(model: &Model, m: &Motion) -> anyhow::Result<Vec<f64>> {
    let reach = model.reach().min(m.c_n.len());
    let mut run = model.free_run(&[&m.alpha], &m.c_n[..reach], m.alpha.len(), 100.0)?;
    if let Some(n) = run.diverged_at {
        run.y[n..].fill(f64::INFINITY);
    }
    Ok(run.y)
}

fn total_error(motions: &[Motion], run: impl Fn(&Motion) -> anyhow::Result<Vec<f64>>) -> anyhow::Result<f64> {
    let (mut sum, mut count) = (0.0, 0);
    for m in motions {
        let e = measure(&m.c_n, &run(m)?);
        sum += e.mse * e.samples as f64;
        count += e.samples;
    }
    Ok((sum / count as f64).sqrt())
}

/// The table and the figure of both models on motions that were and were not used.
fn compare(
    estimation: &[Motion],
    validation: &[Motion],
    model: &Model,
) -> anyhow::Result<(Vec<Vec<String>>, Plot, [f64; 2])> {
    let linear = Fitted::to(estimation)?;
    let mut rows = Vec::new();
    for (role, motions) in [("estimation", estimation), ("validation", validation)] {
        for m in motions {
            let ours = measure(&m.c_n, &free_run(model, m)?);
            let other = measure(&m.c_n, &linear.run(m));
            rows.push(vec![
                m.name.clone(),
                role.into(),
                format!("{:.4}", ours.rmse),
                format!("{:.4}", other.rmse),
                format!("{:.3}", ours.nrmse(Normaliser::Std)),
                format!("{:.3}", other.nrmse(Normaliser::Std)),
            ]);
        }
    }
    let totals = [total_error(validation, |m| free_run(model, m))?, total_error(validation, |m| Ok(linear.run(m)))?];
    rows.push(vec![
        "all of validation".into(),
        "validation".into(),
        format!("{:.4}", totals[0]),
        format!("{:.4}", totals[1]),
        String::new(),
        String::new(),
    ]);
    let shown = validation.last().context("no motion to show")?;
    let plane = |c: &[f64]| shown.alpha.iter().map(|a| a.to_degrees()).zip(c.iter().copied()).collect::<Vec<_>>();
    let plot = Plot::new("angle of attack, degrees", "normal force coefficient")
        .with(&shown.name, Tone::Measured, Mark::Dots, plane(&shown.c_n))
        .with("reduced-frequency model", Tone::Before, Mark::Line, plane(&linear.run(shown)))
        .with("NARX, free run", Tone::After, Mark::Line, plane(&free_run(model, shown)?));
    Ok((rows, plot, totals))
}

fn grid(rows: Vec<Vec<String>>) -> Grid {
    let columns = [
        "motion",
        "role",
        "NARX, RMSE",
        "reduced frequency, RMSE",
        "NARX, RMSE / std",
        "reduced frequency, RMSE / std",
    ];
    Grid {
        caption: "Free run of one model of each kind over all motions".into(),
        columns: columns.map(String::from).to_vec(),
        rows,
    }
}

fn describe(model: &Model) -> String {
    let terms: Vec<String> = model
        .terms()
        .iter()
        .zip(model.theta())
        .map(|(t, theta)| format!("{theta:+.4} {}", model.signals().format(t)))
        .collect();
    format!("NARX model (u = alpha in rad, y = C_N, {} terms): y[n] = {}", terms.len(), terms.join(" "))
}

/// The surrogate.
pub fn surrogate() -> anyhow::Result<Section> {
    let wing = Wing { chord_m: 0.4269, speed_m_s: 25.0 };
    let chord_time = wing.chord_m / wing.speed_m_s;
    let law = GomanKhrabrov::new(GomanKhrabrovParameters {
        wing,
        alpha_star: 25_f64.to_radians(),
        steepness: 15.0,
        tau1_s: 5.0 * chord_time,
        tau2_s: 3.0 * chord_time,
        c_attached: 3.0,
        c_separated: 1.3,
        c_nq: 3.0,
    })?;
    let period_s = 0.02;
    let motion = |hz: f64, amplitude: f64| -> anyhow::Result<Motion> {
        let w = std::f64::consts::TAU * hz;
        // Two periods, after one that lets the start die away.
        let per_cycle = (1.0 / (hz * period_s)).round() as usize;
        let time = |n: usize| n as f64 * period_s;
        let alpha: Vec<f64> =
            (0..3 * per_cycle).map(|n| (30.0 + amplitude * (w * time(n)).sin()).to_radians()).collect();
        let rate: Vec<f64> = (0..3 * per_cycle).map(|n| (amplitude * w * (w * time(n)).cos()).to_radians()).collect();
        let c_n = Sampled::new(law, period_s, 4)?.run_with_derivative(&alpha, &rate);
        Ok(Motion {
            name: format!("{hz} Hz, 30 +- {amplitude} degrees"),
            step: period_s / wing.half_chord_time_s(),
            alpha: alpha[per_cycle..].to_vec(),
            c_n: c_n[per_cycle..].to_vec(),
        })
    };
    let estimation = [motion(0.2, 25.0)?, motion(0.8, 25.0)?, motion(1.6, 25.0)?, motion(0.8, 12.0)?];
    let validation = [motion(1.2, 25.0)?, motion(0.5, 18.0)?, motion(0.4, 25.0)?];
    let model = narx(&estimation, 2, 2, 3)?;
    let (rows, plot, totals) = compare(&estimation, &validation, &model)?;
    Ok(Section {
        title: "Figure 7 on a surrogate: NARX against the reduced-frequency model".into(),
        settings: vec![
            "Goman-Khrabrov wing: c = 0.4269 m, V = 25 m/s, alpha = 30 +- 25 degrees, alpha* = 25 degrees, s = 15 per rad, tau1 = 5 c/V, tau2 = 3 c/V, C_att = 3 sin alpha, C_sep = 1.3 sin alpha, C_Nq = 3."
                .into(),
            "Sampled every 20 ms, no noise. NARX: lags 2 and 2, u[n] included, degree 3, selected by recording-wise leave-out, length by the free run on the motions of estimation.".into(),
            "Reduced-frequency model: five parameters (C_N0, C_a, C_q, D, tau), least squares on the same motions.".into(),
        ],
        right_label: String::new(),
        cells: Vec::new(),
        grids: vec![grid(rows)],
        notes: vec![verdict(totals), describe(&model)],
        figures: vec![(plot, "Figure 7's motion, 0.4 Hz, which neither model was fitted to.".into())],
    })
}

fn verdict([narx, linear]: [f64; 2]) -> String {
    let better = if narx < linear { "better" } else { "worse" };
    format!(
        "On the motions left out the NARX model's error is {:.2} times the reduced-frequency model's: {better}.",
        narx / linear
    )
}

/// The real aerofoil; a section that says so where the recordings are not there.
pub fn aerofoil(folder: &Path) -> anyhow::Result<Section> {
    let title = "Figure 7 on a real aerofoil: the pitching S809".to_owned();
    if !folder.is_dir() {
        anyhow::ensure!(std::env::var("HYSID_REQUIRE_RECORDINGS").is_err(), "the recordings are needed but not there");
        return Ok(Section { title, notes: vec!["Skipped: no recordings.".into()], ..Section::default() });
    }
    let meta: serde_json::Value = hysid_io::read_json(&folder.join("meta.json"))?;
    let speed = |file: &str| -> Option<f64> {
        let files = meta.get("recordings")?.as_array()?;
        files.iter().find(|f| f.get("file").and_then(|n| n.as_str()) == Some(file))?.get("airspeed_m_s")?.as_f64()
    };
    let chord = meta.pointer("/constants/chord_m").and_then(serde_json::Value::as_f64).unwrap_or(0.4572);
    let motion = |name: &str| -> anyhow::Result<Motion> {
        let file = format!("{name}.csv");
        let r = read_recording(&folder.join(&file), &ReadOptions::columns(["alpha_deg", "CN"]))?;
        let speed = speed(&file).with_context(|| format!("no airspeed for {file}"))?;
        // One model needs one sampling period; in units of c/(2V) it is the same for all runs.
        let unit = chord / (2.0 * speed);
        let at = |column: &str| -> anyhow::Result<Vec<f64>> {
            let x = &r.channel(column).with_context(|| format!("{file} has no {column}"))?.samples;
            Ok(resample(x, STEP * unit / r.clock().period_s))
        };
        let alpha = at("alpha_deg")?.into_iter().map(f64::to_radians).collect();
        Ok(Motion { name: name.to_owned(), step: STEP, alpha, c_n: at("CN")? })
    };
    let named = |amplitudes: &[&str], rates: &[&str]| -> anyhow::Result<Vec<Motion>> {
        let mut all = Vec::new();
        for a in amplitudes {
            for rate in rates {
                for mean in ["08", "14", "20"] {
                    all.push(motion(&format!("{a}{rate}100_{mean}"))?);
                }
            }
        }
        Ok(all)
    };
    let estimation = named(&["C5", "C10"], &["l", "h"])?;
    let validation = named(&["C5", "C10"], &["m"])?;
    let model = narx(&estimation, 2, 2, 3)?;
    let (rows, plot, totals) = compare(&estimation, &validation, &model)?;
    Ok(Section {
        title,
        settings: vec![
            "OSU/NREL S809, Reynolds number 1.0e6, clean surface: the low and high frequencies (k about 0.026 and 0.077) for estimation, the medium one (0.052) for validation, mean angles 8, 14, 20, \
             amplitudes 5 and 10 degrees."
                .into(),
            format!("Resampled by straight lines to a period of {STEP} c/(2V), the same for all runs. NARX and reduced-frequency model as for the surrogate."),
        ],
        right_label: String::new(),
        cells: Vec::new(),
        grids: vec![grid(rows)],
        notes: vec![
            verdict(totals),
            "For comparison (the recordings' own documentation, not resampled): quasi-steady look-up 0.2195 and a fitted Goman-Khrabrov model 0.1225 on the same validation runs.".into(),
            describe(&model),
        ],
        figures: vec![(plot, "A validation run: measured, and the free run of both models.".into())],
    })
}

/// The common sampling period of the aerofoil's runs, in units of c/(2V).
const STEP: f64 = 4.0;

/// The signal every `ratio` original samples, by straight lines.
fn resample(x: &[f64], ratio: f64) -> Vec<f64> {
    let count = ((x.len() - 1) as f64 / ratio).floor() as usize + 1;
    (0..count)
        .map(|k| {
            let at = k as f64 * ratio;
            let n = (at.floor() as usize).min(x.len() - 2);
            x[n] + (at - n as f64) * (x[n + 1] - x[n])
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_narx_model_beats_the_linear_one_over_frequencies() {
        let mut sections = vec![surrogate().unwrap()];
        let folder = crate::root().join("../shared/recordings/osu_s809_dynamic_stall");
        if folder.is_dir() {
            sections.push(aerofoil(&folder).unwrap());
        } else {
            assert!(std::env::var("HYSID_REQUIRE_RECORDINGS").is_err(), "the recordings are needed but not there");
            println!("skipped: no recordings");
        }
        for s in sections {
            assert!(s.notes.iter().any(|n| n.ends_with(": better.")), "{}: {:?}", s.title, s.notes);
        }
    }

    #[test]
    fn resampling_is_exact_on_a_line() {
        let x: Vec<f64> = (0..10).map(f64::from).collect();
        assert_eq!(resample(&x, 2.5), [0.0, 2.5, 5.0, 7.5]);
    }
}
