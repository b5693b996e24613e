//! What a run needs and what comes out of it.

use hysid_signal::Recording;

use super::Compiled;
use super::integrate::{Machine, Tangents};
use crate::document::ClockSource;
use crate::number::{Dual, Single};

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

/// Where a signal can enter a simulation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Slot {
    /// Added to an input (by number).
    Input(usize),
    /// Added to a state's derivative (by number).
    State(usize),
    /// Added to an output (by number).
    Output(usize),
}

/// A series added at a slot: one value for each sample, between samples as the inputs are.
#[derive(Debug, Clone, Copy)]
pub struct Injection<'a> {
    /// Where.
    pub slot: Slot,
    /// One value for each sample; missing ones count as 0.
    pub series: &'a [f64],
}

/// The values of the states at the first sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Start<'a> {
    /// As the document says; the values are those of the free states, in their order (missing ones are 0).
    Document(&'a [f64]),
    /// These values, one for each state.
    States(&'a [f64]),
}

/// Correction of the states towards a measurement at every sample: `x += gain (y - y_hat)`.
///
/// Gain 0 is the free run, a large gain follows the measurement (prediction).
#[derive(Debug, Clone, Copy)]
pub struct Observer<'a> {
    /// `gain[i * n_outputs + j]`: state `i` per unit of output `j`.
    pub gain: &'a [f64],
    /// Measured outputs, one series each; a missing sample (`NaN`) corrects nothing.
    pub measured: &'a [Vec<f64>],
}

/// One run.
#[derive(Debug, Clone, Copy)]
pub struct Run<'a> {
    /// The inputs.
    pub drive: &'a Drive,
    /// Parameter values, in the document's order.
    pub theta: &'a [f64],
    /// States at the first sample.
    pub start: Start<'a>,
    /// Integration steps in each sampling period (at least 1).
    pub substeps: usize,
    /// Signals added at slots.
    pub injections: &'a [Injection<'a>],
    /// Correction towards a measurement.
    pub observer: Option<Observer<'a>>,
}

impl<'a> Run<'a> {
    /// A free run from the document's start with 4 steps in each period.
    pub fn new(drive: &'a Drive, theta: &'a [f64]) -> Self {
        Self { drive, theta, start: Start::Document(&[]), substeps: 4, injections: &[], observer: None }
    }

    /// The same from this start.
    pub fn from(self, start: Start<'a>) -> Self {
        Self { start, ..self }
    }

    /// The same with this many integration steps in each period.
    pub fn with_substeps(self, substeps: usize) -> Self {
        Self { substeps, ..self }
    }

    /// The same with these signals added.
    pub fn injecting(self, injections: &'a [Injection<'a>]) -> Self {
        Self { injections, ..self }
    }

    /// The same with correction towards a measurement.
    pub fn observing(self, observer: Observer<'a>) -> Self {
        Self { observer: Some(observer), ..self }
    }
}

/// The trajectories of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Response {
    /// One series for each output; `NaN` from where it diverged.
    pub outputs: Vec<Vec<f64>>,
    /// One series for each state (before any correction at that sample); `NaN` from where it diverged.
    pub states: Vec<Vec<f64>>,
    /// The first sample at which something was not finite or beyond 1e100.
    pub diverged: Option<usize>,
}

/// What a response is differentiated by.
#[derive(Debug, Clone, Copy)]
pub enum Direction<'a> {
    /// A parameter, by number.
    Parameter(usize),
    /// A state's value at the first sample, by the state's number.
    Initial(usize),
    /// The amplitude (at 0) of a signal added at a slot.
    Injection(Injection<'a>),
}

/// A response and its derivatives.
#[derive(Debug, Clone, PartialEq)]
pub struct Sensitivity {
    /// The response itself.
    pub response: Response,
    /// `tangents[direction][output][sample]`.
    pub tangents: Vec<Vec<Vec<f64>>>,
}

impl Compiled {
    /// The outputs and states of a run.
    pub fn simulate(&self, run: &Run<'_>) -> Response {
        self.machine::<f64>(run, &[]).0
    }

    /// The outputs of a run with their derivatives, by forward differentiation through every step and every event.
    pub fn sensitivities(&self, run: &Run<'_>, directions: &[Direction<'_>]) -> Sensitivity {
        let mut response = None;
        let mut tangents = Vec::with_capacity(directions.len());
        let mut rest = directions;
        while !rest.is_empty() {
            let (chunk, next) = rest.split_at(rest.len().min(8));
            let (r, t) = match chunk.len() {
                1 => self.machine::<Dual<1>>(run, chunk),
                2 => self.machine::<Dual<2>>(run, chunk),
                3..=4 => self.machine::<Dual<4>>(run, chunk),
                _ => self.machine::<Dual<8>>(run, chunk),
            };
            tangents.extend(t);
            response = Some(r);
            rest = next;
        }
        Sensitivity { response: response.unwrap_or_else(|| self.simulate(run)), tangents }
    }

    /// The states at the first sample for these parameters; free ones are 0.
    pub(crate) fn first_states(&self, drive: &Drive, theta: &[f64]) -> Vec<f64> {
        let one = drive.shortened(1);
        let response = self.simulate(&Run::new(&one, theta));
        response.states.iter().map(|s| s.first().copied().unwrap_or(f64::NAN)).collect()
    }

    fn machine<N: Single>(&self, run: &Run<'_>, directions: &[Direction<'_>]) -> (Response, Tangents) {
        Machine::<N>::new(self, run, directions).run()
    }
}
