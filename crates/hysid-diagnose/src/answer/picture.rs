//! What a report draws: the series behind a verdict, as plain vectors with their units. Nothing here is decided or drawn.
//!
//! Every series of one entry has the same length. A sample that is missing or was not simulated is `NaN`.

use crate::model::base::Interval;

/// All that a report of one diagnosis shows beside the verdict itself.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Picture {
    /// The simulation's title.
    pub title: String,
    /// One entry for each recording and output, estimation first, then hold-out.
    pub records: Vec<RecordPicture>,
    /// Where over the operating region the mismatch lives.
    pub maps: Vec<MapPicture>,
    /// The residual over frequency, one entry for each output.
    pub spectra: Vec<SpectrumPicture>,
    /// The laws or loops that were found.
    pub laws: Vec<LawPicture>,
    /// The simulation's own parameters, before and after.
    pub parameters: Vec<ParameterPicture>,
}

/// One output of one recording over time.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordPicture {
    /// The file.
    pub recording: String,
    /// The output's column.
    pub output: String,
    /// Its unit; empty where it has none.
    pub unit: String,
    /// What the recording was used for.
    pub role: Role,
    /// Its place among the recordings of its role.
    pub place: usize,
    /// The recording's sample (counted from 0) of each entry.
    pub samples: Vec<usize>,
    /// Whether an entry counts for the free-run error; none does in a recording that was used for the estimation.
    pub scored: Vec<bool>,
    /// Time in seconds.
    pub time_s: Vec<f64>,
    /// What was recorded.
    pub measured: Vec<f64>,
    /// The recalibrated simulation, in free run.
    pub before: Vec<f64>,
    /// The augmented simulation, in free run.
    pub after: Option<Vec<f64>>,
    /// Estimated rms of the noise.
    pub noise_rms: f64,
    /// Samples from one entry to the next: more than one where an entry is a mean over so many.
    pub every: usize,
}

/// What a recording was used for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// Calibration, selection and fit.
    Estimation,
    /// Nothing but the score.
    HoldOut,
}

/// Mean residual over a grid of cells, in units of the noise; `NaN` where no sample fell.
#[derive(Debug, Clone, PartialEq)]
pub struct MapPicture {
    /// The output's column.
    pub output: String,
    /// The horizontal axis, unit included.
    pub x_label: String,
    /// The vertical axis, unit included.
    pub y_label: String,
    /// Borders of the columns, ascending.
    pub x_edges: Vec<f64>,
    /// Borders of the rows, ascending.
    pub y_edges: Vec<f64>,
    /// Before, row by row, the lowest row first.
    pub before: Vec<f64>,
    /// After, likewise.
    pub after: Option<Vec<f64>>,
}

/// Amplitude spectra of the residual of one output.
#[derive(Debug, Clone, PartialEq)]
pub struct SpectrumPicture {
    /// The output's column.
    pub output: String,
    /// Its unit.
    pub unit: String,
    /// Frequencies in hertz.
    pub frequency_hz: Vec<f64>,
    /// Of what was recorded.
    pub measured: Vec<f64>,
    /// Of the residual of the recalibrated simulation.
    pub before: Vec<f64>,
    /// Of the residual of the augmented simulation.
    pub after: Option<Vec<f64>>,
    /// Of the noise.
    pub noise: Vec<f64>,
}

/// A law or loop that was found, such as a force over a velocity.
#[derive(Debug, Clone, PartialEq)]
pub struct LawPicture {
    /// What it is.
    pub title: String,
    /// The horizontal axis, unit included.
    pub x_label: String,
    /// The vertical axis, unit included.
    pub y_label: String,
    /// The points in order of time.
    pub points: Vec<(f64, f64)>,
}

/// One parameter of the simulation before and after.
#[derive(Debug, Clone, PartialEq)]
pub struct ParameterPicture {
    /// Its name.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// The user's value; `None` for a parameter that an effect brought.
    pub given: Option<f64>,
    /// As it was calibrated without the effects.
    pub before: Option<Interval>,
    /// As it was fitted with the effects.
    pub after: Option<Interval>,
    /// A remark, such as that it lies at a bound.
    pub remark: String,
}
