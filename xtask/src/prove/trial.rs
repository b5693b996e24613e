//! One case through the finished binary: a process in a directory that holds nothing but what the user would have.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context, ensure};
use hysid_concealed::case::{Case, Record};

use super::free_run::distance;
use super::verdict::Verdict;

/// What came of a case.
#[derive(Debug, Clone)]
pub struct Trial {
    /// Wall time in seconds, two processes side by side.
    pub seconds: f64,
    /// The verdict, or what went wrong.
    pub verdict: Result<Verdict, String>,
    /// Free-run error of the augmented simulation on the hold-out against the outputs without noise, in units of the noise;
    /// `None` when the program offers none.
    pub after: Option<f64>,
    /// The same at 1.5 times the amplitude.
    pub after_louder: Option<f64>,
}

/// How the binary is run.
#[derive(Debug, Clone)]
pub struct Bench {
    /// The binary.
    pub binary: PathBuf,
    /// Directory for the cases; labels never lie below it.
    pub root: PathBuf,
    /// Limit that is told to the program.
    pub time_limit: Duration,
    /// Whether the program learns a black box of its own beside the simulation.
    pub black_box: bool,
}

impl Bench {
    /// Runs a case.
    pub fn run(&self, case: &Case) -> anyhow::Result<Trial> {
        let folder = self.root.join("cases").join(&case.label.id);
        let out = self.root.join("out").join(&case.label.id);
        case.write(&folder)?;
        let start = Instant::now();
        let limit = format!("{}", self.time_limit.as_secs());
        let mut more = vec!["--time-limit", &limit, "--out"];
        if !self.black_box {
            more.insert(0, "--no-black-box");
        }
        let said = self.call(
            &folder,
            &["diagnose", "baseline.sim.toml", "--recording", "est.csv", "--holdout", "val.csv", "--threads", "1"],
            &more,
            &out,
        );
        let seconds = start.elapsed().as_secs_f64();
        let verdict = said.and_then(|()| {
            let text =
                std::fs::read_to_string(out.join("diagnosis.json")).map_err(|e| format!("no diagnosis.json: {e}"))?;
            Verdict::read(&text).map_err(|e| e.to_string())
        });
        let augmented = out.join("augmented.sim.toml");
        let (mut after, mut after_louder) = (None, None);
        if verdict.as_ref().is_ok_and(Verdict::alarmed) && augmented.exists() {
            after = self.error(case, &augmented, &case.val, &out).ok();
            after_louder = case.louder.as_ref().and_then(|l| self.error(case, &augmented, l, &out).ok());
        }
        Ok(Trial { seconds, verdict, after, after_louder })
    }

    /// Runs the binary in `folder`; the last argument is `path`. The error is what it said.
    pub fn call(&self, folder: &Path, arguments: &[&str], more: &[&str], path: &Path) -> Result<(), String> {
        let mut child = Command::new(&self.binary)
            .args(arguments)
            .args(more)
            .arg(path)
            .current_dir(folder)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|e| format!("{}: {e}", self.binary.display()))?;
        let deadline = Instant::now() + self.time_limit * 2 + Duration::from_secs(20);
        let status = loop {
            match child.try_wait().map_err(|e| e.to_string())? {
                Some(status) => break status,
                None if Instant::now() > deadline => {
                    let _ = child.kill();
                    let _ = child.wait();
                    return Err("over the time limit".into());
                }
                None => std::thread::sleep(Duration::from_millis(5)),
            }
        };
        if status.success() {
            return Ok(());
        }
        let mut said = String::new();
        if let Some(mut e) = child.stderr.take() {
            let _ = std::io::Read::read_to_string(&mut e, &mut said);
        }
        Err(format!("exit status {:?}: {}", status.code(), said.trim()))
    }

    /// Error of a simulation file on a recording, against the outputs without noise, in units of the noise.
    pub fn error(&self, case: &Case, simulation: &Path, record: &Record, out: &Path) -> anyhow::Result<f64> {
        let input = out.join("input.csv");
        let prediction = out.join("prediction.csv");
        std::fs::write(&input, case.csv(record, &record.y))?;
        let path = simulation.to_string_lossy();
        let from = input.to_string_lossy();
        self.call(out, &["simulate", &path, "--input", &from], &["--out"], &prediction).map_err(anyhow::Error::msg)?;
        let columns =
            read_columns(&std::fs::read_to_string(&prediction)?, &case.design.kind.outputs()[..record.clean.len()])?;
        Ok(distance(&columns, &record.clean, &case.label.sigma))
    }
}

/// Columns of a CSV text by name.
pub fn read_columns(text: &str, names: &[&str]) -> anyhow::Result<Vec<Vec<f64>>> {
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().context("empty file")?.split(',').collect();
    let at: Vec<usize> = names
        .iter()
        .map(|n| header.iter().position(|h| h == n).with_context(|| format!("no column {n}")))
        .collect::<anyhow::Result<_>>()?;
    let mut columns = vec![Vec::new(); names.len()];
    for line in lines {
        let cells: Vec<&str> = line.split(',').collect();
        ensure!(cells.len() == header.len(), "ragged row");
        for (column, &i) in columns.iter_mut().zip(&at) {
            column.push(cells[i].parse().unwrap_or(f64::NAN));
        }
    }
    Ok(columns)
}
