//! `hysid simulate`: what a simulation file says of a recording's inputs.
//!
//! Where the recording also has the measured outputs, free initial states come from its first samples; else they are 0.
//! Rows in which an input is missing are `NaN`, and the simulation starts anew after them.

use std::path::{Path, PathBuf};

use hysid_io::{CsvChunks, InputProblem, ReadOptions, TimeSource, check_writable, read_recording};
use hysid_plant::{ClockSource, Compiled, Data, Drive, Run, Simulation, Start};
use hysid_signal::Recording;
use hysid_signal::tell::counted;

use super::files::{keep_inputs, same_clock_as_simulation};
use crate::failure::Failure;

/// Run a simulation file on a recording's inputs.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The simulation (`.sim.toml`).
    #[arg(value_name = "SIMULATION.sim.toml")]
    simulation: PathBuf,
    /// The recording (CSV) with the inputs, and with the outputs where free initial states are to follow from them.
    #[arg(long, value_name = "CSV")]
    input: PathBuf,
    /// The file (CSV) for the outputs: the time column, where there is one, and one column for each output.
    #[arg(long, value_name = "CSV")]
    out: PathBuf,
}

/// The relative change of the outputs on half the step below which the step is small enough.
const STEP_TOLERANCE: f64 = 1e-5;

/// Reads, simulates, writes.
///
/// # Errors
/// A simulation or recording that cannot be used; a simulation that is not finite.
pub fn run(args: &Args) -> Result<(), Failure> {
    keep_inputs(&args.out, &[], [&args.simulation, &args.input])?;
    check_writable(&args.out).map_err(Failure::bad_input)?;
    let (simulation, name) = super::simulation_file::read(&args.simulation)?;
    let compiled = Compiled::new(&simulation).map_err(|e| Failure::BadInput(format!("{name}: {e}")))?;
    let (recording, measured) = read(&args.input, &simulation)?;
    let (outputs, notes) =
        simulate(&compiled, &recording, measured).map_err(|e| Failure::BadInput(format!("{name}: {e}")))?;
    let clock = recording.clock();
    // As a person would write it: without the rounding of the sum.
    let tidy = |n: usize| format!("{:.13e}", clock.time(n)).parse().unwrap_or_else(|_| clock.time(n));
    let time: Vec<f64> = (0..recording.len()).map(tidy).collect();
    let mut table: Vec<(&str, &[f64])> = compiled.time_column().map(|c| (c, time.as_slice())).into_iter().collect();
    table.extend(simulation.outputs.iter().zip(&outputs).map(|(o, y)| (o.column.as_str(), y.as_slice())));
    hysid_io::write_csv(&args.out, &table).map_err(Failure::bad_input)?;
    notes.iter().for_each(|note| eprintln!("{note}"));
    Ok(())
}

/// Whether the recording has the outputs too.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Measured {
    Yes,
    No,
}

fn read(path: &Path, simulation: &Simulation) -> Result<(Recording, Measured), Failure> {
    let time = match &simulation.time.clock {
        ClockSource::Column(column) => TimeSource::Column(column.clone()),
        ClockSource::Period(period_s) => {
            same_clock_as_simulation(path, *period_s)?;
            TimeSource::Period(*period_s)
        }
    };
    let mut columns: Vec<String> = Vec::new();
    for input in &simulation.inputs {
        if !columns.contains(&input.column) {
            columns.push(input.column.clone());
        }
    }
    let outputs: Vec<String> = simulation.outputs.iter().map(|o| o.column.clone()).collect();
    if simulation.states.iter().any(|s| s.initial == hysid_plant::Initial::Free) || columns.is_empty() {
        let header = CsvChunks::open(path, None, 1).map_err(Failure::bad_input)?.header().to_vec();
        if outputs.iter().all(|o| header.contains(o)) {
            let all = ReadOptions { time: time.clone(), columns: Some([columns.clone(), outputs.clone()].concat()) };
            match read_recording(path, &all) {
                // Nothing was measured: as good as no column.
                Err(e)
                    if e.problem == InputProblem::AllMissing
                        && outputs.iter().any(|o| e.column.as_ref() == Some(o)) => {}
                read => return Ok((read.map_err(Failure::bad_input)?, Measured::Yes)),
            }
        }
    }
    // Without an input every column will do: it is the number of rows that counts.
    let columns = (!columns.is_empty()).then_some(columns);
    let recording = read_recording(path, &ReadOptions { time, columns }).map_err(Failure::bad_input)?;
    Ok((recording, Measured::No))
}

/// The outputs over the whole recording, `NaN` where an input is missing, and what to say of them.
fn simulate(
    compiled: &Compiled,
    recording: &Recording,
    measured: Measured,
) -> Result<(Vec<Vec<f64>>, Vec<String>), String> {
    let simulation = compiled.simulation();
    let theta = compiled.theta();
    let mut outputs = vec![vec![f64::NAN; recording.len()]; simulation.outputs.len()];
    let names: Vec<&str> = simulation.inputs.iter().map(|i| i.column.as_str()).collect();
    let stretches =
        if names.is_empty() { std::iter::once(0..recording.len()).collect() } else { recording.segments(&names) };
    let gaps = stretches.len() > 1;
    let mut notes = Vec::new();
    for range in stretches {
        let drive = Drive::from_recording(compiled, recording, range.clone()).map_err(|e| e.to_string())?;
        let series = |column: &str| match recording.channel(column).and_then(|c| c.samples.get(range.clone())) {
            Some(samples) if measured == Measured::Yes => samples.to_vec(),
            _ => vec![f64::NAN; range.len()],
        };
        let targets = simulation.outputs.iter().map(|o| series(&o.column)).collect();
        let mut data = Data::new(compiled, recording.name(), drive, targets).map_err(|e| e.to_string())?;
        if range.start > 0 {
            data.free = (0..simulation.states.len()).collect();
        }
        let rest = vec![0.0; data.free.len()];
        let first = data.start_states(compiled, &theta, &rest);
        let steps = compiled.check_steps(&data.drive, &theta, Start::States(&first), STEP_TOLERANCE);
        let (initial, used) = match measured {
            Measured::Yes => compiled.estimate_initial(&data, &theta, steps.substeps),
            Measured::No => (rest, 0),
        };
        if !data.free.is_empty() {
            let free: Vec<&str> =
                data.free.iter().filter_map(|&i| simulation.states.get(i)).map(|s| s.name.as_str()).collect();
            let from = match used {
                0 => "0".to_owned(),
                1 => "from the first measured sample".to_owned(),
                _ => format!("from the first {}", counted(used, "measured sample")),
            };
            let place = if gaps { format!(" at row {}", range.start + 1) } else { String::new() };
            notes.push(format!("free initial states ({}){place}: {from}", free.join(", ")));
        }
        let x = data.start_states(compiled, &theta, &initial);
        let run = Run::new(&data.drive, &theta).from(Start::States(&x)).with_substeps(steps.substeps);
        let response = compiled.simulate(&run);
        if response.diverged.is_some() {
            return Err(super::simulation_file::explain(compiled, &data.drive, &x, &response));
        }
        if steps.error > STEP_TOLERANCE {
            notes.push(format!(
                "warning: {} steps in each sampling period; on twice as many the outputs change by {:.1e} of their rms",
                steps.substeps, steps.error
            ));
        }
        for (to, y) in outputs.iter_mut().zip(&response.outputs) {
            if let Some(slot) = to.get_mut(range.clone()) {
                slot.copy_from_slice(y);
            }
        }
    }
    Ok((outputs, notes))
}
