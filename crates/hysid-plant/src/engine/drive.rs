//! The inputs of a run, and what can be wrong with data.

use hysid_signal::Recording;

use super::Compiled;
use crate::document::ClockSource;

/// The inputs of one stretch without gaps, on a uniform clock.
#[derive(Debug, Clone, PartialEq)]
pub struct Drive {
    pub(super) start_s: f64,
    pub(super) period_s: f64,
    pub(super) len: usize,
    pub(super) inputs: Vec<Vec<f64>>,
    /// Central differences of the inputs, per second.
    pub(super) rates: Vec<Vec<f64>>,
}

/// Why data cannot drive or calibrate a simulation.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DataError {
    /// A column that the simulation names is not there.
    #[error(
        "recording `{recording}` has no column `{column}`, which the simulation names as {role}; it has: {present}"
    )]
    MissingColumn {
        /// The recording.
        recording: String,
        /// The column.
        column: String,
        /// What it is for.
        role: &'static str,
        /// The columns that are there.
        present: String,
    },
    /// Series of different lengths.
    #[error("the series have different lengths: {0} and {1}")]
    UnequalLengths(usize, usize),
    /// The wrong number of series.
    #[error("{given} {what} are given, the simulation has {expected}")]
    WrongCount {
        /// What is counted.
        what: &'static str,
        /// How many were given.
        given: usize,
        /// How many are needed.
        expected: usize,
    },
    /// A sample that is missing or not finite.
    #[error("{what} is missing or not finite at sample {at}")]
    NotFinite {
        /// Which series.
        what: String,
        /// The first such sample.
        at: usize,
    },
    /// A period that is not finite and above zero.
    #[error("the sampling period is {0} s; it must be a finite number above zero")]
    BadPeriod(f64),
    /// Nothing to work on.
    #[error("{0}")]
    Empty(String),
}

/// The central difference of a series, one-sided at its ends.
fn central_difference(series: &[f64], period_s: f64) -> Vec<f64> {
    let n = series.len();
    let at = |i: usize| series.get(i).copied().unwrap_or(0.0);
    let slope = |i: usize| {
        let (a, b) = (i.saturating_sub(1), (i + 1).min(n.saturating_sub(1)));
        if b > a { (at(b) - at(a)) / (period_s * (b - a) as f64) } else { 0.0 }
    };
    (0..n).map(slope).collect()
}

impl Drive {
    /// Inputs in the order of the simulation's inputs, each with one value for each sample; `len` samples (needed where a
    /// simulation has no input).
    ///
    /// # Errors
    /// Unequal lengths, a value that is not finite, a bad period.
    pub fn new(start_s: f64, period_s: f64, len: usize, inputs: Vec<Vec<f64>>) -> Result<Self, DataError> {
        if !(period_s.is_finite() && period_s > 0.0) {
            return Err(DataError::BadPeriod(period_s));
        }
        for (i, series) in inputs.iter().enumerate() {
            if series.len() != len {
                return Err(DataError::UnequalLengths(series.len(), len));
            }
            if let Some(at) = series.iter().position(|x| !x.is_finite()) {
                return Err(DataError::NotFinite { what: format!("input {i}"), at });
            }
        }
        let rates = inputs.iter().map(|series| central_difference(series, period_s)).collect();
        Ok(Self { start_s, period_s, len, inputs, rates })
    }

    /// The inputs that a simulation needs, from samples `range` of a recording.
    ///
    /// # Errors
    /// A column that is not there or misses samples in the range.
    pub fn from_recording(
        compiled: &Compiled,
        recording: &Recording,
        range: std::ops::Range<usize>,
    ) -> Result<Self, DataError> {
        let mut inputs = Vec::new();
        for input in &compiled.simulation.inputs {
            let samples = column(recording, &input.column, "an input")?.get(range.clone());
            let samples = samples.ok_or_else(|| DataError::Empty(format!("no samples {range:?}")))?;
            if let Some(at) = samples.iter().position(|x| !x.is_finite()) {
                return Err(DataError::NotFinite { what: format!("column `{}`", input.column), at: range.start + at });
            }
            inputs.push(samples.to_vec());
        }
        let period_s = match compiled.simulation.time.clock {
            ClockSource::Period(period_s) => period_s,
            ClockSource::Column(_) => recording.clock().period_s,
        };
        let start_s = recording.clock().start_s + period_s * range.start as f64;
        Self::new(start_s, period_s, range.len(), inputs)
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there is not a single sample.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// The sampling period in seconds.
    pub fn period_s(&self) -> f64 {
        self.period_s
    }

    /// The time of the first sample in seconds.
    pub fn start_s(&self) -> f64 {
        self.start_s
    }

    /// The inputs, one series each.
    pub fn inputs(&self) -> &[Vec<f64>] {
        &self.inputs
    }
}

/// A recording's column, or the error that names it.
pub(crate) fn column<'a>(recording: &'a Recording, name: &str, role: &'static str) -> Result<&'a [f64], DataError> {
    match recording.channel(name) {
        Some(channel) => Ok(&channel.samples),
        None => Err(DataError::MissingColumn {
            recording: recording.name().to_owned(),
            column: name.to_owned(),
            role,
            present: recording.channels().iter().map(|c| c.name.as_str()).collect::<Vec<_>>().join(" "),
        }),
    }
}
