//! The recordings of a diagnosis, read and held against each other.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use hysid_diagnose::DiagnoseError;
use hysid_io::{ReadOptions, TimeSource, read_recording};
use hysid_plant::{ClockSource, Simulation};
use hysid_signal::Recording;

use crate::commands::files::{Intake, no_file_twice, same_clock_as_simulation};
use crate::failure::Failure;

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
    /// As of [`Files::of_simulation`].
    pub fn of_columns(&self, columns: &[String]) -> Result<Intake, Failure> {
        self.read(&ReadOptions { columns: Some(columns.to_vec()), ..ReadOptions::default() })
    }

    /// The error with the path of the recording that it tells of, in the place of its name.
    pub fn named_in(&self, mut error: DiagnoseError, intake: &Intake) -> DiagnoseError {
        use DiagnoseError as E;
        if let E::MissingColumn { recording, .. }
        | E::TooFewSamples { recording, .. }
        | E::TooManyGaps { recording, .. }
        | E::ConstantOutput { recording, .. }
        | E::NothingDrives { recording, .. }
        | E::Explodes { recording, .. }
        | E::SeenBefore { recording, .. } = &mut error
            && let Some(path) = intake.path(recording, self.estimation, self.holdout)
        {
            *recording = path.display().to_string();
        }
        error
    }

    fn read(&self, options: &ReadOptions) -> Result<Intake, Failure> {
        no_file_twice(self.estimation, self.holdout)?;
        let all = |files: &[PathBuf]| files.iter().map(|f| read(f, options)).collect::<Result<Vec<_>, _>>();
        Intake::new((self.estimation, all(self.estimation)?), (self.holdout, all(self.holdout)?))
    }
}

fn read(file: &Path, options: &ReadOptions) -> Result<Recording, Failure> {
    let recording = read_recording(file, options).map_err(Failure::bad_input)?;
    if let TimeSource::Period(said) = options.time {
        same_clock_as_simulation(file, said)?;
    }
    Ok(recording)
}
