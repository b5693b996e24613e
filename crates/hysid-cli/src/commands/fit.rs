//! `hysid fit`: from recordings a compact model that free-runs.

use std::path::{Path, PathBuf};
use std::time::Duration;

use hysid::identify::{Criterion, Decimate, Factors, FitReport, IdentifyError, Options, Source, every, identify};
use hysid_io::{CsvChunks, ReadOptions, TimeSource, read_recording, require};
use hysid_signal::Recording;
use hysid_signal::tell::counted;
use indicatif::{ProgressBar, ProgressStyle};

use super::files::{Intake, different_signals, keep_inputs, no_file_twice};
use super::folder::Folder;
use super::threads::pool;
use crate::failure::Failure;

/// Identify a model from recordings.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A recording to learn from (CSV); may be repeated.
    #[arg(long = "recording", value_name = "CSV", required = true)]
    recordings: Vec<PathBuf>,
    /// The column of an input; may be repeated.
    #[arg(long = "input", value_name = "COLUMN", required = true)]
    inputs: Vec<String>,
    /// The column of the output.
    #[arg(long, value_name = "COLUMN")]
    output: String,
    /// A recording that is only used to judge the model (CSV); may be repeated.
    #[arg(long = "holdout", value_name = "CSV")]
    holdouts: Vec<PathBuf>,
    /// The folder for model.json, fit.json and report.html.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Output lags 1 to N are candidates.
    #[arg(long, value_name = "N")]
    lags_output: Option<usize>,
    /// Input lags up to N are candidates.
    #[arg(long, value_name = "N")]
    lags_input: Option<usize>,
    /// The first input lag: 0 lets the present input u[n] be a candidate, 1 does not.
    #[arg(long, value_name = "0|1")]
    input_delay: Option<usize>,
    /// The largest number of factors in a term.
    #[arg(long, value_name = "D")]
    degree: Option<usize>,
    /// Sampling-rate reduction: auto, none, or a factor.
    #[arg(long, value_name = "auto|none|L", default_value = "auto", value_parser = decimate)]
    decimate: Decimate,
    /// What terms are made of.
    #[arg(long, value_name = "polynomial|hysteresis|auto", default_value = "auto", value_parser = factors)]
    factors: Factors,
    /// The number of terms: auto, or N.
    #[arg(long, value_name = "auto|N", default_value = "auto", value_parser = terms)]
    terms: AutoOr,
    /// What decides the number of terms one step ahead; without it the free run on held-out blocks does.
    #[arg(long, value_name = "press|aic|bic|err:X", value_parser = criterion)]
    criterion: Option<Criterion>,
    /// Number of threads; the result does not depend on it.
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
    /// Seed of whatever is random.
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
    /// Print fit.json on standard output instead of a summary.
    #[arg(long)]
    json: bool,
}

/// A number, or left to the data.
#[derive(Debug, Clone, Copy)]
pub(crate) struct AutoOr(pub(crate) Option<usize>);

fn decimate(text: &str) -> Result<Decimate, String> {
    match text {
        "auto" => Ok(Decimate::Auto),
        "none" => Ok(Decimate::None),
        _ => text.parse().map(Decimate::By).map_err(|_| "give auto, none or a whole number".into()),
    }
}

fn factors(text: &str) -> Result<Factors, String> {
    match text {
        "auto" => Ok(Factors::Auto),
        "polynomial" => Ok(Factors::Polynomial),
        "hysteresis" => Ok(Factors::Hysteresis),
        _ => Err("give polynomial, hysteresis or auto".into()),
    }
}

pub(crate) fn terms(text: &str) -> Result<AutoOr, String> {
    match text {
        "auto" => Ok(AutoOr(None)),
        _ => text.parse().map(|n| AutoOr(Some(n))).map_err(|_| "give auto or a whole number".into()),
    }
}

fn criterion(text: &str) -> Result<Criterion, String> {
    match text {
        "press" => Ok(Criterion::Press),
        "aic" => Ok(Criterion::Aic),
        "bic" => Ok(Criterion::Bic),
        _ => match text.strip_prefix("err:").map(str::parse) {
            Some(Ok(e)) => Ok(Criterion::Err(e)),
            _ => Err("give press, aic, bic or err: with a tolerance, as err:0.001".into()),
        },
    }
}

/// The clock's column where the file has it.
pub(crate) const TIME: &str = "t_s";

/// The files that go into the folder.
const MODEL: &str = "model.json";
const SUMMARY: &str = "fit.json";
const PAGE: &str = "report.html";
const NAMES: [&str; 3] = [MODEL, SUMMARY, PAGE];

/// Samples without which no recording can teach even a linear model and hold some back to judge it, nor judge one.
const FEWEST_SAMPLES: usize = 20;

/// The sampling period in seconds of a recording that does not tell one.
pub(crate) const WITHOUT_CLOCK: f64 = 1.0;

/// Reads the named columns of a recording; `period_s` is its sampling period where it has no time column.
pub(crate) fn read(path: &Path, columns: &[&str], period_s: f64) -> Result<Recording, Failure> {
    let time = TimeSource::ColumnOrPeriod(TIME.into(), period_s);
    let options = ReadOptions { time, columns: Some(columns.iter().map(|c| (*c).to_string()).collect()) };
    read_recording(path, &options).map_err(Failure::bad_input)
}

/// Whether the file has a time column.
pub(crate) fn has_clock(path: &Path) -> Result<bool, Failure> {
    let file = CsvChunks::open(path, None, 1).map_err(Failure::bad_input)?;
    Ok(file.header().iter().any(|h| h == TIME))
}

/// Reads, checks, identifies, writes.
pub fn run(args: &Args) -> Result<(), Failure> {
    let options = Options {
        lags_output: args.lags_output,
        lags_input: args.lags_input,
        input_delay: args.input_delay,
        degree: args.degree,
        decimate: args.decimate,
        factors: args.factors,
        terms: args.terms.0,
        criterion: args.criterion.unwrap_or_default(),
        seed: args.seed,
    };
    if let Some(problem) = options.problem() {
        return Err(Failure::BadInput(problem));
    }
    let pool = pool(args.threads)?;
    keep_inputs(&args.out, &NAMES, args.recordings.iter().chain(&args.holdouts))?;
    no_file_twice(&args.recordings, &args.holdouts)?;
    let signals: Vec<(&str, &str)> =
        args.inputs.iter().map(|u| ("--input", u.as_str())).chain([("--output", args.output.as_str())]).collect();
    different_signals(&signals)?;
    let columns: Vec<&str> = signals.iter().map(|s| s.1).collect();
    let read_all =
        |paths: &[PathBuf], period: f64| paths.iter().map(|p| read(p, &columns, period)).collect::<Result<Vec<_>, _>>();
    let estimation = read_all(&args.recordings, WITHOUT_CLOCK)?;
    // A hold-out without a clock is taken at the rate of what was learnt from.
    let rate = estimation.first().map_or(WITHOUT_CLOCK, |r| r.clock().period_s);
    let holdout = read_all(&args.holdouts, rate)?;
    let intake = Intake::new((&args.recordings, estimation), (&args.holdouts, holdout))?;
    let (estimation, holdout) = (&intake.estimation, &intake.holdout);
    for (file, recording) in args.recordings.iter().zip(estimation).chain(args.holdouts.iter().zip(holdout)) {
        require::varying(file, recording, &args.output).map_err(Failure::bad_input)?;
        require::samples(file, recording, &columns, FEWEST_SAMPLES).map_err(Failure::bad_input)?;
    }
    let folder = Folder::claim(&args.out, &NAMES)?;
    let bar = progress();
    let source = Source { recordings: estimation, inputs: &args.inputs, output: &args.output };
    let found = pool.install(|| identify(source, &options, &|what| bar.set_message(what.to_string())));
    bar.finish_and_clear();
    let mut found = found.map_err(|e| told(&args.recordings, &e))?;
    if !has_clock(&args.recordings[0])? {
        found.model = found.model.without_clock();
    }
    let report = FitReport::new(&found, estimation, holdout, args.seed).map_err(|e| told(&args.recordings, &e))?;
    found.model.save(&args.out.join(MODEL)).map_err(anyhow::Error::from)?;
    folder.json(SUMMARY, &report.summary)?;
    folder.text(PAGE, &hysid_report::fit::page(&report, &crate::provenance()))?;
    if args.json {
        let text = serde_json::to_string_pretty(&report.summary).map_err(|e| Failure::Internal(e.into()))?;
        println!("{text}");
    } else {
        summary(&report);
    }
    for warning in &report.summary.warnings {
        eprintln!("warning: {warning}");
    }
    Ok(())
}

/// What an identification says is wrong, with the recordings that it is wrong in; options were judged before.
fn told(recordings: &[PathBuf], error: &IdentifyError) -> Failure {
    if matches!(error, IdentifyError::MissingColumn { .. }) {
        return Failure::bad_input(error);
    }
    let names: Vec<String> = recordings.iter().map(|p| p.display().to_string()).collect();
    Failure::BadInput(format!("{}: {error}", names.join(", ")))
}

/// A spinner on standard error that shows itself after a second.
fn progress() -> ProgressBar {
    let bar = ProgressBar::new_spinner();
    bar.set_style(ProgressStyle::default_spinner());
    bar.enable_steady_tick(Duration::from_secs(1));
    bar
}

fn summary(report: &FitReport) {
    let s = &report.summary;
    println!("{}", s.equation);
    for d in &s.derived {
        println!("  where {d}");
    }
    println!(
        "{}, {}, output lags to {}, input lags {} to {}",
        counted(s.terms.len(), "term"),
        every(s.decimation),
        s.lags.output,
        s.lags.input_delay,
        s.lags.input
    );
    for ((free, one), linear) in s.free_run.iter().zip(&s.one_step).zip(&s.linear_free_run) {
        let number = |x: Option<f64>| x.map_or("-".to_string(), |v| format!("{v:.4e}"));
        let percent = |x: Option<f64>| x.map_or(String::new(), |v| format!(" ({:.2} % of std)", 100.0 * v));
        let role = if free.role == hysid::identify::Role::Holdout { "hold-out" } else { "estimation" };
        let diverged = free.diverged_at.map_or(String::new(), |n| format!("; DIVERGED at sample {n}"));
        println!(
            "{role} {}: free run {}{}{diverged}; one step {}; linear free run {}",
            free.recording,
            number(free.rmse),
            percent(free.relative),
            number(one.rmse),
            number(linear.rmse)
        );
    }
}
