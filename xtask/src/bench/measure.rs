//! Runs the contenders of a case, in turns, and keeps what each said.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

use anyhow::Context;
use hysid_bench::timing::{load, read_doubles};
use hysid_concealed::bank;
use hysid_concealed::case::Group;
use hysid_concealed::seed::Stream;
use serde_json::Value;
use xshell::{Shell, cmd};

use super::case::{Case, Contender, Input, Measure, Program, Side};
use super::process::{children_seconds, run_with_peak};

/// Median, smallest and largest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    pub middle: f64,
    pub least: f64,
    pub most: f64,
}

impl Spread {
    /// Of values in any order; NaN of none.
    pub fn of(values: &[f64]) -> Self {
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        let at = |i: usize| sorted.get(i).copied().unwrap_or(f64::NAN);
        let half = sorted.len() / 2;
        let middle = if sorted.len() % 2 == 1 { at(half) } else { (at(half.wrapping_sub(1)) + at(half)) / 2.0 };
        Self { middle, least: at(0), most: at(sorted.len().saturating_sub(1)) }
    }
}

/// What a contender said, one place for each round that it took part in.
#[derive(Debug, Clone)]
pub struct Outcome {
    pub contender: Contender,
    /// CPU seconds for the case's samples: the median of the round's repetitions.
    pub cpu: Vec<f64>,
    /// Wall seconds, likewise.
    pub wall: Vec<f64>,
    pub peak_mib: f64,
    /// The machine's load averages when the rounds ended.
    pub loads: Vec<f64>,
    /// How well it agrees: true terms found, or the difference from our output.
    pub agreement: String,
}

impl Outcome {
    fn new(contender: Contender) -> Self {
        let (cpu, wall, loads) = (Vec::new(), Vec::new(), Vec::new());
        Self { contender, cpu, wall, peak_mib: f64::NAN, loads, agreement: String::new() }
    }

    /// Round by round, CPU time over that of `other`.
    pub fn over(&self, other: &Self) -> Spread {
        Spread::of(&self.cpu.iter().zip(&other.cpu).map(|(a, b)| a / b).collect::<Vec<f64>>())
    }

    /// Round by round, wall time over that of `other`.
    pub fn wall_over(&self, other: &Self) -> Spread {
        Spread::of(&self.wall.iter().zip(&other.wall).map(|(a, b)| a / b).collect::<Vec<f64>>())
    }

    /// Takes down one round from the object that the program printed.
    fn take(&mut self, case: &Case, text: &str) -> anyhow::Result<()> {
        let last = text.trim().lines().last().context("the program printed nothing")?;
        let value: Value = serde_json::from_str(last)?;
        let list = |key: &str| -> Vec<f64> {
            value[key].as_array().map(|a| a.iter().filter_map(Value::as_f64).collect()).unwrap_or_default()
        };
        let (cpu, wall) = match case.measure {
            Measure::Work => {
                let share = case.samples as f64 / value["samples"].as_f64().unwrap_or(case.samples as f64);
                (share * Spread::of(&list("cpu_s")).middle, share * Spread::of(&list("wall_s")).middle)
            }
            Measure::FreeRun => {
                let rate = value["freerun_samples_per_s"].as_f64().context("it ran no free run")?;
                (case.samples as f64 / rate, case.samples as f64 / rate)
            }
        };
        anyhow::ensure!(cpu.is_finite() && wall.is_finite(), "no times in {last}");
        self.cpu.push(cpu);
        self.wall.push(wall);
        self.loads.extend(load());
        if let Some(peak) = value["peak_rss_mib"].as_f64() {
            self.peak_mib = self.peak_mib.max(peak);
        }
        if let (Some(found), Some(all)) = (value["true_terms_found"].as_u64(), value["true_terms"].as_u64()) {
            self.agreement = format!("{found} of {all} terms");
        }
        Ok(())
    }
}

/// What the programs need.
pub struct Place<'a> {
    pub shell: &'a Shell,
    pub root: &'a Path,
    /// A Python with the other tools' packages; none without `--peers`.
    pub python: Option<PathBuf>,
    /// The folder of the comparison of term selection.
    pub scripts: &'a Path,
}

impl Place<'_> {
    fn folder(&self) -> PathBuf {
        self.root.join("target/bench-data")
    }

    /// Runs a case.
    pub fn run(&self, case: &Case, rounds: usize) -> anyhow::Result<Vec<Outcome>> {
        let data = self.data(case)?;
        let wanted = case.contenders.iter().filter(|c| c.side == Side::Ours || self.python.is_some());
        let mut outcomes: Vec<Outcome> = wanted.cloned().map(Outcome::new).collect();
        let mut failed = vec![false; outcomes.len()];
        for round in 0..rounds {
            for (i, outcome) in outcomes.iter_mut().enumerate() {
                let contender = outcome.contender.clone();
                if failed[i] || round >= contender.rounds {
                    continue;
                }
                let output = self.folder().join(format!("out-{i}.f64"));
                let said = self.call(&contender, round, &data, &output).and_then(|text| outcome.take(case, &text));
                match (said, contender.side) {
                    (Ok(()), _) => {
                        let (cpu, wall) = (outcome.cpu[round], outcome.wall[round]);
                        eprintln!("{} {round}: {}: CPU {cpu:.3e} s, wall {wall:.3e} s", case.name, contender.tool);
                    }
                    (Err(e), Side::Ours) if !matches!(contender.program, Program::Compiled) => return Err(e),
                    (Err(e), _) => {
                        eprintln!("{}: {} failed: {e:#}", case.name, contender.tool);
                        failed[i] = true;
                    }
                }
            }
        }
        self.compare(&mut outcomes);
        outcomes.retain(|o| !o.cpu.is_empty());
        Ok(outcomes)
    }

    /// The data file of a case, written if it is not there.
    fn data(&self, case: &Case) -> anyhow::Result<PathBuf> {
        let (shell, folder, n) = (self.shell, self.folder(), case.samples.to_string());
        shell.create_dir(&folder)?;
        let path = match case.input {
            Input::None => return Ok(PathBuf::new()),
            Input::Known(noise) => folder.join(format!("known_{n}_{noise}.npy")),
            Input::Doubles(kind) => folder.join(format!("{kind}_{n}.f64")),
        };
        if !path.exists() {
            match case.input {
                Input::Doubles(kind) => {
                    let program = self.root.join("target/release/timed");
                    cmd!(shell, "{program} input {kind} {n} {path}").quiet().ignore_stdout().run()?;
                }
                Input::Known(noise) => {
                    let (program, base) = (self.root.join("target/release/kernels"), path.with_extension(""));
                    cmd!(shell, "{program} data {n} 1 {noise} {base}").quiet().run()?;
                }
                Input::None => {}
            }
        }
        Ok(path)
    }

    fn call(&self, contender: &Contender, round: usize, data: &Path, output: &Path) -> anyhow::Result<String> {
        let place = |word: &String| match word.as_str() {
            "{in}" => data.display().to_string(),
            "{out}" => output.display().to_string(),
            _ => word.clone(),
        };
        let mut words: Vec<String> = contender.words.iter().map(place).collect();
        let own = self.root.join("crates/hysid-bench/peers");
        let program = match contender.program {
            Program::Hysid => self.root.join("target/release/hysid"),
            Program::Timed => self.root.join("target/release/timed"),
            Program::Compiled => self.compiled()?,
            Program::Shared | Program::Script => {
                let folder = if matches!(contender.program, Program::Shared) { self.scripts } else { &own };
                let script = words.first_mut().context("no script")?;
                *script = folder.join(&*script).display().to_string();
                self.python.clone().context("no Python")?
            }
            Program::Diagnose(group) => return self.diagnose(group, round, contender.threads),
        };
        let threads = contender.threads.to_string();
        let text = cmd!(self.shell, "{program} {words...}")
            .env("OMP_NUM_THREADS", &threads)
            .env("OPENBLAS_NUM_THREADS", &threads)
            .env("NUMBA_CACHE_DIR", self.root.join("target/peers/numba"))
            .quiet()
            .read()?;
        Ok(text)
    }

    /// The loop in C, compiled anew where its source is younger.
    fn compiled(&self) -> anyhow::Result<PathBuf> {
        let shell = self.shell;
        let (source, program) = (self.root.join("crates/hysid-bench/peers/bouc_wen.c"), self.folder().join("bouc_wen"));
        let age = |p: &Path| std::fs::metadata(p).and_then(|m| m.modified()).ok();
        if age(&program) < age(&source) {
            cmd!(shell, "cc -O3 -o {program} {source} -lm").quiet().run()?;
        }
        Ok(program)
    }

    /// One diagnosis by the binary: of the development cases with 4000 samples, number `round` of its group.
    fn diagnose(&self, group: Group, round: usize, threads: usize) -> anyhow::Result<String> {
        let wanted = |i: &usize| bank::plan(Stream::Development, 1, *i).group == group;
        let case = (0..1000)
            .filter(wanted)
            .map(|i| bank::case(Stream::Development, 1, i))
            .filter(|c| c.label.samples == 4000 && c.label.group == group)
            .nth(round)
            .context("too few cases")?;
        let (folder, program) = (self.folder().join("case"), self.root.join("target/release/hysid"));
        case.write(&folder)?;
        let mut command = Command::new(program);
        command.arg("diagnose").arg(folder.join("baseline.sim.toml")).args(["--threads", &threads.to_string()]);
        for (option, name) in [("--recording", "est.csv"), ("--holdout", "val.csv"), ("--out", "out")] {
            command.arg(option).arg(folder.join(name));
        }
        let (before, began) = (children_seconds(), Instant::now());
        let peak = run_with_peak(command.stdout(Stdio::null()).stderr(Stdio::null()))?;
        let wall = began.elapsed().as_secs_f64();
        let cpu = children_seconds().zip(before).map_or(wall, |(now, then)| now - then);
        let samples = case.label.samples;
        let said = serde_json::json!({ "cpu_s": [cpu], "wall_s": [wall], "samples": samples, "peak_rss_mib": peak });
        Ok(said.to_string())
    }

    /// Differences of the outputs from that of the contender over which each is put, where there are outputs.
    fn compare(&self, outcomes: &mut [Outcome]) {
        let read = |i: usize| read_doubles(&self.folder().join(format!("out-{i}.f64"))).ok();
        for i in 0..outcomes.len() {
            let Some(own) = outcomes.iter().position(|o| o.contender.tool == outcomes[i].contender.over) else {
                continue;
            };
            let has_output = outcomes[i].contender.words.iter().any(|w| w == "{out}");
            if own == i || !has_output || outcomes[i].cpu.is_empty() {
                continue;
            }
            if let Some(difference) = read(own).zip(read(i)).and_then(|(ours, other)| difference(&ours, &other)) {
                outcomes[i].agreement = format!("to {difference:.0e}");
            }
        }
    }
}

/// Largest difference over as many samples as both have, over the largest of the first.
fn difference(ours: &[f64], other: &[f64]) -> Option<f64> {
    let largest = ours.iter().zip(other).map(|(a, _)| a.abs()).reduce(f64::max)?;
    let apart = ours.iter().zip(other).map(|(a, b)| (a - b).abs()).reduce(f64::max)?;
    Some(apart / largest)
}

/// A Python with the other tools' packages, installed where they are not.
pub fn python(shell: &Shell, root: &Path, scripts: &Path) -> anyhow::Result<PathBuf> {
    let folder = root.join("target/peers");
    let python = folder.join("bin/python");
    if !python.exists() {
        cmd!(shell, "python3 -m venv {folder}").run()?;
    }
    for (stamp, list) in [
        ("selection", scripts.join("requirements.txt")),
        ("loops", root.join("crates/hysid-bench/peers/requirements.txt")),
    ] {
        let (stamp, wanted) = (folder.join(format!("installed-{stamp}.txt")), std::fs::read_to_string(&list)?);
        if std::fs::read_to_string(&stamp).ok().as_ref() != Some(&wanted) {
            cmd!(shell, "{python} -m pip install --quiet -r {list}").run()?;
            std::fs::write(&stamp, wanted)?;
        }
    }
    Ok(python)
}

#[cfg(test)]
mod tests {
    use super::super::case::words;
    use super::*;

    #[test]
    fn a_spread_has_the_median_of_either_number_of_values() {
        for (values, expected) in [
            (&[3.0, 1.0, 2.0][..], (2.0, 1.0, 3.0)),
            (&[4.0, 1.0, 2.0, 8.0][..], (3.0, 1.0, 8.0)),
            (&[5.0][..], (5.0, 5.0, 5.0)),
        ] {
            let s = Spread::of(values);
            assert_eq!((s.middle, s.least, s.most), expected);
        }
        assert!(Spread::of(&[]).middle.is_nan());
    }

    fn outcome(measure: Measure, text: &str) -> anyhow::Result<Outcome> {
        let contender = Contender {
            tool: "tool".into(),
            side: Side::Peer,
            threads: 1,
            program: Program::Script,
            words: words("x.py {in}"),
            rounds: 1,
            over: "tool",
        };
        let case = Case {
            name: "case",
            work: "",
            samples: 1000,
            input: Input::None,
            measure,
            contenders: Vec::new(),
            goals: Vec::new(),
            remark: "",
        };
        let mut outcome = Outcome::new(contender);
        outcome.take(&case, text).map(|()| outcome)
    }

    #[test]
    fn what_was_measured_on_fewer_samples_is_scaled() {
        let said = "a warning\n{\"cpu_s\": [0.1, 0.3, 0.2], \"wall_s\": [1.0], \"samples\": 10, \"peak_rss_mib\": 7}";
        let one = outcome(Measure::Work, said).unwrap();
        assert!((one.cpu[0] - 20.0).abs() < 1e-12 && (one.wall[0] - 100.0).abs() < 1e-12);
        assert_eq!(one.peak_mib, 7.0);
        let whole = outcome(
            Measure::Work,
            "{\"cpu_s\": [0.5], \"wall_s\": [1.0], \"true_terms_found\": 9, \"true_terms\": 10}",
        );
        let whole = whole.unwrap();
        assert_eq!((whole.cpu[0], whole.agreement.as_str()), (0.5, "9 of 10 terms"));
        let run = outcome(Measure::FreeRun, "{\"cpu_s\": [9], \"freerun_samples_per_s\": 500}").unwrap();
        assert_eq!(run.cpu[0], 2.0);
    }

    #[test]
    fn what_holds_no_times_is_an_error() {
        for text in ["", "Traceback", "{}", "{\"cpu_s\": [], \"wall_s\": [1]}"] {
            assert!(outcome(Measure::Work, text).is_err(), "{text}");
        }
        assert!(outcome(Measure::FreeRun, "{\"cpu_s\": [1]}").is_err());
    }

    #[test]
    fn ratios_are_taken_round_by_round() {
        let said = |cpu: f64| outcome(Measure::Work, &format!("{{\"cpu_s\": [{cpu}], \"wall_s\": [1]}}")).unwrap();
        let (mut a, mut b) = (said(2.0), said(1.0));
        a.cpu.extend([6.0, 8.0]);
        b.cpu.extend([2.0, 2.0]);
        assert_eq!(a.over(&b), Spread { middle: 3.0, least: 2.0, most: 4.0 });
        // One of them took part in fewer rounds.
        a.cpu.truncate(1);
        assert_eq!(a.over(&b).middle, 2.0);
    }

    #[test]
    fn outputs_are_compared_over_the_samples_that_both_have() {
        assert_eq!(difference(&[1.0, -2.0, 9.0], &[1.0, -1.0]), Some(0.5));
        assert_eq!(difference(&[1.0], &[]), None);
    }
}
