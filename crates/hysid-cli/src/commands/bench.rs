//! `hysid bench`: times term selection on one recording and prints one JSON object, for comparison with other tools.
//!
//! Timed is what is timed of the others: dictionary, selection and least squares from arrays in memory, without reading the
//! file. CPU time comes from the process clock, peak memory and load from `/proc`; they are null where there is none.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::ValueEnum;
use hysid_dictionary::{Design, Model, Quantity, Record, Signal, Signals, Spec, Term};
use hysid_select::{Criterion, Options, PressForm, Search, Selection, select};
use serde_json::{Value, json};

use crate::failure::Failure;

/// Time term selection on one recording; prints one JSON object.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A `.npy` array or a `.csv` file with the columns u and y, in this order.
    #[arg(long)]
    data: PathBuf,
    /// Use the first N samples (0: all).
    #[arg(long, default_value_t = 0)]
    n: usize,
    /// Largest output lag.
    #[arg(long, default_value_t = 3)]
    ny: usize,
    /// Largest input lag; the smallest is 1, with `--u0` 0.
    #[arg(long, default_value_t = 3)]
    nu: usize,
    /// Degree of the polynomial.
    #[arg(long, default_value_t = 3)]
    degree: usize,
    /// Number of terms (with `--search press`: the largest number).
    #[arg(long, default_value_t = 11)]
    terms: usize,
    /// Let u[n] in.
    #[arg(long)]
    u0: bool,
    /// Repetitions.
    #[arg(long, default_value_t = 1)]
    reps: usize,
    /// Number of threads (0: what the machine has, or RAYON_NUM_THREADS).
    #[arg(long, default_value_t = 0)]
    threads: usize,
    /// Also time a free run over this many samples (0: no).
    #[arg(long, default_value_t = 0)]
    freerun: usize,
    /// What is timed.
    #[arg(long, value_enum, default_value_t = Kind::Greedy)]
    search: Kind,
}

/// What is timed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Kind {
    /// Forward regression to the number of terms.
    Greedy,
    /// Forward regression stopped by PRESS.
    Press,
    /// A beam of ten.
    Beam,
    /// The default: local search over all sizes, PRESS decides.
    Default,
}

impl Kind {
    fn options(self, terms: usize) -> Options {
        let press = Criterion::Press(PressForm::Exact);
        let base = Options::default();
        match self {
            Self::Greedy => Options { search: Search::Greedy, criterion: Criterion::Terms(terms), ..base },
            Self::Press => Options { search: Search::Greedy, criterion: press, max_terms: terms, ..base },
            Self::Beam => Options { search: Search::Beam { width: 10 }, criterion: Criterion::Terms(terms), ..base },
            Self::Default => base,
        }
    }
}

/// Runs the command.
///
/// # Errors
/// A file that cannot be read; settings out of range.
pub fn run(args: &Args) -> Result<(), Failure> {
    let (mut u, mut y) = load(&args.data)?;
    if args.n > 0 {
        u.truncate(args.n);
        y.truncate(args.n);
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(args.threads).build().map_err(anyhow::Error::from)?;
    let report = pool.install(|| measure(args, &u, &y))?;
    println!("{report}");
    Ok(())
}

fn load(path: &Path) -> Result<(Vec<f64>, Vec<f64>), Failure> {
    let mut columns = if path.extension().is_some_and(|e| e == "npy") {
        hysid_io::read_npy(path).map_err(Failure::bad_input)?.columns
    } else {
        let recording =
            hysid_io::read_recording(path, &hysid_io::ReadOptions::default()).map_err(Failure::bad_input)?;
        recording.channels().iter().map(|c| c.samples.clone()).collect()
    };
    if columns.len() < 2 {
        return Err(Failure::BadInput(format!("{}: {} columns; u and y are needed", path.display(), columns.len())));
    }
    let y = columns.swap_remove(1);
    Ok((columns.swap_remove(0), y))
}

fn measure(args: &Args, u: &[f64], y: &[f64]) -> Result<Value, Failure> {
    let base_rss = status("VmRSS:");
    let (mut wall, mut cpu) = (Vec::new(), Vec::new());
    let mut last = None;
    for _ in 0..args.reps.max(1) {
        let (began, cpu_began) = (Instant::now(), cpu_seconds());
        let found = once(args, u, y)?;
        wall.push(began.elapsed().as_secs_f64());
        cpu.extend(cpu_seconds().zip(cpu_began).map(|(now, then)| now - then));
        last = Some(found);
    }
    let Some((candidates, selection, terms)) = last else { return Ok(Value::Null) };
    let names: Vec<String> = terms.iter().map(name).collect();
    let truth = truth_beside(&args.data);
    let hits = truth.as_ref().map(|t| names.iter().filter(|n| *n != "1" && t.contains(n)).count());
    let mut report = json!({
        "tool": "hysid", "version": env!("CARGO_PKG_VERSION"), "variant": format!("{:?}", args.search).to_lowercase(),
        "n": y.len(), "ny": args.ny, "nu": args.nu, "degree": args.degree, "u0": args.u0, "terms": args.terms,
        "candidates": candidates,
        "wall_s": wall, "wall_median_s": hysid_signal::median(wall.clone()), "wall_min_s": least(&wall),
        "cpu_s": cpu, "cpu_median_s": hysid_signal::median(cpu.clone()), "loadavg": load_average(),
        "threads": rayon::current_num_threads(),
        "peak_rss_mib": status("VmHWM:"), "base_rss_mib": base_rss,
        "selected": names, "coefs": selection.theta,
        "stop": format!("{:?}", selection.stop), "sse": selection.sse(),
        "doubtful_from": selection.precision.doubtful_from,
    });
    if let (Some(hits), Some(truth)) = (hits, truth) {
        report["true_terms_found"] = json!(hits);
        report["true_terms"] = json!(truth.iter().filter(|t| *t != "1").count());
    }
    if args.freerun > 0 {
        report["freerun_samples_per_s"] = json!(free_run(args, u, y, terms, &selection)?);
    }
    Ok(report)
}

fn once(args: &Args, u: &[f64], y: &[f64]) -> Result<(usize, Selection, Vec<Term>), Failure> {
    let lags = usize::from(!args.u0)..=args.nu;
    let dictionary = Spec::narx(Signals::siso(), args.ny, lags, args.degree).build().map_err(Failure::bad_input)?;
    let design = hysid_dictionary::Design::new(&dictionary, &[Record::siso(u, y)]).map_err(Failure::bad_input)?;
    let selection = pick(&design, args)?;
    let terms = selection.terms.iter().map(|&j| dictionary.terms()[j].clone()).collect();
    Ok((dictionary.len(), selection, terms))
}

fn pick(design: &Design<'_>, args: &Args) -> Result<Selection, Failure> {
    select(design, &design.target(), &args.search.options(args.terms)).map_err(Failure::bad_input)
}

/// Samples per second of the model's free run on its own input.
fn free_run(args: &Args, u: &[f64], y: &[f64], terms: Vec<Term>, selection: &Selection) -> Result<f64, Failure> {
    let model = Model::new(Signals::siso(), terms, selection.theta.clone()).map_err(Failure::bad_input)?;
    let n = args.freerun.min(y.len());
    let start = &y[..model.reach().min(n)];
    let mut rates = Vec::new();
    for _ in 0..5 {
        let began = Instant::now();
        let run = model.free_run(&[&u[..n]], start, n, 1e6).map_err(Failure::bad_input)?;
        rates.push(run.diverged_at.unwrap_or(n) as f64 / began.elapsed().as_secs_f64());
    }
    Ok(hysid_signal::median(rates))
}

/// The term as the comparison writes it: `u[k-1]*y[k-2]`, input before output, powers written out.
fn name(term: &Term) -> String {
    let factor = |f: &hysid_dictionary::Factor| {
        let signal = if f.quantity == Quantity::Value(Signal::Output) { "y" } else { "u" };
        (signal, f.lag)
    };
    let mut factors: Vec<(&str, usize)> = term.factors().iter().map(factor).collect();
    factors.sort();
    match factors.is_empty() {
        true => "1".into(),
        false => factors.iter().map(|(s, l)| format!("{s}[k-{l}]")).collect::<Vec<_>>().join("*"),
    }
}

/// The terms of the system that made the data, from the `.json` file beside it.
fn truth_beside(data: &Path) -> Option<Vec<String>> {
    let text = std::fs::read_to_string(data.with_extension("json")).ok()?;
    let value: Value = serde_json::from_str(&text).ok()?;
    Some(value.get("truth")?.as_object()?.keys().cloned().collect())
}

fn least(values: &[f64]) -> f64 {
    values.iter().copied().fold(f64::INFINITY, f64::min)
}

/// CPU time of all threads of this process, in seconds.
#[cfg(unix)]
pub(crate) fn cpu_seconds() -> Option<f64> {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    Some(now.tv_sec as f64 + now.tv_nsec as f64 * 1e-9)
}

/// No CPU clock here.
#[cfg(not(unix))]
pub(crate) fn cpu_seconds() -> Option<f64> {
    None
}

/// A line of `/proc/self/status`, in MiB.
pub(crate) fn status(key: &str) -> Option<f64> {
    let text = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = text.lines().find_map(|l| l.strip_prefix(key))?;
    Some(line.split_whitespace().next()?.parse::<f64>().ok()? / 1024.0)
}

pub(crate) fn load_average() -> Option<f64> {
    std::fs::read_to_string("/proc/loadavg").ok()?.split_whitespace().next()?.parse().ok()
}
