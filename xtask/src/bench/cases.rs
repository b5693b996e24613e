//! The cases, and how a command is run on one.

use std::path::{Path, PathBuf};

use anyhow::Context;
use serde_json::Value;
use xshell::{Shell, cmd};

/// A case of the comparison.
pub struct Case {
    pub name: &'static str,
    /// What is done, for the table.
    pub work: &'static str,
    pub n: usize,
    pub lags: usize,
    pub terms: usize,
    pub noise: &'static str,
    /// Our way of searching.
    pub search: &'static str,
    pub reps: usize,
    pub freerun: usize,
    /// The other tools' scripts and variants that are comparable, and how often each is repeated.
    pub peers: &'static [&'static str],
    pub peer_reps: usize,
    /// How many times faster than the best other tool it should be.
    pub goal: f64,
}

/// All cases.
pub fn all() -> Vec<Case> {
    let greedy: &[&str] = &["bench_fastcan.py --variant h", "bench_sysidentpy.py --variant frols"];
    let base = Case {
        name: "small",
        work: "select 11 of 84, N = 1000",
        n: 1_000,
        lags: 3,
        terms: 11,
        noise: "0.01",
        search: "greedy",
        reps: 51,
        freerun: 0,
        peers: greedy,
        peer_reps: 9,
        goal: 15.0,
    };
    vec![
        Case {
            work: "select 15 of 286, N = 10 000",
            name: "medium",
            n: 10_000,
            lags: 5,
            terms: 15,
            reps: 15,
            peer_reps: 5,
            goal: 30.0,
            ..base
        },
        Case {
            work: "select 20 of 1771, N = 100 000",
            name: "large",
            n: 100_000,
            lags: 10,
            terms: 20,
            reps: 5,
            peer_reps: 1,
            goal: 100.0,
            ..base
        },
        Case {
            work: "select 15 of 286, N = 1 000 000",
            name: "huge",
            n: 1_000_000,
            lags: 5,
            terms: 15,
            reps: 5,
            peers: &greedy[..1],
            peer_reps: 1,
            goal: 100.0,
            ..base
        },
        Case {
            work: "all true terms: default search against beam of ten, N = 10 000",
            name: "search",
            n: 10_000,
            noise: "0",
            search: "default",
            reps: 15,
            peers: &["bench_fastcan.py --variant beam10"],
            peer_reps: 5,
            goal: 50.0,
            ..base
        },
        Case {
            work: "stopped by exact PRESS, N = 1000",
            name: "press",
            terms: 30,
            search: "press",
            peers: &[],
            goal: f64::NAN,
            ..base
        },
        Case {
            work: "free run of 11 terms (samples a second)",
            name: "free-run",
            n: 100_000,
            reps: 1,
            freerun: 100_000,
            peer_reps: 1,
            goal: f64::NAN,
            ..base
        },
        base,
    ]
}

/// Median, smallest and largest.
#[derive(Debug, Clone, Copy)]
pub struct Spread {
    pub middle: f64,
    pub least: f64,
    pub most: f64,
}

impl Spread {
    fn of(values: &[f64]) -> Self {
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        let at = |i: usize| sorted.get(i).copied().unwrap_or(f64::NAN);
        Self { middle: at(sorted.len() / 2), least: at(0), most: at(sorted.len().saturating_sub(1)) }
    }
}

/// What a command said of a case.
pub struct Outcome {
    pub case: &'static str,
    pub tool: String,
    pub threads: usize,
    pub cpu: Spread,
    pub wall: Spread,
    pub peak_mib: f64,
    pub found: Option<(u64, u64)>,
    pub load: f64,
    pub free_run: Option<f64>,
}

impl Outcome {
    fn read(case: &'static str, tool: String, threads: usize, text: &str) -> anyhow::Result<Self> {
        let last = text.trim().lines().last().context("the command printed nothing")?;
        let value: Value = serde_json::from_str(last)?;
        let list = |key: &str| -> Vec<f64> {
            value[key].as_array().map(|a| a.iter().filter_map(Value::as_f64).collect()).unwrap_or_default()
        };
        Ok(Self {
            case,
            tool,
            threads,
            cpu: Spread::of(&list("cpu_s")),
            wall: Spread::of(&list("wall_s")),
            peak_mib: value["peak_rss_mib"].as_f64().unwrap_or(f64::NAN),
            found: value["true_terms_found"].as_u64().zip(value["true_terms"].as_u64()),
            load: value["loadavg"].as_f64().unwrap_or(f64::NAN),
            free_run: value["freerun_samples_per_s"].as_f64(),
        })
    }
}

/// The data file of a case, written if it is not there.
pub fn data(shell: &Shell, root: &Path, case: &Case) -> anyhow::Result<PathBuf> {
    let folder = root.join("target/bench-data");
    shell.create_dir(&folder)?;
    let (n, noise) = (case.n.to_string(), case.noise);
    let base = folder.join(format!("known_{n}_{noise}"));
    let file = PathBuf::from(format!("{}.npy", base.display()));
    if !file.exists() {
        let program = root.join("target/release/kernels");
        cmd!(shell, "{program} data {n} 1 {noise} {base}").run()?;
    }
    Ok(file)
}

fn options(case: &Case, data: &Path, reps: usize) -> Vec<String> {
    let mut words = vec!["--data".to_string(), data.display().to_string()];
    let lags = case.lags.to_string();
    for (key, value) in [
        ("--n", case.n.to_string()),
        ("--ny", lags.clone()),
        ("--nu", lags),
        ("--degree", "3".into()),
        ("--terms", case.terms.to_string()),
        ("--reps", reps.to_string()),
        ("--freerun", case.freerun.to_string()),
    ] {
        words.extend([key.to_string(), value]);
    }
    words
}

/// Runs our side.
pub fn ours(shell: &Shell, root: &Path, case: &Case, data: &Path, threads: usize) -> anyhow::Result<Outcome> {
    let program = root.join("target/release/hysid");
    let (options, search, count) = (options(case, data, case.reps), case.search, threads.to_string());
    let text = cmd!(shell, "{program} bench --search {search} --threads {count} {options...}").quiet().read()?;
    Outcome::read(case.name, "hysid".into(), threads, &text)
}

/// Runs another tool with one thread.
pub fn peer(
    shell: &Shell,
    python: &Path,
    scripts: &Path,
    case: &Case,
    script: &str,
    data: &Path,
) -> anyhow::Result<Outcome> {
    let mut words = script.split_whitespace();
    let file = scripts.join(words.next().unwrap_or_default());
    let (rest, options): (Vec<&str>, _) = (words.collect(), options(case, data, case.peer_reps));
    let text = cmd!(shell, "{python} {file} {rest...} {options...}")
        .env("OMP_NUM_THREADS", "1")
        .env("OPENBLAS_NUM_THREADS", "1")
        .quiet()
        .read()?;
    let tool = script.trim_start_matches("bench_").replace(".py --variant", "");
    Outcome::read(case.name, tool, 1, &text)
}

/// A Python with the other tools' packages.
pub fn python(shell: &Shell, root: &Path, scripts: &Path) -> anyhow::Result<PathBuf> {
    let folder = root.join("target/peers");
    let python = folder.join("bin/python");
    if !python.exists() {
        cmd!(shell, "python3 -m venv {folder}").run()?;
        let requirements = scripts.join("requirements.txt");
        cmd!(shell, "{python} -m pip install --quiet -r {requirements}").run()?;
    }
    Ok(python)
}
