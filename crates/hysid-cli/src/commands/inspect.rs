//! `hysid inspect`: what is in a recording, before anything is fitted to it.

use std::path::PathBuf;

use clap::Args as ClapArgs;
use hysid_io::{CsvChunks, ReadOptions, fit_clock, read_recording};
use hysid_signal::{Recording, turning_points};
use hysid_validate::loop_areas;
use serde_json::{Value, json};

use crate::commands::channel_facts::{ChannelFacts, channel_facts};
use crate::commands::files::clock_or_period;
use crate::failure::Failure;

/// What is in a recording: channels, clock, gaps, clipping, resolution, periods, loops.
#[derive(Debug, ClapArgs)]
pub struct Args {
    /// The recording (CSV).
    recording: PathBuf,
    /// The sampling period in seconds of a recording without a time column `t_s`.
    #[arg(long)]
    period_s: Option<f64>,
    /// The input's column, to look at the loops of every other channel against it; the first channel unless told otherwise.
    #[arg(long)]
    input: Option<String>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// The loops of one channel against the input.
struct Loops {
    output: String,
    count: usize,
    turns: usize,
    mean_area: f64,
    smallest_area: f64,
    largest_area: f64,
    /// Mean area over the mean width times height: 0 for a line, pi/4 for an ellipse on its axes.
    fullness: f64,
}

/// Runs the command.
pub fn run(args: &Args) -> Result<(), Failure> {
    let time = clock_or_period(&args.recording, args.period_s)?;
    let recording =
        read_recording(&args.recording, &ReadOptions { time, columns: None }).map_err(Failure::bad_input)?;
    let jitter = jitter(args)?;
    let input = match &args.input {
        Some(name) => Some(
            hysid_io::require::channel(&args.recording, &recording, name).map_err(Failure::bad_input)?.name.clone(),
        ),
        None => recording.channels().first().map(|c| c.name.clone()),
    };
    let facts: Vec<ChannelFacts> =
        recording.channels().iter().map(|c| channel_facts(c, recording.clock().period_s)).collect();
    let loops = input.as_deref().map_or_else(Vec::new, |u| loops(&recording, u, &facts));
    if args.json {
        let value = as_json(&recording, jitter, &facts, input.as_deref(), &loops);
        println!("{}", serde_json::to_string_pretty(&value).map_err(anyhow::Error::from)?);
    } else {
        print!("{}", as_text(&recording, jitter, &facts, input.as_deref(), &loops));
    }
    Ok(())
}

/// Largest deviation of the time stamps from the uniform clock in seconds, where the file has time stamps.
fn jitter(args: &Args) -> Result<Option<f64>, Failure> {
    let Ok(mut chunks) = CsvChunks::open(&args.recording, Some(&["t_s"]), 1 << 16) else { return Ok(None) };
    let mut t = Vec::new();
    while let Some(chunk) = chunks.next_chunk().map_err(Failure::bad_input)? {
        t.extend(chunk.columns.into_iter().flatten());
    }
    Ok(fit_clock(&t, chunks.decimals(0)).ok().map(|fit| fit.largest_deviation_s))
}

fn loops(recording: &Recording, input: &str, facts: &[ChannelFacts]) -> Vec<Loops> {
    let Some(u) = recording.channel(input) else { return Vec::new() };
    let Some(of_input) = facts.iter().find(|f| f.name == input) else { return Vec::new() };
    // A tenth of the range is well above noise and below the swings that make a loop.
    let threshold = 0.1 * (of_input.largest - of_input.smallest);
    if !threshold.is_finite() || threshold <= 0.0 {
        return Vec::new();
    }
    let turns = turning_points(&u.samples, threshold).len();
    let others = recording.channels().iter().filter(|c| c.name != input);
    others
        .filter_map(|y| {
            let all = loop_areas(&u.samples, &y.samples, threshold);
            let count = all.len();
            let mean = |f: &dyn Fn(usize) -> f64| (0..count).map(f).sum::<f64>() / count as f64;
            let mean_area = mean(&|i| all[i].area);
            (count > 0).then(|| Loops {
                output: y.name.clone(),
                count,
                turns,
                mean_area,
                smallest_area: all.iter().map(|l| l.area).fold(f64::INFINITY, f64::min),
                largest_area: all.iter().map(|l| l.area).fold(f64::NEG_INFINITY, f64::max),
                fullness: mean_area.abs() / mean(&|i| all[i].width * all[i].height),
            })
        })
        .collect()
}

fn as_text(
    recording: &Recording,
    jitter: Option<f64>,
    facts: &[ChannelFacts],
    input: Option<&str>,
    loops: &[Loops],
) -> String {
    let clock = recording.clock();
    let duration = clock.period_s * recording.len().saturating_sub(1) as f64;
    let mut text = format!(
        "{}: {} samples, {} channels, period {:.6e} s ({:.6} Hz), {duration:.6} s\n",
        recording.name(),
        recording.len(),
        facts.len(),
        clock.period_s,
        1.0 / clock.period_s
    );
    text += &match jitter {
        Some(j) => format!(
            "Clock: time stamps lie within {:.2} % of a period of a uniform clock\n",
            100.0 * j / clock.period_s
        ),
        None => "Clock: no time column; the period was given\n".to_owned(),
    };
    let names: Vec<&str> = facts.iter().map(|f| f.name.as_str()).collect();
    let whole = recording.segments(&names);
    if whole.len() != 1 || whole[0].len() != recording.len() {
        let longest = whole.iter().map(ExactSizeIterator::len).max().unwrap_or(0);
        text += &format!(
            "Gaps: {}, counted where no channel misses a sample; the longest is of {longest} samples\n",
            match whole.len() {
                1 => "1 stretch".to_owned(),
                n => format!("{n} stretches"),
            }
        );
    }
    for f in facts {
        text += &format!("\n{f}");
    }
    if let Some(input) = input.filter(|_| !loops.is_empty()) {
        text += &format!("\nLoops against {input} (cycles that swing by more than a tenth of its range):\n");
        for l in loops {
            text += &format!(
                "  {}: {} cycles, {} turning points, area {:.4e} on average ({:.4e} to {:.4e}), {:.1} % of the box around a cycle\n",
                l.output,
                l.count,
                l.turns,
                l.mean_area,
                l.smallest_area,
                l.largest_area,
                100.0 * l.fullness
            );
        }
    }
    text
}

fn as_json(
    recording: &Recording,
    jitter: Option<f64>,
    facts: &[ChannelFacts],
    input: Option<&str>,
    loops: &[Loops],
) -> Value {
    let clock = recording.clock();
    let names: Vec<&str> = facts.iter().map(|f| f.name.as_str()).collect();
    let segments: Vec<Value> = recording.segments(&names).iter().map(|s| json!([s.start, s.end])).collect();
    let loops: Vec<Value> = loops
        .iter()
        .map(|l| {
            json!({
                "output": l.output, "cycles": l.count, "turning_points": l.turns, "mean_area": l.mean_area,
                "smallest_area": l.smallest_area, "largest_area": l.largest_area, "fullness": l.fullness,
            })
        })
        .collect();
    json!({
        "recording": recording.name(),
        "samples": recording.len(),
        "start_s": clock.start_s,
        "period_s": clock.period_s,
        "clock_deviation_s": jitter,
        "segments": segments,
        "channels": facts.iter().map(ChannelFacts::as_json).collect::<Vec<_>>(),
        "input": input,
        "loops": loops,
    })
}
