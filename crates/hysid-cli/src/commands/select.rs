//! `hysid select`: terms of a polynomial model from a recording of any size, read once.
//!
//! Unlike `hysid fit` it judges one step ahead only, keeps the sampling rate and holds nothing in memory but sums, so that the file may be
//! larger than memory by far. The terms it finds are a start for a model, not a model that is known to run.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::ValueEnum;
use hysid::stream::{Streamed, for_each_chunk, select_file};
use hysid_dictionary::{Dictionary, Signals, Spec};
use hysid_io::CsvChunks;
use hysid_select::{Criterion, Options, PressForm, Search};
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::{Value, json};

use super::bench::{cpu_seconds, load_average, status};
use super::files::different_signals;
use super::fit::{AutoOr, TIME, terms};
use super::threads::pool;
use crate::failure::Failure;

/// Select the terms of a polynomial model from a recording of any size.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The recording (CSV); it is read once and never held in memory.
    #[arg(long, value_name = "CSV")]
    recording: PathBuf,
    /// The column of an input; may be repeated.
    #[arg(long = "input", value_name = "COLUMN")]
    inputs: Vec<String>,
    /// The column of the output.
    #[arg(long, value_name = "COLUMN")]
    output: String,
    /// Output lags 1 to N are candidates.
    #[arg(long, value_name = "N", default_value_t = 3)]
    lags_output: usize,
    /// Input lags up to N are candidates.
    #[arg(long, value_name = "N", default_value_t = 3)]
    lags_input: usize,
    /// The first input lag: 0 lets the present input u[n] be a candidate, 1 does not.
    #[arg(long, value_name = "0|1", default_value_t = 1)]
    input_delay: usize,
    /// The largest number of factors in a term.
    #[arg(long, value_name = "D", default_value_t = 3)]
    degree: usize,
    /// The number of terms: auto, or N.
    #[arg(long, value_name = "auto|N", default_value = "auto", value_parser = terms)]
    terms: AutoOr,
    /// What decides the number of terms when it is left to the data.
    #[arg(long, value_name = "press|aic|bic|err:X", value_parser = criterion)]
    criterion: Option<Criterion>,
    /// How subsets are looked for: forward only, or with exchanges and terms given back.
    #[arg(long, value_enum, default_value_t = Kind::Floating)]
    search: Kind,
    /// Number of threads; the result does not depend on it.
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
    /// Print one JSON object instead of a table.
    #[arg(long)]
    json: bool,
    /// Add time, memory and load to the JSON object.
    #[arg(long, hide = true, requires = "json")]
    timing: bool,
    /// Read and check the columns only, for comparison.
    #[arg(long, hide = true, requires = "timing")]
    read_only: bool,
}

/// How subsets are looked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Kind {
    Greedy,
    Floating,
}

fn criterion(text: &str) -> Result<Criterion, String> {
    match text {
        "press" => Ok(Criterion::Press(PressForm::Squared)),
        "aic" => Ok(Criterion::Aic),
        "bic" => Ok(Criterion::Bic),
        _ => match text.strip_prefix("err:").map(str::parse) {
            Some(Ok(e)) => Ok(Criterion::ErrTolerance(e)),
            _ => Err("give press, aic, bic or err: with a tolerance, as err:0.001".into()),
        },
    }
}

/// Reads the recording and prints what was selected.
///
/// # Errors
/// Bad options, or the first thing wrong in the file.
pub fn run(args: &Args) -> Result<(), Failure> {
    let pool = pool(args.threads)?;
    if args.input_delay > 1 {
        return Err(Failure::BadInput(format!("--input-delay is {}; it must be 0 or 1", args.input_delay)));
    }
    if args.terms.0 == Some(0) {
        return Err(Failure::BadInput("--terms is 0; it must be auto, or 1 or more".into()));
    }
    let inputs: Vec<&str> = args.inputs.iter().map(String::as_str).collect();
    let signals = inputs.iter().map(|u| ("--input", *u)).chain([("--output", args.output.as_str())]);
    different_signals(&signals.collect::<Vec<_>>())?;
    let signals = Signals::from_columns(&args.output, &inputs).map_err(Failure::bad_input)?;
    let lags = args.input_delay..=args.lags_input;
    let dictionary = Spec::narx(signals, args.lags_output, lags, args.degree).build().map_err(Failure::bad_input)?;
    let search = match args.search {
        Kind::Greedy => Search::Greedy,
        Kind::Floating => Search::Floating,
    };
    let criterion = match args.terms.0 {
        Some(n) => Criterion::Terms(n),
        None => args.criterion.clone().unwrap_or(Criterion::SearchedPress),
    };
    let options = Options { search, criterion, ..Options::default() };
    let header = CsvChunks::open(&args.recording, None, 1).map_err(Failure::bad_input)?.header().to_vec();
    let time = header.iter().any(|h| h == TIME).then_some(TIME);
    let (began, cpu_began) = (Instant::now(), cpu_seconds());
    let timing = |bytes: u64| {
        let wall = began.elapsed().as_secs_f64();
        let cpu = cpu_seconds().zip(cpu_began).map(|(now, then)| now - then);
        json!({
            "wall_s": [wall], "cpu_s": cpu.as_slice(), "loadavg": load_average(), "peak_rss_mib": status("VmHWM:"),
            "megabytes_per_s": bytes as f64 / 1e6 / wall,
        })
    };
    let bar = progress(&args.recording);
    let seen = |bytes: u64| bar.set_position(bytes);
    if args.read_only {
        let mut columns = vec![args.output.as_str()];
        columns.extend(&inputs);
        columns.extend(time);
        let read = pool.install(|| for_each_chunk(&args.recording, &columns, &seen, |_, _| Ok(())));
        let (rows, bytes) = read.map_err(Failure::bad_input)?;
        println!("{}", with_timing(json!({ "rows": rows, "bytes": bytes }), timing(bytes)));
        return Ok(());
    }
    let found = pool.install(|| select_file(&args.recording, time, &dictionary, &options, &seen));
    bar.finish_and_clear();
    let found = found.map_err(Failure::bad_input)?;
    if !args.json {
        table(&dictionary, &found);
    } else if args.timing {
        println!("{}", with_timing(report(&dictionary, &found), timing(found.bytes)));
    } else {
        println!("{}", report(&dictionary, &found));
    }
    for warning in warnings(&dictionary, &found) {
        eprintln!("warning: {warning}");
    }
    Ok(())
}

fn with_timing(mut report: Value, timing: Value) -> Value {
    if let (Some(all), Value::Object(timing)) = (report.as_object_mut(), timing) {
        all.extend(timing);
    }
    report
}

/// A bar on standard error.
fn progress(file: &Path) -> ProgressBar {
    let bar = ProgressBar::new(std::fs::metadata(file).map_or(0, |m| m.len()));
    if let Ok(style) = ProgressStyle::with_template("{bar:40} {bytes} of {total_bytes}, {bytes_per_sec}") {
        bar.set_style(style);
    }
    bar
}

fn report(dictionary: &Dictionary, found: &Streamed) -> Value {
    let s = &found.selection;
    let errors = s.standard_errors();
    let term = |k: usize| {
        json!({
            "term": dictionary.text(s.terms[k]), "theta": s.theta[k], "standard_error": errors[k],
            "err": s.steps[k].err, "sse": s.steps[k].sse, "condition": s.steps[k].condition,
        })
    };
    json!({
        "candidates": dictionary.len(), "distinct_sums": found.distinct_sums,
        "rows": found.rows, "samples": s.samples, "bytes": found.bytes, "period_s": found.period_s,
        "terms": (0..s.terms.len()).map(term).collect::<Vec<_>>(),
        "stop": format!("{:?}", s.stop), "sse": s.sse(), "doubtful_from": s.precision.doubtful_from,
    })
}

fn table(dictionary: &Dictionary, found: &Streamed) {
    let s = &found.selection;
    println!("{:>24}  {:>12}  {:>12}  term", "coefficient", "std. error", "ERR");
    for (k, error) in s.standard_errors().iter().enumerate() {
        println!("{:>24}  {error:>12.3e}  {:>12.4e}  {}", s.theta[k], s.steps[k].err, dictionary.text(s.terms[k]));
    }
    println!(
        "{} of {} candidates, {} samples; one step ahead, {:.4e} of the output's energy is left",
        s.terms.len(),
        dictionary.len(),
        s.samples,
        s.sse()
    );
}

fn warnings(dictionary: &Dictionary, found: &Streamed) -> Vec<String> {
    let s = &found.selection;
    let mut warnings = Vec::new();
    if let Some(k) = s.precision.doubtful_from {
        let term = s.terms.get(k).map_or_else(String::new, |&j| format!(" ({})", dictionary.text(j)));
        warnings.push(format!("from term {}{term} on rounding may have decided the choice", k + 1));
    }
    let condition = s.steps.last().map_or(1.0, |step| step.condition);
    if condition > 1e4 {
        warnings.push(format!(
            "the chosen terms are nearly dependent (condition {condition:.1e}); coefficients from inner products hold about {:.0} digits",
            (15.0 - 2.0 * condition.log10()).max(0.0)
        ));
    }
    warnings
}
