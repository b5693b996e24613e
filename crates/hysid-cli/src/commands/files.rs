//! The files of a command held against each other: no result over what it was made from, no hold-out that was learnt from, one clock.

use std::path::{Path, PathBuf};

use hysid_io::{ReadOptions, TimeSource, read_recording};
use hysid_signal::Recording;
use hysid_signal::tell::digits;

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

/// Refuses a hold-out with the samples of a recording that is learnt from, each given with its file.
///
/// # Errors
/// The files that hold the same samples.
pub fn no_samples_twice(
    estimation: (&[PathBuf], &[Recording]),
    holdout: (&[PathBuf], &[Recording]),
) -> Result<(), Failure> {
    for (file, h) in holdout.0.iter().zip(holdout.1) {
        if let Some((same, _)) = estimation.0.iter().zip(estimation.1).find(|(_, e)| e.same_samples(h)) {
            return Err(Failure::BadInput(format!(
                "{}: it holds the same data as {}, which is a --recording; the hold-out must be data that the estimation never sees",
                file.display(),
                same.display()
            )));
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
