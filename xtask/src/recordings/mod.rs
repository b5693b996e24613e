//! `cargo xtask recordings`: identifies every public recording set with defaults and prints what the free run is worth; then what
//! `hysid diagnose` says of the baseline of each.
//!
//! Each set is used by its own split into estimation and validation; a run sees no validation data and has no setting for a set.
//! (What the recipe's rules owe to these figures is told in `docs/recordings.md`.) Beside ours stands the linear model that is identified and refined the same way, and the figure that the
//! set's `meta.json` quotes. Without the recordings the task says so and succeeds, unless `HYSID_REQUIRE_RECORDINGS=1`.

mod diagnosis;
mod page;
mod sets;
mod untouched;

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::Context;
use hysid::identify::{Columns, Identified, Options, Source, identify};
use hysid_io::{ReadOptions, TimeSource, read_recording};
use hysid_narx::NarxModel;
use hysid_signal::Recording;

use sets::{SETS, Set, Validation};

/// Identify the public recordings and compare free runs.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The folder of the recording sets.
    #[arg(long, default_value = "../shared/recordings")]
    dir: PathBuf,
    /// Only sets whose name contains this; the page is then not written.
    #[arg(long)]
    only: Option<String>,
    /// The check on data that nobody had looked at while the recipe was made.
    #[arg(long)]
    untouched: bool,
    /// The folder of their baseline simulations.
    #[arg(long, default_value = "../shared/simulations")]
    simulations: PathBuf,
    /// Only the diagnosis of the baselines, not the identification.
    #[arg(long, conflicts_with_all = ["untouched", "halves"])]
    diagnosis: bool,
    /// A recording (CSV) with columns `u` and `y`: identified on its first half, run on its second.
    #[arg(long)]
    halves: Option<PathBuf>,
}

/// One line of the table: one validation recording of one set.
pub(crate) struct Line {
    set: String,
    file: String,
    unit: &'static str,
    ours: f64,
    linear: f64,
    std: f64,
    terms: usize,
    rate: usize,
    seconds: f64,
    diverged: Option<usize>,
    target: Option<f64>,
    published: String,
    equation: String,
}

/// Runs the sets, prints the table, writes the page.
pub fn run(args: &Args) -> anyhow::Result<()> {
    if let Some(file) = &args.halves {
        return halves(file);
    }
    let page = crate::root().join("docs/recordings.md");
    if args.untouched {
        let lines = untouched::lines(&args.dir)?;
        return page::write(&page, page::UNTOUCHED, &page::table(&lines));
    }
    if !args.dir.is_dir() {
        let required = std::env::var_os("HYSID_REQUIRE_RECORDINGS").is_some_and(|v| v == "1");
        anyhow::ensure!(!required, "{}: there are no recordings, and HYSID_REQUIRE_RECORDINGS=1", args.dir.display());
        println!("skipped: no recordings at {}", args.dir.display());
        return Ok(());
    }
    if !args.diagnosis {
        identified(args, &page)?;
    }
    let table = diagnosis::table(&args.dir, &args.simulations, args.only.as_deref())?;
    println!("\n{table}");
    if args.only.is_none() {
        page::write(&page, page::DIAGNOSED, &table)?;
    }
    Ok(())
}

/// The table of identified models, printed and written to the page.
fn identified(args: &Args, page: &Path) -> anyhow::Result<()> {
    let mut lines = Vec::new();
    for set in SETS.iter().filter(|s| args.only.as_ref().is_none_or(|o| s.name.contains(o.as_str()))) {
        eprintln!("{}", set.name);
        let new = one(&args.dir, set.name, set).with_context(|| set.name)?;
        for line in &new {
            println!("{}", page::row(line));
        }
        lines.extend(new);
    }
    println!("\n{}", page::table(&lines));
    if args.only.is_none() {
        page::write(page, page::FIT, &page::with_models(&lines)?)?;
    }
    Ok(())
}

fn read(path: &Path, set: &Set) -> anyhow::Result<Recording> {
    let columns: Vec<&str> = set.inputs.iter().copied().chain([set.output]).collect();
    let time = TimeSource::ColumnOrPeriod("t_s".into(), 1.0);
    let columns = Some(columns.iter().map(|c| (*c).to_string()).collect());
    Ok(read_recording(path, &ReadOptions { time, columns })?)
}

fn one(dir: &Path, folder: &str, set: &'static Set) -> anyhow::Result<Vec<Line>> {
    let folder = dir.join(folder);
    let meta: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(folder.join("meta.json"))?)?;
    let part = |r: Recording, share: (f64, f64)| {
        let n = r.len() as f64;
        r.slice((share.0 * n) as usize..(share.1 * n) as usize)
    };
    let estimation: Vec<Recording> = set
        .estimation
        .iter()
        .map(|f| Ok(part(read(&folder.join(f), set)?, set.estimation_share)))
        .collect::<anyhow::Result<_>>()?;
    let (found, seconds) = timed(&estimation, set)?;
    let mut lines = Vec::new();
    for v in set.validation {
        lines.push(validated(&folder, set, v, &found, seconds, &meta)?);
    }
    Ok(lines)
}

fn timed(estimation: &[Recording], set: &Set) -> anyhow::Result<(Identified, f64)> {
    let inputs: Vec<String> = set.inputs.iter().map(|s| (*s).to_string()).collect();
    let start = Instant::now();
    let source = Source { recordings: estimation, inputs: &inputs, output: set.output };
    let found = identify(source, &Options::default(), &|what| eprintln!("  {what}"))?;
    Ok((found, start.elapsed().as_secs_f64()))
}

fn validated(
    folder: &Path,
    set: &'static Set,
    v: &'static Validation,
    found: &Identified,
    seconds: f64,
    meta: &serde_json::Value,
) -> anyhow::Result<Line> {
    let mut scores = Scores::default();
    for file in v.files {
        let recording = read(&folder.join(file), set)?;
        let n = recording.len() as f64;
        let recording = recording.slice((v.share.0 * n) as usize..(v.share.1 * n) as usize);
        scores.add(&found.model, &found.linear, &recording, set.start)?;
    }
    let published = meta.pointer(v.published).map_or("-".to_string(), |p| match p {
        serde_json::Value::String(s) => s.clone(),
        other => other.to_string(),
    });
    let line = line(set.name, v.name, set.unit, set.scale, &scores, found, seconds);
    Ok(Line { target: v.target, published, ..line })
}

/// A line without a target but to beat the linear model.
fn line(
    set: &str,
    file: &str,
    unit: &'static str,
    scale: f64,
    scores: &Scores,
    found: &Identified,
    seconds: f64,
) -> Line {
    let (ours, linear, std) = scores.rms();
    Line {
        set: set.to_owned(),
        file: file.to_owned(),
        unit,
        ours: ours * scale,
        linear: linear * scale,
        std: std * scale,
        terms: found.model.terms().len(),
        rate: found.model.parts().decimation,
        seconds,
        diverged: scores.diverged,
        target: None,
        published: "-".to_owned(),
        equation: found.model.equation(),
    }
}

/// Sums of squares over the samples that both models predict.
#[derive(Default)]
struct Scores {
    ours: f64,
    linear: f64,
    y: f64,
    y2: f64,
    samples: usize,
    diverged: Option<usize>,
    linear_diverged: Option<usize>,
}

impl Scores {
    fn add(&mut self, model: &NarxModel, linear: &NarxModel, r: &Recording, start: usize) -> anyhow::Result<()> {
        let columns = Columns::of(model, r)?;
        let (a, b) = (model.free_run(&columns.record())?, linear.free_run(&columns.record())?);
        self.diverged = self.diverged.or(a.diverged_at);
        self.linear_diverged = self.linear_diverged.or(b.diverged_at);
        // From the first sample that both predict and that is no longer part of the start.
        let both = a.y.iter().zip(&b.y).position(|(a, b)| a.is_finite() && b.is_finite()).unwrap_or(r.len());
        for n in both.max(start)..r.len() {
            let y = columns.y[n];
            self.ours += (y - a.y[n]).powi(2);
            self.linear += (y - b.y[n]).powi(2);
            self.y += y;
            self.y2 += y * y;
            self.samples += 1;
        }
        Ok(())
    }

    /// Ours, the linear model's, and the standard deviation; infinite after a divergence.
    fn rms(&self) -> (f64, f64, f64) {
        let n = self.samples.max(1) as f64;
        let or = |diverged: Option<usize>, x: f64| if diverged.is_some() { f64::INFINITY } else { (x / n).sqrt() };
        let variance = (self.y2 / n - (self.y / n).powi(2)).max(0.0);
        (or(self.diverged, self.ours), or(self.linear_diverged, self.linear), variance.sqrt())
    }
}

fn halves(file: &Path) -> anyhow::Result<()> {
    let set = &sets::HALVES;
    let whole = read(file, set)?;
    let half = whole.len() / 2;
    let (found, seconds) = timed(&[whole.slice(0..half)], set)?;
    let mut scores = Scores::default();
    scores.add(&found.model, &found.linear, &whole.slice(half..whole.len()), 0)?;
    let (ours, linear, std) = scores.rms();
    println!(
        "{}: relative error of the free run on the second half {:.5} with {} terms (linear {:.5}), {seconds:.1} s",
        file.display(),
        ours / std,
        found.model.terms().len(),
        linear / std
    );
    Ok(())
}
