//! Measured data beside the inputs that made them.

use hysid_signal::Recording;

use crate::document::{ClockSource, Initial};
use crate::engine::{Compiled, DataError, Drive, column};

/// Fewest samples that a stretch between gaps must have to be used.
const FEWEST: usize = 8;

/// One stretch of a recording in which no input is missing: inputs, measured outputs, and what is known of its start.
#[derive(Debug, Clone, PartialEq)]
pub struct Data {
    /// The recording's name.
    pub name: String,
    /// Number of the stretch's first sample in the recording.
    pub offset: usize,
    /// The inputs.
    pub drive: Drive,
    /// Measured outputs, one series for each; `NaN` where missing.
    pub measured: Vec<Vec<f64>>,
    /// Numbers of the states whose value at the first sample is estimated.
    pub free: Vec<usize>,
}

impl Data {
    /// Measured outputs with their inputs; the free states are those of the document.
    ///
    /// # Errors
    /// The wrong number of series or unequal lengths.
    pub fn new(compiled: &Compiled, name: &str, drive: Drive, measured: Vec<Vec<f64>>) -> Result<Self, DataError> {
        let (inputs, _, outputs) = compiled.sizes();
        let count = |what, given, expected| {
            if given == expected { Ok(()) } else { Err(DataError::WrongCount { what, given, expected }) }
        };
        count("inputs", drive.inputs().len(), inputs)?;
        count("outputs", measured.len(), outputs)?;
        if let Some(series) = measured.iter().find(|s| s.len() != drive.len()) {
            return Err(DataError::UnequalLengths(series.len(), drive.len()));
        }
        Ok(Self { name: name.to_owned(), offset: 0, drive, measured, free: compiled.free_states() })
    }

    /// The stretches of a recording between gaps in the inputs. The first stretch starts as the document says, where it
    /// starts with the recording; after a gap nothing is known of the states, and all are free.
    ///
    /// # Errors
    /// A column that the recording lacks, or nothing left to use.
    pub fn from_recording(compiled: &Compiled, recording: &Recording) -> Result<Vec<Self>, DataError> {
        let simulation = compiled.simulation();
        for input in &simulation.inputs {
            column(recording, &input.column, "an input")?;
        }
        for output in &simulation.outputs {
            column(recording, &output.column, "an output")?;
        }
        let names: Vec<&str> = simulation.inputs.iter().map(|i| i.column.as_str()).collect();
        let segments =
            if names.is_empty() { std::iter::once(0..recording.len()).collect() } else { recording.segments(&names) };
        let mut all = Vec::new();
        for range in segments.into_iter().filter(|r| r.len() >= FEWEST) {
            let drive = Drive::from_recording(compiled, recording, range.clone())?;
            let mut measured = Vec::new();
            for output in &simulation.outputs {
                let samples = column(recording, &output.column, "an output")?.get(range.clone()).unwrap_or_default();
                measured.push(samples.to_vec());
            }
            let mut data = Self::new(compiled, recording.name(), drive, measured)?;
            data.offset = range.start;
            if range.start > 0 {
                data.free = (0..simulation.states.len()).collect();
            }
            all.push(data);
        }
        let present = all.iter().any(|d: &Data| d.measured.iter().all(|s| s.iter().any(|y| y.is_finite())));
        if !present {
            let message = format!(
                "recording `{}` has no stretch of {FEWEST} samples in which inputs and outputs are there",
                recording.name()
            );
            return Err(DataError::Empty(message));
        }
        Ok(all)
    }

    /// The first `len` samples.
    pub fn shortened(&self, len: usize) -> Self {
        let cut = |s: &Vec<f64>| s.get(..len).unwrap_or(s).to_vec();
        Self { drive: self.drive.shortened(len), measured: self.measured.iter().map(cut).collect(), ..self.clone() }
    }

    /// Samples `range`, all states free unless the range starts where this stretch does.
    pub fn part(&self, compiled: &Compiled, range: std::ops::Range<usize>) -> Option<Self> {
        let cut = |s: &Vec<f64>| s.get(range.clone()).map(<[f64]>::to_vec);
        let inputs = self.drive.inputs().iter().map(cut).collect::<Option<Vec<_>>>()?;
        let measured = self.measured.iter().map(cut).collect::<Option<Vec<_>>>()?;
        let period_s = self.drive.period_s();
        let start_s = self.drive.start_s() + period_s * range.start as f64;
        let drive = Drive::new(start_s, period_s, range.len(), inputs).ok()?;
        let free = if range.start == 0 { self.free.clone() } else { (0..compiled.sizes().1).collect() };
        Some(Self { name: self.name.clone(), offset: self.offset + range.start, drive, measured, free })
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.drive.len()
    }

    /// Whether there is not a single sample.
    pub fn is_empty(&self) -> bool {
        self.drive.is_empty()
    }

    /// The states at the first sample: the document's, with the free ones set to `initial` (in the order of `free`).
    pub fn start_states(&self, compiled: &Compiled, theta: &[f64], initial: &[f64]) -> Vec<f64> {
        let mut x = compiled.start_states(theta);
        for (&i, value) in self.free.iter().zip(initial) {
            if let Some(slot) = x.get_mut(i) {
                *slot = *value;
            }
        }
        x
    }
}

impl Compiled {
    /// The states at the first sample as the document says; free ones are 0.
    pub fn start_states(&self, theta: &[f64]) -> Vec<f64> {
        let states = &self.simulation().states;
        if states.iter().any(|s| matches!(s.initial, Initial::Expr(_))) {
            let inputs = vec![vec![0.0]; self.sizes().0];
            if let Ok(drive) = Drive::new(0.0, 1.0, 1, inputs) {
                return self.first_states(&drive, theta);
            }
        }
        let value = |s: &crate::document::State| match s.initial {
            Initial::Number(x) => x,
            _ => 0.0,
        };
        states.iter().map(value).collect()
    }

    /// Whether the recording has a time column of its own.
    pub fn time_column(&self) -> Option<&str> {
        match &self.simulation().time.clock {
            ClockSource::Column(column) => Some(column),
            ClockSource::Period(_) => None,
        }
    }
}
