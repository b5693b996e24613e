//! A recording from a CSV file: UTF-8, comma separated, one header line, a uniform time column or a period given by the caller.

use std::path::Path;

use hysid_signal::{Channel, Clock, Recording};

use crate::chunks::CsvChunks;
use crate::clock::fit_clock;
use crate::error::{InputError, InputProblem, listed};

/// Where the sampling period comes from.
#[derive(Debug, Clone, PartialEq)]
pub enum TimeSource {
    /// The time column of this name, in seconds.
    Column(String),
    /// A period in seconds; the file has no time column, every column is a signal.
    Period(f64),
    /// The time column of this name where the file has it, else this period in seconds.
    ColumnOrPeriod(String, f64),
}

impl Default for TimeSource {
    /// The column `t_s`.
    fn default() -> Self {
        Self::Column("t_s".into())
    }
}

/// What to read of a file.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ReadOptions {
    /// Where the sampling period comes from.
    pub time: TimeSource,
    /// The signals to read, in this order; `None` reads every column but the time. Columns that are not read may hold anything.
    pub columns: Option<Vec<String>>,
}

impl ReadOptions {
    /// The time column `t_s` and these signals.
    pub fn columns<S: Into<String>>(names: impl IntoIterator<Item = S>) -> Self {
        Self { columns: Some(names.into_iter().map(Into::into).collect()), ..Self::default() }
    }
}

/// The recording in a CSV file, named after the file (without its folders).
///
/// The file is streamed: memory is 8 bytes for each sample kept. A column that was asked for by name must hold at least one sample; when
/// all are read, at least one column must.
///
/// # Errors
/// Everything that [`InputProblem`] lists for CSV, with the line and the column at fault.
pub fn read_recording(file: &Path, options: &ReadOptions) -> Result<Recording, InputError> {
    let header = CsvChunks::open(file, None, 1)?.header().to_vec();
    let time = time_column(file, &options.time, &header)?;
    let signals: Vec<&str> = match &options.columns {
        Some(names) => names.iter().map(String::as_str).collect(),
        None => header.iter().map(String::as_str).filter(|n| Some(*n) != time).collect(),
    };
    for (i, name) in signals.iter().enumerate() {
        if signals[..i].contains(name) {
            return Err(InputError::in_column(file, name, InputProblem::DuplicateColumn));
        }
    }
    let select: Vec<&str> = time.iter().copied().chain(signals.iter().copied()).collect();
    let mut chunks = CsvChunks::open(file, Some(&select), 1 << 16)?;
    let mut columns = vec![Vec::new(); select.len()];
    let mut lines = LineNumbers::default();
    while let Some(chunk) = chunks.next_chunk()? {
        lines.extend(&chunk.lines);
        for (all, new) in columns.iter_mut().zip(&chunk.columns) {
            all.extend_from_slice(new);
        }
    }
    let found = columns.first().map_or(lines.count, Vec::len);
    if found == 0 {
        return Err(InputError::whole(file, InputProblem::HeaderOnly));
    }
    let clock = match (time, &options.time) {
        (Some(name), _) => {
            let t = columns.remove(0);
            let fit = fit_clock(&t, chunks.decimals(0)).map_err(|(n, problem)| match problem {
                InputProblem::TooFewSamples { .. } => InputError::whole(file, problem),
                _ => InputError::at(file, lines.of_row(n), Some(name), problem),
            })?;
            Clock { start_s: fit.start_s, period_s: fit.period_s }
        }
        (None, TimeSource::Period(p) | TimeSource::ColumnOrPeriod(_, p)) => Clock { start_s: 0.0, period_s: *p },
        (None, TimeSource::Column(_)) => return Err(no_clock(file, &header)),
    };
    if found < 2 {
        return Err(InputError::whole(file, InputProblem::TooFewSamples { found, needed: 2 }));
    }
    let empty: Vec<usize> = (0..columns.len()).filter(|&i| columns[i].iter().all(|x| !x.is_finite())).collect();
    if let Some(&i) = empty.first()
        && (options.columns.is_some() || empty.len() == columns.len())
    {
        return Err(InputError::in_column(file, signals[i], InputProblem::AllMissing));
    }
    let channels =
        signals.iter().zip(columns).map(|(name, samples)| Channel { name: (*name).to_owned(), samples }).collect();
    let name = file.file_name().map_or_else(|| file.display().to_string(), |n| n.to_string_lossy().into_owned());
    Recording::new(name, clock, channels).map_err(|_| InputError::whole(file, InputProblem::BadPeriod(clock.period_s)))
}

fn no_clock(file: &Path, header: &[String]) -> InputError {
    InputError::whole(file, InputProblem::NoClock(listed(header.iter().map(String::as_str))))
}

/// The time column to read, if the file has one that is wanted.
fn time_column<'a>(file: &Path, source: &'a TimeSource, header: &[String]) -> Result<Option<&'a str>, InputError> {
    match source {
        TimeSource::Column(name) if header.contains(name) => Ok(Some(name)),
        TimeSource::Column(name) if name == "t_s" => Err(no_clock(file, header)),
        TimeSource::Column(name) => {
            let has = listed(header.iter().map(String::as_str));
            Err(InputError::in_column(file, name, InputProblem::MissingColumn(has)))
        }
        TimeSource::ColumnOrPeriod(name, _) if header.contains(name) => Ok(Some(name)),
        TimeSource::Period(p) | TimeSource::ColumnOrPeriod(_, p) => {
            if p.is_finite() && *p > 0.0 {
                Ok(None)
            } else {
                Err(InputError::whole(file, InputProblem::BadPeriod(*p)))
            }
        }
    }
}

/// Line numbers of rows, kept only where they jump (blank lines are rare).
#[derive(Default)]
struct LineNumbers {
    count: usize,
    jumps: Vec<(usize, u64)>,
}

impl LineNumbers {
    fn extend(&mut self, lines: &[u64]) {
        for &line in lines {
            if self.of_row(self.count) != line {
                self.jumps.push((self.count, line));
            }
            self.count += 1;
        }
    }

    fn of_row(&self, row: usize) -> u64 {
        match self.jumps.iter().rev().find(|(from, _)| *from <= row) {
            Some((from, line)) => line + (row - from) as u64,
            None => row as u64 + 2,
        }
    }
}
