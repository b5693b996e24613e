//! The recordings of a diagnosis, read and held against each other.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use hysid_io::{ReadOptions, TimeSource, read_recording};
use hysid_plant::{ClockSource, Simulation};
use hysid_signal::Recording;

use crate::failure::Failure;

/// The column that holds the time where nothing else is said.
const TIME: &str = "t_s";
/// Relative difference of two sampling periods from which they contradict each other.
pub const SAME_PERIOD: f64 = 1e-3;

/// Estimation and hold-out recordings.
#[derive(Debug)]
pub struct Intake {
    /// To estimate from.
    pub estimation: Vec<Recording>,
    /// To score on only.
    pub holdout: Vec<Recording>,
}

/// The files of a diagnosis, as the user named them.
#[derive(Debug, Clone, Copy)]
pub struct Files<'a> {
    /// To estimate from.
    pub estimation: &'a [PathBuf],
    /// To score on only.
    pub holdout: &'a [PathBuf],
}

impl Files<'_> {
    /// The columns that a simulation names.
    ///
    /// # Errors
    /// A recording that cannot be used, or data that are given twice.
    pub fn of_simulation(&self, simulation: &Simulation) -> Result<Intake, Failure> {
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
        self.read(&ReadOptions { time, columns: Some(columns) })
    }

    /// These columns, with the time in `t_s`.
    ///
    /// # Errors
    /// As of [`Files::of_simulation`], and a column that is named twice.
    pub fn of_columns(&self, columns: &[String]) -> Result<Intake, Failure> {
        if let Some(twice) = columns.iter().enumerate().find(|(i, c)| columns[..*i].contains(c)) {
            return Err(Failure::BadInput(format!(
                "column `{}` is given twice: --simulated, --output and every --input must be different columns",
                twice.1
            )));
        }
        self.read(&ReadOptions { columns: Some(columns.to_vec()), ..ReadOptions::default() })
    }

    fn read(&self, options: &ReadOptions) -> Result<Intake, Failure> {
        self.no_file_twice()?;
        let all = |files: &[PathBuf]| files.iter().map(|f| read(f, options)).collect::<Result<Vec<_>, _>>();
        let intake = Intake { estimation: all(self.estimation)?, holdout: all(self.holdout)? };
        for (h, file) in intake.holdout.iter().zip(self.holdout) {
            if let Some(e) = intake.estimation.iter().position(|e| e.same_samples(h)) {
                return Err(Failure::BadInput(format!(
                    "{}: it holds the same data as {}, which is a --recording; the hold-out must be data that the estimation never sees",
                    file.display(),
                    self.estimation[e].display()
                )));
            }
        }
        Ok(intake)
    }

    fn no_file_twice(&self) -> Result<(), Failure> {
        // A file that is not there is told of when it is read.
        let known = |f: &PathBuf| std::fs::canonicalize(f).unwrap_or_else(|_| f.clone());
        let mut seen: Vec<(PathBuf, &str)> = Vec::new();
        for (files, role) in [(self.estimation, "--recording"), (self.holdout, "--holdout")] {
            for file in files {
                let path = known(file);
                if let Some((_, before)) = seen.iter().find(|s| s.0 == path) {
                    let why = if *before == role {
                        format!("given twice as {role}; a recording counts once")
                    } else {
                        "given as --recording and as --holdout; the hold-out must be data that the estimation never sees"
                            .to_owned()
                    };
                    return Err(Failure::BadInput(format!("{}: {why}", file.display())));
                }
                seen.push((path, role));
            }
        }
        Ok(())
    }
}

fn read(file: &Path, options: &ReadOptions) -> Result<Recording, Failure> {
    let recording = read_recording(file, options).map_err(Failure::bad_input)?;
    if let TimeSource::Period(said) = options.time {
        contradiction(file, said)?;
    }
    Ok(recording)
}

/// A simulation that says its period, and a recording whose time column says another.
fn contradiction(file: &Path, said: f64) -> Result<(), Failure> {
    let clock_only = ReadOptions { columns: Some(Vec::new()), ..ReadOptions::default() };
    let Ok(recording) = read_recording(file, &clock_only) else { return Ok(()) };
    let found = recording.clock().period_s;
    if (found - said).abs() > SAME_PERIOD * said {
        return Err(Failure::BadInput(format!(
            "{}, column `{TIME}`: the sampling period is {found} s, but the simulation says `period_s = {said}`; write `column = \"{TIME}\"` in [time] to go by the recording",
            file.display()
        )));
    }
    Ok(())
}
