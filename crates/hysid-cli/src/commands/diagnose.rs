//! `hysid diagnose`: what a simulation leaves out, found from recordings.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::Context;
use hysid_diagnose::{Hooks, Options, Request, diagnose, stand_in};
use hysid_io::{ReadOptions, TimeSource, read_recording};
use hysid_plant::{ClockSource, Simulation};
use hysid_signal::Recording;

use crate::failure::Failure;

/// Find what physics a simulation leaves out: where it parts from a recording, a name, a sentence, a better simulation
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The simulation (`NAME.sim.toml`)
    #[arg(required_unless_present = "simulated", conflicts_with = "simulated")]
    simulation: Option<PathBuf>,
    /// Instead of a simulation file: the column that your own simulator wrote
    #[arg(long, value_name = "COLUMN", requires = "input", requires = "output")]
    simulated: Option<String>,
    /// With --simulated: the input's column (repeat for several)
    #[arg(long, value_name = "COLUMN", requires = "simulated")]
    input: Vec<String>,
    /// With --simulated: the measured output's column
    #[arg(long, value_name = "COLUMN", requires = "simulated")]
    output: Option<String>,
    /// Recording to estimate from (repeat for several)
    #[arg(long, value_name = "CSV", required = true)]
    recording: Vec<PathBuf>,
    /// Recording that only scores: nothing is fitted or chosen on it (repeat for several)
    #[arg(long, value_name = "CSV")]
    holdout: Vec<PathBuf>,
    /// Folder for diagnosis.json, report.html and augmented.sim.toml
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Level of the mismatch test
    #[arg(long, default_value_t = 0.01)]
    alpha: f64,
    /// Seed of everything random
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Threads; all cores unless given. The result does not depend on it
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
    /// Leave out optional steps after so many seconds. The result may then depend on the machine
    #[arg(long, value_name = "SECONDS")]
    time_limit: Option<f64>,
}

/// Diagnoses and writes the folder; prints the verdict on stdout.
pub fn run(args: &Args) -> Result<(), Failure> {
    if let Some(limit) = args.time_limit
        && !(limit > 0.0 && limit.is_finite())
    {
        return Err(Failure::BadInput(format!("--time-limit is {limit}; allowed is a number of seconds above zero")));
    }
    let threads = match args.threads {
        Some(0) => return Err(Failure::BadInput("--threads is 0; allowed is 1 or more".into())),
        Some(n) => n,
        None => std::thread::available_parallelism().map_or(1, usize::from),
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().context("starting the threads")?;
    pool.install(|| work(args))
}

fn work(args: &Args) -> Result<(), Failure> {
    let began = Instant::now();
    let limit = args.time_limit.map(Duration::from_secs_f64);
    let options = Options { alpha: args.alpha, seed: args.seed };
    let progress = |step: &str| eprintln!("hysid: {step} ...");
    let expired = || limit.is_some_and(|l| began.elapsed() > l);
    let hooks = Hooks { progress: &progress, expired: &expired };
    let outcome = match (&args.simulation, &args.simulated) {
        (Some(file), _) => {
            let text =
                std::fs::read_to_string(file).map_err(|e| Failure::BadInput(format!("{}: {e}", file.display())))?;
            let name = file.display().to_string();
            let simulation = Simulation::parse(&text, &name).map_err(Failure::bad_input)?;
            let estimation = recordings(&args.recording, &simulation)?;
            let holdout = recordings(&args.holdout, &simulation)?;
            diagnose(
                &Request { simulation: &simulation, file: &name, estimation: &estimation, holdout: &holdout, options },
                &hooks,
            )
        }
        (None, Some(column)) => {
            let output = args.output.clone().unwrap_or_default();
            let columns: Vec<String> = args.input.iter().cloned().chain([output.clone(), column.clone()]).collect();
            let read_all = |files: &[PathBuf]| -> Result<Vec<Recording>, Failure> {
                let options = ReadOptions { columns: Some(columns.clone()), ..ReadOptions::default() };
                files.iter().map(|f| read(f, &options)).collect()
            };
            let estimation = read_all(&args.recording)?;
            let holdout = read_all(&args.holdout)?;
            progress("finding a clone of the simulated column");
            let stand_in =
                stand_in(&args.input, &output, column, &estimation, args.seed).map_err(Failure::bad_input)?;
            let request = Request {
                simulation: &stand_in.simulation,
                file: column,
                estimation: &estimation,
                holdout: &holdout,
                options,
            };
            diagnose(&request, &hooks).map(|mut outcome| {
                outcome.file.notes.insert(0, stand_in.note.clone());
                outcome
            })
        }
        (None, None) => {
            return Err(Failure::BadInput("give a simulation file, or --simulated with --input and --output".into()));
        }
    }
    .map_err(Failure::bad_input)?;

    std::fs::create_dir_all(&args.out).map_err(|e| Failure::BadInput(format!("--out {}: {e}", args.out.display())))?;
    let page = hysid_report::diagnosis::page(&outcome.file, &outcome.picture, &crate::provenance());
    hysid_io::write_text(&args.out.join("report.html"), &page).context("writing the report")?;
    if let Some(augmented) = &outcome.augmented {
        hysid_io::write_text(&args.out.join("augmented.sim.toml"), &augmented.to_toml())
            .context("writing the augmented simulation")?;
    }
    hysid_io::write_json(&args.out.join("diagnosis.json"), &outcome.file).context("writing the verdict")?;
    println!("{}: {}", outcome.file.verdict.word(), outcome.file.summary);
    for f in &outcome.file.fit {
        if let (Some(before), Some(after)) = (f.rmse_before, f.rmse_after) {
            println!("{} {}: rmse {before:.4e} before, {after:.4e} after", f.recording, f.output);
        }
    }
    Ok(())
}

/// The recordings with the columns that the simulation names.
fn recordings(files: &[PathBuf], simulation: &Simulation) -> Result<Vec<Recording>, Failure> {
    let time = match &simulation.time.clock {
        ClockSource::Column(name) => TimeSource::Column(name.clone()),
        ClockSource::Period(p) => TimeSource::Period(*p),
    };
    let mut seen = BTreeSet::new();
    let columns: Vec<String> = simulation
        .inputs
        .iter()
        .map(|i| i.column.clone())
        .chain(simulation.outputs.iter().map(|o| o.column.clone()))
        .filter(|c| seen.insert(c.clone()))
        .collect();
    files.iter().map(|f| read(f, &ReadOptions { time: time.clone(), columns: Some(columns.clone()) })).collect()
}

fn read(file: &Path, options: &ReadOptions) -> Result<Recording, Failure> {
    read_recording(file, options).map_err(Failure::bad_input)
}
