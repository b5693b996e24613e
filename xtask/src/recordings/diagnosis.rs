//! What `hysid diagnose` says of the baselines of the public recordings, each of which leaves something out.
//!
//! The finished binary runs with defaults and two threads; files for estimation and hold-out are those that the head of each
//! simulation names. A recording without a split of its own is cut at the row that the head names. What the literature says is missing
//! stands in `docs/recordings.md`, written before the first run.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use anyhow::{Context, ensure};
use serde_json::Value;

/// Seconds that a diagnosis is given; steps that refine the verdict are left out beyond it.
const TIME_LIMIT: &str = "130";

/// A baseline with its recordings.
struct Baseline {
    /// Its folder of recordings, and its simulation.
    name: &'static str,
    data: Data,
}

enum Data {
    /// Files to estimate from, and files held out.
    Files(&'static [&'static str], &'static [&'static str]),
    /// One file, and the samples of it to estimate from; the rest is held out.
    Cut(&'static str, usize),
}

const BASELINES: [Baseline; 9] = [
    Baseline { name: "emps", data: Data::Files(&["emps_estimation.csv"], &["emps_validation_pulses.csv"]) },
    Baseline {
        name: "silverbox",
        data: Data::Files(
            &["silverbox_estimation_multisine.csv"],
            &["silverbox_validation_multisine.csv", "silverbox_validation_arrow.csv"],
        ),
    },
    Baseline {
        name: "boucwen_benchmark_simulated",
        data: Data::Files(&["boucwen_estimation_multisine.csv"], &["boucwen_validation_multisine.csv"]),
    },
    Baseline { name: "mr_damper_utfpr", data: Data::Files(&["mr_exp1.csv", "mr_exp5.csv"], &["mr_exp10.csv"]) },
    Baseline { name: "mr_damper_boucwen_simulated", data: Data::Cut("mr_damper_sim.csv", 2600) },
    Baseline {
        name: "osu_s809_dynamic_stall",
        data: Data::Files(&["C5l100_08.csv", "C10h100_14.csv"], &["C5m100_14.csv"]),
    },
    Baseline { name: "rocking_wall_ts1", data: Data::Cut("ts1.csv", 640) },
    Baseline { name: "wiener_hammerstein", data: Data::Files(&["wh_estimation.csv"], &["wh_validation.csv"]) },
    Baseline {
        name: "piezo_fine_steering_mirror",
        data: Data::Files(
            &[
                "fsm_300mV_estimation_r0.csv",
                "fsm_300mV_estimation_r1.csv",
                "fsm_300mV_estimation_r2.csv",
                "fsm_100mV_estimation_r0.csv",
            ],
            &["fsm_300mV_validation_r0.csv", "fsm_100mV_validation_r0.csv"],
        ),
    },
];

const HEAD: &str = "| recording | verdict | effects (probability) | hold-out | before | after | after/before | black box | time s |\n\
                    |---|---|---|---|---:|---:|---:|---:|---:|\n";

/// Diagnoses every baseline whose name contains `only`; the rows are printed as they come and returned as a table.
pub(super) fn table(recordings: &Path, simulations: &Path, only: Option<&str>) -> anyhow::Result<String> {
    let binary = crate::prove::build()?;
    let mut text = format!(
        "`hysid diagnose`, two threads, `--time-limit {TIME_LIMIT}`; errors in the unit of the output.\n\n{HEAD}"
    );
    for baseline in BASELINES.iter().filter(|b| only.is_none_or(|o| b.name.contains(o))) {
        eprintln!("{}", baseline.name);
        let rows = baseline.diagnose(&binary, recordings, simulations).with_context(|| baseline.name)?;
        print!("{rows}");
        text.push_str(&rows);
    }
    Ok(text)
}

impl Baseline {
    fn diagnose(&self, binary: &Path, recordings: &Path, simulations: &Path) -> anyhow::Result<String> {
        let folder = recordings.join(self.name);
        let scratch = tempfile::tempdir()?;
        let (estimation, holdout) = self.data.files(&folder, scratch.path())?;
        let out = scratch.path().join("out");
        let mut command = Command::new(binary);
        command.arg("diagnose").arg(simulations.join(format!("{}.sim.toml", self.name)));
        for (flag, files) in [("--recording", &estimation), ("--holdout", &holdout)] {
            files.iter().for_each(|f| {
                command.arg(flag).arg(f);
            });
        }
        let start = Instant::now();
        let ran = command.args(["--threads", "2", "--time-limit", TIME_LIMIT, "--out"]).arg(&out).output()?;
        let seconds = start.elapsed().as_secs_f64();
        ensure!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
        rows(self.name, &std::fs::read_to_string(out.join("diagnosis.json"))?, seconds)
    }
}

impl Data {
    /// Paths of what is estimated from and of what is held out; a cut recording is written below `scratch`.
    fn files(&self, folder: &Path, scratch: &Path) -> anyhow::Result<(Vec<PathBuf>, Vec<PathBuf>)> {
        let within = |names: &[&str]| names.iter().map(|n| folder.join(n)).collect();
        Ok(match *self {
            Data::Files(estimation, holdout) => (within(estimation), within(holdout)),
            Data::Cut(file, samples) => {
                let text = std::fs::read_to_string(folder.join(file)).with_context(|| file.to_owned())?;
                let (first, second) = cut(&text, samples).with_context(|| file.to_owned())?;
                let paths = [scratch.join(format!("first_{file}")), scratch.join(format!("second_{file}"))];
                std::fs::write(&paths[0], first)?;
                std::fs::write(&paths[1], second)?;
                let [first, second] = paths;
                (vec![first], vec![second])
            }
        })
    }
}

/// The first rows of a table and the others, both under its header.
fn cut(text: &str, samples: usize) -> anyhow::Result<(String, String)> {
    let lines: Vec<&str> = text.lines().collect();
    ensure!(lines.len() > samples + 1, "it has no more than {samples} samples");
    let (head, body) = (lines[0], &lines[1..]);
    let part = |rows: &[&str]| format!("{head}\n{}\n", rows.join("\n"));
    Ok((part(&body[..samples]), part(&body[samples..])))
}

/// A row for each held-out recording.
fn rows(name: &str, diagnosis: &str, seconds: f64) -> anyhow::Result<String> {
    let d: Value = serde_json::from_str(diagnosis).context("diagnosis.json")?;
    let list = |v: &Value| v.as_array().cloned().unwrap_or_default();
    let word = |v: &Value| v.as_str().unwrap_or("-").to_owned();
    let effects: Vec<String> = list(&d["effects"])
        .iter()
        .map(|e| format!("`{}` {:.2}", word(&e["mechanism"]), e["probability"].as_f64().unwrap_or(f64::NAN)))
        .collect();
    let number =
        |v: &Value| v.as_f64().map_or("-".to_owned(), |x| if x < 1.0 { format!("{x:.3e}") } else { format!("{x:.3}") });
    let ratio = |v: &Value| v.as_f64().map_or("-".to_owned(), |x| format!("{x:.3}"));
    let mut text = String::new();
    for (i, fit) in list(&d["fit"]).iter().enumerate() {
        let (name, verdict, effects, time) = match i {
            0 => (name, word(&d["verdict"]), effects.join(", "), format!("{seconds:.0}")),
            _ => ("", String::new(), String::new(), String::new()),
        };
        text.push_str(&format!(
            "| {name} | {verdict} | {effects} | {} | {} | {} | {} | {} | {time} |\n",
            word(&fit["recording"]),
            number(&fit["rmse_before"]),
            number(&fit["rmse_after"]),
            ratio(&fit["ratio"]),
            number(&fit["rmse_black_box"]),
        ));
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cut_recording_keeps_its_header_and_every_row_once() {
        let (first, second) = cut("t,u\n0,1\n1,2\n2,3\n", 2).unwrap();
        assert_eq!((first.as_str(), second.as_str()), ("t,u\n0,1\n1,2\n", "t,u\n2,3\n"));
        assert!(cut("t,u\n0,1\n", 1).is_err());
    }

    #[test]
    fn every_hold_out_has_a_row_and_the_verdict_stands_in_the_first() {
        let text = r#"{"verdict":"ambiguous","effects":[{"mechanism":"stall_lag","probability":0.98}],
            "fit":[{"recording":"a.csv","rmse_before":2.0,"rmse_after":1.0,"ratio":0.5,"rmse_black_box":null},
                   {"recording":"b.csv","rmse_before":0.002,"rmse_after":0.001,"ratio":0.5,"rmse_black_box":0.003}]}"#;
        assert_eq!(
            rows("wing", text, 3.4).unwrap(),
            "| wing | ambiguous | `stall_lag` 0.98 | a.csv | 2.000 | 1.000 | 0.500 | - | 3 |\n\
             |  |  |  | b.csv | 2.000e-3 | 1.000e-3 | 0.500 | 3.000e-3 |  |\n"
        );
        assert!(rows("wing", "no JSON", 1.0).is_err());
    }
}
