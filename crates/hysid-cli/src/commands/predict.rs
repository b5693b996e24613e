//! `hysid predict`: what a model says of a recording.

use std::path::PathBuf;

use hysid::identify::Columns;
use hysid_narx::NarxModel;
use hysid_signal::tell::digits;

use super::files::keep_inputs;
use super::fit::{TIME, WITHOUT_CLOCK, has_clock, read};
use crate::failure::Failure;

/// Predict a recording's output with a model.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The model, as `hysid fit` wrote it.
    #[arg(value_name = "MODEL.json")]
    model: PathBuf,
    /// The recording (CSV) with the model's inputs, and with the output for the model to start from.
    #[arg(long, value_name = "CSV")]
    recording: PathBuf,
    /// free-run, one-step, or a number of steps ahead.
    #[arg(long, value_name = "free-run|one-step|K", default_value = "free-run", value_parser = mode)]
    mode: Mode,
    /// The file (CSV) for the predicted output: every row of the recording, NaN where the model has no past yet.
    #[arg(long, value_name = "CSV")]
    out: PathBuf,
}

#[derive(Debug, Clone, Copy)]
enum Mode {
    FreeRun,
    Steps(usize),
}

/// The longest horizon that may be asked for.
const LONGEST: usize = 1_000_000;

fn mode(text: &str) -> Result<Mode, String> {
    match text {
        "free-run" => Ok(Mode::FreeRun),
        "one-step" => Ok(Mode::Steps(1)),
        _ => match text.parse() {
            Ok(k) if (1..=LONGEST).contains(&k) => Ok(Mode::Steps(k)),
            _ => Err(format!("give free-run, one-step or a number of steps from 1 to {LONGEST}")),
        },
    }
}

/// Reads, predicts, writes.
pub fn run(args: &Args) -> Result<(), Failure> {
    keep_inputs(&args.out, &[], [&args.model, &args.recording])?;
    hysid_io::check_writable(&args.out).map_err(Failure::bad_input)?;
    let model = NarxModel::load(&args.model).map_err(Failure::bad_input)?;
    let output = model.signals().output().column.clone();
    let mut columns = model.input_columns();
    columns.push(&output);
    let recording = read(&args.recording, &columns, WITHOUT_CLOCK)?;
    let clock = has_clock(&args.recording)?;
    if let Some(made) = model.parts().period_s.filter(|_| clock) {
        same_rate(args, made, recording.clock().period_s)?;
    }
    let found = Columns::of(&model, &recording).map_err(Failure::bad_input)?;
    let prediction = match args.mode {
        Mode::FreeRun => model.free_run(&found.record()),
        Mode::Steps(k) => model.k_step(&found.record(), k),
    }
    .map_err(Failure::bad_input)?;
    let t: Vec<f64> = (0..recording.len()).map(|n| recording.clock().time(n)).collect();
    let mut table: Vec<(&str, &[f64])> = Vec::new();
    if clock {
        table.push(("t_s", &t));
    }
    table.push((&output, &prediction.y));
    hysid_io::write_csv(&args.out, &table).map_err(Failure::bad_input)?;
    if let Some(n) = prediction.diverged_at {
        eprintln!("warning: the run diverged at sample {n}; NaN from there on");
    }
    Ok(())
}

/// Refuses a recording at another rate than those that the model was made from: its terms count samples, not seconds.
fn same_rate(args: &Args, made: f64, found: f64) -> Result<(), Failure> {
    if hysid::identify::same_rate(made, found) {
        return Ok(());
    }
    Err(Failure::BadInput(format!(
        "{}, column `{TIME}`: the sampling period is {} s, but {} was made from recordings with one of {} s; resample the recording, or make a model from recordings at its rate",
        args.recording.display(),
        digits(found, 6),
        args.model.display(),
        digits(made, 6)
    )))
}
