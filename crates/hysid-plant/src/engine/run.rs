//! What a run needs and what comes out of it.

use super::drive::Drive;

/// `[direction][output][sample]`.
pub(super) type Tangents = Vec<Vec<Vec<f64>>>;

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
    /// The output at fault there, by its number, where the states are all well.
    pub diverged_output: Option<usize>,
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
