//! The files and columns of a command held against each other: no result over what it was made from, no hold-out that was learnt from, one clock,
//! no column that is two signals.

use std::path::{Path, PathBuf};

use hysid_io::{ReadOptions, TimeSource, read_recording};
use hysid_signal::tell::{brief, digits};
use hysid_signal::{Recording, rows_seen};

use super::fit::TIME;
use crate::failure::Failure;

/// Relative difference of two sampling periods from which they contradict each other.
pub const SAME_PERIOD: f64 = 1e-3;

/// The path without links and detours. A file that is not there is told of when it is read.
fn known(path: &Path) -> PathBuf {
    std::fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf())
}

/// Refuses an `--out` that one of the inputs would be lost to: a file, or a folder with the names of the files that go there.
///
/// # Errors
/// The file that is both.
pub fn keep_inputs<'a>(
    out: &Path,
    names: &[&str],
    inputs: impl IntoIterator<Item = &'a PathBuf>,
) -> Result<(), Failure> {
    let written: Vec<PathBuf> =
        if names.is_empty() { vec![known(out)] } else { names.iter().map(|n| known(&out.join(n))).collect() };
    // What is no regular file (a terminal is both /dev/stdin and /dev/stdout) is not lost by being written to.
    match inputs.into_iter().find(|i| i.is_file() && written.contains(&known(i))) {
        Some(input) => Err(Failure::BadInput(format!(
            "--out {}: it would overwrite {}, which this command reads; name another",
            out.display(),
            input.display()
        ))),
        None => Ok(()),
    }
}

/// Refuses a file that is named twice, as `--recording`, as `--holdout` or as both.
///
/// # Errors
/// The file, and as what it is named.
pub fn no_file_twice(estimation: &[PathBuf], holdout: &[PathBuf]) -> Result<(), Failure> {
    let mut seen: Vec<(PathBuf, &str)> = Vec::new();
    for (files, role) in [(estimation, "--recording"), (holdout, "--holdout")] {
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

/// The recordings of a command, held against each other.
#[derive(Debug)]
pub struct Intake {
    /// To estimate from.
    pub estimation: Vec<Recording>,
    /// To score on only.
    pub holdout: Vec<Recording>,
}

impl Intake {
    /// Recordings with the files that they were read from. Two that would have the same name (that of the file without its folders) are named by
    /// their paths.
    ///
    /// # Errors
    /// A hold-out with the samples of a recording that is learnt from, or with a part of them.
    pub fn new(
        estimation: (&[PathBuf], Vec<Recording>),
        holdout: (&[PathBuf], Vec<Recording>),
    ) -> Result<Self, Failure> {
        for (file, h) in holdout.0.iter().zip(&holdout.1) {
            for (learnt, e) in estimation.0.iter().zip(&estimation.1) {
                let Some(rows) = rows_seen(h, e) else { continue };
                let what = if rows == h.len() && rows == e.len() {
                    format!("it holds the same data as {}, which", learnt.display())
                } else {
                    format!("{rows} of its {} rows stand in {}, too, which", h.len(), learnt.display())
                };
                return Err(Failure::BadInput(format!(
                    "{}: {what} is a --recording; the hold-out must be data that the estimation never sees",
                    file.display()
                )));
            }
        }
        let names: Vec<String> = estimation.1.iter().chain(&holdout.1).map(|r| r.name().to_owned()).collect();
        let told_apart = |(files, recordings): (&[PathBuf], Vec<Recording>)| {
            let twice = |r: &Recording| names.iter().filter(|n| *n == r.name()).count() > 1;
            let named = |(file, r): (&PathBuf, Recording)| {
                if twice(&r) { r.named(file.display().to_string()) } else { r }
            };
            files.iter().zip(recordings).map(named).collect()
        };
        Ok(Self { estimation: told_apart(estimation), holdout: told_apart(holdout) })
    }

    /// The path by which the user named the recording of this name, of those that were read from `estimation` and `holdout`.
    pub fn path<'a>(&self, name: &str, estimation: &'a [PathBuf], holdout: &'a [PathBuf]) -> Option<&'a Path> {
        let mut all = self.estimation.iter().zip(estimation).chain(self.holdout.iter().zip(holdout));
        all.find(|(r, _)| r.name() == name).map(|(_, path)| path.as_path())
    }
}

/// Refuses a column that is given for two signals, and the time column as a signal; each column with the option that gives it.
///
/// # Errors
/// The option and the column.
pub fn different_signals(given: &[(&str, &str)]) -> Result<(), Failure> {
    for (i, (option, column)) in given.iter().enumerate() {
        if given[..i].iter().any(|(_, before)| before == column) {
            let mut options: Vec<&str> = given.iter().map(|g| g.0).collect();
            options.dedup();
            return Err(Failure::BadInput(format!(
                "{option} {}: this column is given twice; each of {} must name another one",
                brief(column),
                options.join(", ")
            )));
        }
        if *column == TIME {
            return Err(Failure::BadInput(format!("{option} {TIME}: this is the time column, not a signal")));
        }
    }
    Ok(())
}

/// Refuses a sampling period that is said of a recording whose time column says another; `said` is told as `by`, with what to do.
///
/// # Errors
/// Both periods, and what to do.
pub fn same_clock(file: &Path, said: f64, by: &str, remedy: &str) -> Result<(), Failure> {
    let clock_only = ReadOptions { columns: Some(Vec::new()), ..ReadOptions::default() };
    let Ok(recording) = read_recording(file, &clock_only) else { return Ok(()) };
    let found = recording.clock().period_s;
    if (found - said).abs() > SAME_PERIOD * said {
        return Err(Failure::BadInput(format!(
            "{}, column `{TIME}`: the sampling period is {} s, but {by}; {remedy}",
            file.display(),
            digits(found, 6)
        )));
    }
    Ok(())
}

/// The same for the period that a simulation says.
///
/// # Errors
/// As of [`same_clock`].
pub fn same_clock_as_simulation(file: &Path, said: f64) -> Result<(), Failure> {
    let by = format!("the simulation says `period_s = {said}`");
    same_clock(file, said, &by, &format!("write `column = \"{TIME}\"` in [time] to go by the recording"))
}

/// Where the clock of a recording comes from: its column `t_s`, else `--period-s`, which must not contradict it.
///
/// # Errors
/// As of [`same_clock`].
pub fn clock_or_period(file: &Path, period_s: Option<f64>) -> Result<TimeSource, Failure> {
    let Some(said) = period_s else { return Ok(TimeSource::default()) };
    let remedy = "leave the option out to go by the recording";
    same_clock(file, said, &format!("--period-s says {said} s"), remedy)?;
    Ok(TimeSource::ColumnOrPeriod(TIME.into(), said))
}
