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

/// Share of an output (rms about its mean) that a simulation leaves which explains next to nothing of it.
const NEXT_TO_NOTHING: f64 = 0.7;

impl Picture {
    /// The outputs of which the recalibrated simulation explains next to nothing in a recording that it was fitted to, each with the share (rms about the
    /// mean) that it leaves.
    pub fn unexplained(&self) -> Vec<(&str, f64)> {
        let mut found: Vec<(&str, f64)> = Vec::new();
        for record in self.records.iter().filter(|r| r.role == Role::Estimation) {
            let share = record.left();
            let listed = found.iter().any(|(output, _)| *output == record.output);
            if share > NEXT_TO_NOTHING && !listed {
                found.push((&record.output, share));
            }
        }
        found
    }
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

impl RecordPicture {
    /// The share of what was recorded (rms about its mean) that the recalibrated simulation leaves; `NaN` where nothing was both recorded and simulated.
    fn left(&self) -> f64 {
        let both = self.measured.iter().zip(&self.before).filter(|(y, s)| y.is_finite() && s.is_finite());
        let both: Vec<(f64, f64)> = both.map(|(y, s)| (*y, *s)).collect();
        let mean = both.iter().map(|(y, _)| y).sum::<f64>() / both.len() as f64;
        let squares = |of: &dyn Fn(f64, f64) -> f64| both.iter().map(|&(y, s)| of(y, s).powi(2)).sum::<f64>();
        (squares(&|y, s| y - s) / squares(&|y, _| y - mean)).sqrt()
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    fn record(role: Role, before: Vec<f64>) -> RecordPicture {
        RecordPicture {
            recording: "est.csv".into(),
            output: "x_m".into(),
            unit: "m".into(),
            role,
            place: 0,
            samples: (0..4).collect(),
            scored: vec![false; 4],
            time_s: vec![0.0, 1.0, 2.0, 3.0],
            measured: vec![11.0, 9.0, 11.0, f64::NAN],
            before,
            after: None,
            noise_rms: 0.1,
            every: 1,
        }
    }

    #[test]
    fn a_mean_explains_nothing_and_the_hold_out_is_not_asked() {
        let shares = |role, before: [f64; 4]| -> Vec<f64> {
            let picture = Picture { records: vec![record(role, before.to_vec())], ..Picture::default() };
            picture.unexplained().iter().map(|(_, share)| *share).collect()
        };
        let mean = 31.0 / 3.0;
        let left = shares(Role::Estimation, [mean; 4]);
        assert!(left.len() == 1 && (left[0] - 1.0).abs() < 1e-12, "{left:?}");
        assert!(shares(Role::Estimation, [10.9, 9.1, 11.0, 3.0]).is_empty());
        assert!(shares(Role::HoldOut, [mean; 4]).is_empty());
        assert!(shares(Role::Estimation, [f64::NAN; 4]).is_empty(), "nothing was simulated");
    }
}
