//! `hysid decimate`: the table of sampling-rate reductions of a recording, and which one to take.

use std::path::PathBuf;

use clap::{Args as ClapArgs, ValueEnum};
use hysid_decimate::{DecimateError, Decimator, FactorRow, Phase, Recommendation, examine, recommend, reduce};
use hysid_io::{ReadOptions, check_writable, read_recording, require, write_recording};
use serde_json::{Value, json};

use super::files::{clock_or_period, keep_inputs};
use crate::failure::Failure;

/// The table of sampling-rate reductions of a recording, and which factor to take.
#[derive(Debug, ClapArgs)]
pub struct Args {
    /// The recording (CSV with a time column `t_s`).
    recording: PathBuf,
    /// The input's column; may be repeated.
    #[arg(long)]
    input: Vec<String>,
    /// The output's column.
    #[arg(long)]
    output: String,
    /// The sampling period in seconds of a recording without a time column.
    #[arg(long)]
    period_s: Option<f64>,
    /// How samples are kept.
    #[arg(long, value_enum, default_value_t = Method::Plain)]
    method: Method,
    /// Which samples are kept: 0, L, ... (first) or L-1, 2L-1, ... (lth, as in the paper) or up to the last (last, as MATLAB does).
    #[arg(long, value_enum, default_value_t = Kept::First)]
    phase: Kept,
    /// The largest factor of the table.
    #[arg(long, default_value_t = 40, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    largest: u32,
    /// MRD must be above and MRE below 1 - alpha.
    #[arg(long, default_value_t = 0.95)]
    alpha: f64,
    /// Write the recording reduced by this factor (`--out`).
    #[arg(long, requires = "out")]
    factor: Option<u32>,
    /// Where the reduced recording goes (CSV); without `--factor` the recommended factor is taken.
    #[arg(long)]
    out: Option<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Samples of a recording that other commands read again: one has no sampling period.
const FEWEST_WRITTEN: usize = 2;

/// A decimator's name on the command line.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum Method {
    /// Every L-th sample as it is.
    Plain,
    /// Chebyshev I of order 8, forward and backward.
    Chebyshev,
    /// Kaiser FIR without delay.
    Kaiser,
}

/// A phase's name on the command line.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum Kept {
    /// 0, L, 2L, ...
    First,
    /// L-1, 2L-1, ...
    Lth,
    /// Up to the last sample.
    Last,
}

/// Runs the command.
pub fn run(args: &Args) -> Result<(), Failure> {
    if !(args.alpha > 0.0 && args.alpha < 1.0) {
        return Err(Failure::BadInput(format!("--alpha is {}; it must lie between 0 and 1", args.alpha)));
    }
    if let Some(out) = &args.out {
        keep_inputs(out, &[], [&args.recording])?;
        check_writable(out).map_err(Failure::bad_input)?;
    }
    let decimator = match args.method {
        Method::Plain => Decimator::Plain,
        Method::Chebyshev => Decimator::Chebyshev,
        Method::Kaiser => Decimator::Kaiser,
    };
    let phase = match args.phase {
        Kept::First => Phase::First,
        Kept::Lth => Phase::Lth,
        Kept::Last => Phase::LastKept,
    };
    let mut columns: Vec<String> = args.input.clone();
    columns.push(args.output.clone());
    let time = clock_or_period(&args.recording, args.period_s)?;
    let recording =
        read_recording(&args.recording, &ReadOptions { time, columns: Some(columns) }).map_err(Failure::bad_input)?;
    require::varying(&args.recording, &recording, &args.output).map_err(Failure::bad_input)?;
    let inputs: Vec<&str> = args.input.iter().map(String::as_str).collect();
    let refused = |e: DecimateError| Failure::BadInput(format!("{}: {e}", args.recording.display()));
    let rows = examine(&recording, &args.output, &inputs, decimator, phase, args.largest as usize).map_err(refused)?;
    let advice = recommend(&rows, args.alpha);
    if let Some(out) = &args.out {
        let factor = args.factor.map_or(advice.factor, |f| f as usize);
        let names: Vec<&str> = inputs.iter().copied().chain([args.output.as_str()]).collect();
        let reduced = reduce(&recording, &names, factor, decimator, phase).map_err(refused)?;
        let (samples, left) = reduced.samples;
        if left < FEWEST_WRITTEN {
            let needed = FEWEST_WRITTEN;
            return Err(refused(DecimateError::TooFewSamples { samples, factor, left, needed }));
        }
        write_recording(out, &reduced.recording).map_err(Failure::bad_input)?;
    }
    if args.json {
        let text = serde_json::to_string_pretty(&as_json(&rows, &advice, decimator)).map_err(anyhow::Error::from)?;
        println!("{text}");
    } else {
        print!("{}", as_text(&rows, &advice, decimator, args.alpha));
    }
    Ok(())
}

fn as_text(rows: &[FactorRow], advice: &Recommendation, decimator: Decimator, alpha: f64) -> String {
    let percent = |x: f64| {
        if x.is_nan() {
            "-".to_owned()
        } else if x.is_infinite() {
            "inf".to_owned()
        } else {
            format!("{:.2}", 100.0 * x)
        }
    };
    let mut text = format!("Decimator: {}; group delay 0\n\n", decimator.label());
    text += "   L  samples   lost   MRD %  MRE %   MRD' %  MRE' %   above Nyquist %  aliased %\n";
    for r in rows {
        let mark = if r.factor == advice.factor { '*' } else { ' ' };
        text += &format!(
            "{mark}{:>3} {:>8} {:>6} {:>7} {:>6} {:>8} {:>7} {:>17} {:>10}\n",
            r.factor,
            r.samples,
            r.lost,
            percent(r.mrd.as_printed),
            percent(r.mre.as_printed),
            percent(r.mrd.robust),
            percent(r.mre.robust),
            percent(r.above_nyquist),
            percent(r.aliased),
        );
    }
    let bound = 100.0 * (1.0 - alpha);
    text += &format!(
        "\nMRD, MRE: equations (19) and (21) of Zhang, Zhu and Gu (2017) as printed there (inf where the output is 0); MRD', MRE': in a form that survives y = 0.\n\
         Admissible (MRD above {bound:.0} %, MRE below {bound:.0} %): as printed {}; in the robust form {}.\n\n\
         Recommended: L = {}. {}\n",
        list(&advice.admissible_as_printed),
        list(&advice.admissible),
        advice.factor,
        advice.reason
    );
    text
}

/// `3 to 7, 9`, or `none`.
fn list(factors: &[usize]) -> String {
    let mut runs: Vec<(usize, usize)> = Vec::new();
    for &f in factors {
        match runs.last_mut() {
            Some(run) if run.1 + 1 == f => run.1 = f,
            _ => runs.push((f, f)),
        }
    }
    if runs.is_empty() {
        return "none".to_owned();
    }
    let text = |&(a, b): &(usize, usize)| if a == b { a.to_string() } else { format!("{a} to {b}") };
    runs.iter().map(text).collect::<Vec<_>>().join(", ")
}

fn as_json(rows: &[FactorRow], advice: &Recommendation, decimator: Decimator) -> Value {
    let rows: Vec<Value> = rows
        .iter()
        .map(|r| {
            json!({
                "factor": r.factor, "samples": r.samples, "lost": r.lost, "group_delay": r.group_delay,
                "mrd_as_printed": r.mrd.as_printed, "mre_as_printed": r.mre.as_printed,
                "mrd": r.mrd.robust, "mre": r.mre.robust,
                "above_nyquist": r.above_nyquist, "aliased": r.aliased,
            })
        })
        .collect();
    json!({
        "decimator": decimator.label(),
        "recommended": advice.factor,
        "reason": advice.reason,
        "admissible": advice.admissible,
        "admissible_as_printed": advice.admissible_as_printed,
        "factors": rows,
    })
}
