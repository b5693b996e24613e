//! `cargo xtask prove`: lets the finished `hysid` binary diagnose recordings in which an effect is concealed, and scores it.
//!
//! The program under test runs as a process in a directory that holds `baseline.sim.toml`, `est.csv` and `val.csv` of all cases and nothing
//! else; the labels stay in this process until every case has been diagnosed. Reported figures come from the reporting
//! stream of seeds, which shares no case with the development stream.

#[cfg(test)]
mod agreement;
mod black;
mod controls;
mod experiment;
mod free_run;
mod guard;
mod linear;
mod page;
pub mod reliability;
mod rivals;
mod score;
mod sindy;
mod stats;
mod trial;
mod verdict;
mod visible;

use std::ops::Range;
use std::path::PathBuf;
use std::process::Command;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context, ensure};
use hysid_concealed::bank;
use hysid_concealed::case::{Case, Wanted};
use hysid_concealed::noise::Noise;
use hysid_concealed::seed::Stream;
use score::{Row, Score};
use trial::Bench;

/// Prove the diagnosis on data where the effect is concealed
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Seed of the bank
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Number of cases [default: 240; 60 with --quick]
    #[arg(long)]
    cases: Option<usize>,
    /// Leave out cases with more samples than this [default: no limit]
    #[arg(long)]
    longest: Option<usize>,
    /// Begin no further case after this many minutes
    #[arg(long)]
    minutes: Option<u64>,
    /// First case of the bank to run
    #[arg(long, default_value_t = 0)]
    first: usize,
    /// Development cases of 1000 samples without the competitors and the proposed experiments; exit status 1 where one of the first five
    /// targets falls behind its guard
    #[arg(long)]
    quick: bool,
    /// Draw from the development stream, which may be tuned on; docs/proof.md is left alone
    #[arg(long)]
    development: bool,
    /// Only the controls among the cases, where nothing is missing: false alarms in all and for each kind of noise; docs/proof.md is left alone
    #[arg(long, conflicts_with_all = ["quick", "write"])]
    controls: bool,
    /// Of the controls only those under this kind of noise
    #[arg(long, value_name = "KIND", requires = "controls", value_parser = Noise::ALL.map(Noise::name))]
    noise: Option<String>,
    /// Print how often statements of a given probability are right, and write them to statements.csv, for `cargo xtask reliability`
    #[arg(long, requires = "development")]
    reliability: bool,
    /// Only write the bank below this directory: cases/, and labels.json beside it
    #[arg(long, value_name = "DIR")]
    write: Option<PathBuf>,
    /// Run this binary instead of building hysid
    #[arg(long, value_name = "FILE")]
    binary: Option<PathBuf>,
    /// Seconds that a diagnosis on one thread may take [default: 120, a minute on two; 60 with --quick]
    #[arg(long)]
    time_limit: Option<u64>,
    /// Where the page, the score and the labels go
    #[arg(long, value_name = "DIR", default_value = "target/prove")]
    out: PathBuf,
}

/// Cases of `--quick`, and their samples.
const QUICK: usize = 60;
const SHORT: usize = 1000;

/// Processes side by side.
const SIDE_BY_SIDE: usize = 2;

/// Runs the task.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let stream = if args.development || args.quick { Stream::Development } else { Stream::Reporting };
    let count = args.cases.unwrap_or(if args.quick { QUICK } else { 240 });
    ensure!(count > 0, "--cases must be at least 1");
    let range = args.first..args.first + count;
    let longest = args.longest.unwrap_or(usize::MAX);
    let drawn = if args.quick { SHORT } else { usize::MAX };
    if let Some(root) = &args.write {
        let mut cases = bank::cases(stream, args.seed, range, drawn);
        cases.retain(|case| case.label.samples <= longest);
        bank::write(root, &cases)?;
        println!("{} cases written below {}", cases.len(), root.display());
        return Ok(());
    }
    let binary = match &args.binary {
        Some(file) => file.canonicalize().with_context(|| format!("{}", file.display()))?,
        None => build()?,
    };
    let start = Instant::now();
    let root = std::env::temp_dir().join(format!("hysid-prove-{}", std::process::id()));
    let seconds = args.time_limit.unwrap_or(if args.quick { 60 } else { 120 });
    let bench = Bench { binary, root: root.clone(), time_limit: Duration::from_secs(seconds), black_box: !args.quick };
    let bank = Bank {
        stream,
        seed: args.seed,
        range,
        longest,
        drawn,
        deadline: args.minutes.map(|m| start + Duration::from_secs(60 * m)),
    };
    let done =
        if args.controls { controls::run(&bench, &bank, args, start) } else { whole(&bench, &bank, args, start) };
    let _ = std::fs::remove_dir_all(&root);
    done
}

/// Diagnoses and scores every case, beside the competitors.
fn whole(bench: &Bench, bank: &Bank, args: &Args, start: Instant) -> anyhow::Result<()> {
    let rows = bank.each(&|_| true, &|case| {
        let trial = bench.run(case)?;
        let mut row = Row::new(case, trial, rivals::rivals(bench, case, !args.quick));
        row.settled = if args.quick { None } else { bench.experiment(case, &row)? };
        Ok(row)
    })?;
    let score = score::score(&rows);
    let took = start.elapsed().as_secs_f64();
    let command = command(args, if args.minutes.is_some() { rows.len() } else { bank.range.len() });
    let text = page::markdown(&score, &command, took, &rows);
    println!("{text}");
    let out = crate::root().join(&args.out);
    std::fs::create_dir_all(&out)?;
    std::fs::write(out.join("proof.html"), page::html(&score, &command, took, &rows))?;
    std::fs::write(out.join("cases.txt"), page::cases(&rows))?;
    let labels: Vec<_> = rows.iter().map(|r| &r.label).collect();
    std::fs::write(out.join("labels.json"), serde_json::to_string_pretty(&labels)?)?;
    if args.reliability {
        println!("{}", reliability::table(&rows)?);
        std::fs::write(out.join("statements.csv"), reliability::file(&rows))?;
    }
    println!("page, cases and labels: {}", out.display());
    if bank.stream == Stream::Reporting {
        page::record(&crate::root().join("docs/proof.md"), &text, &score, &command, took)?;
    }
    if args.quick {
        guard::check(&score)?;
    }
    Ok(())
}

/// The cases that are run.
struct Bank {
    stream: Stream,
    seed: u64,
    range: Range<usize>,
    /// Cases with more samples are left out.
    longest: usize,
    /// Cases are drawn with no more samples than this.
    drawn: usize,
    /// No case is begun after it, so that what is scored is the beginning of the bank and not a choice of quick cases.
    deadline: Option<Instant>,
}

impl Bank {
    /// Every case whose plan is `wanted`, made and worked on side by side; results in the order of the bank.
    fn each<T: Send>(
        &self,
        wanted: &(dyn Fn(&Wanted) -> bool + Sync),
        work: &(dyn Fn(&Case) -> anyhow::Result<T> + Sync),
    ) -> anyhow::Result<Vec<T>> {
        let next = AtomicUsize::new(self.range.start);
        let worker = || -> anyhow::Result<Vec<(usize, T)>> {
            let mut list = Vec::new();
            loop {
                let i = next.fetch_add(1, Ordering::Relaxed);
                if i >= self.range.end || self.deadline.is_some_and(|d| Instant::now() > d) {
                    return Ok(list);
                }
                if !wanted(&bank::plan(self.stream, self.seed, i)) {
                    continue;
                }
                let case = bank::case_within(self.stream, self.seed, i, self.drawn);
                if case.label.samples > self.longest {
                    continue;
                }
                list.push((i, work(&case)?));
                if (i + 1).is_multiple_of(20) {
                    eprintln!("{} of {}", i + 1 - self.range.start, self.range.len());
                }
            }
        };
        let mut list = std::thread::scope(|scope| -> anyhow::Result<Vec<(usize, T)>> {
            let threads: Vec<_> = (0..SIDE_BY_SIDE).map(|_| scope.spawn(worker)).collect();
            let mut list = Vec::new();
            for thread in threads {
                list.extend(thread.join().map_err(|_| anyhow::anyhow!("a worker panicked"))??);
            }
            Ok(list)
        })?;
        list.sort_by_key(|r| r.0);
        Ok(list.into_iter().map(|r| r.1).collect())
    }
}

/// Builds `hysid` in release mode and returns its path.
pub(crate) fn build() -> anyhow::Result<PathBuf> {
    let status = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
        .args(["build", "--release", "--quiet", "--package", "hysid-cli"])
        .current_dir(crate::root())
        .status()?;
    ensure!(status.success(), "hysid does not build");
    let target = std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| crate::root().join("target"), PathBuf::from);
    Ok(target.join("release/hysid"))
}

fn command(args: &Args, count: usize) -> String {
    let mut text = format!("cargo xtask prove --seed {} --cases {count}", args.seed);
    if let Some(longest) = args.longest {
        text.push_str(&format!(" --longest {longest}"));
    }
    if let Some(noise) = &args.noise {
        text.push_str(&format!(" --noise {noise}"));
    }
    if args.first > 0 {
        text.push_str(&format!(" --first {}", args.first));
    }
    for (flag, on) in [("--quick", args.quick), ("--development", args.development), ("--controls", args.controls)] {
        if on {
            text.push(' ');
            text.push_str(flag);
        }
    }
    text
}

/// The medians and shares of the first five targets.
fn gates(score: &Score) -> impl Iterator<Item = &score::Line> {
    score.lines.iter().filter(|l| l.gate && !l.what.starts_with('-'))
}
