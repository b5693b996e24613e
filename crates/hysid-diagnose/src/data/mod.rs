//! The data set of a diagnosis: recordings cut into stretches that can be simulated in one go, and the stack of their outputs.
//!
//! A stretch is a run of samples in which no input is missing; outputs may have gaps inside (their rows are left out). Each stretch has
//! its own initial state. Rows are ordered by stretch, then output, then time.

mod cut;
pub mod glitches;
pub mod intake;
pub mod plant;
pub mod steps;
mod thinning;
mod windows;

use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;

use hysid_plant::Drive;

use crate::evidence::{Layout, Series, norm2};

use thinning::{end_of_row, step, thin, together};
pub use windows::held_out_blocks;

/// Gaps cut a recording into stretches; shorter ones than this are left out.
const SHORTEST_STRETCH: usize = 24;
/// Rows of one output shorter than this between gaps are left out.
const SHORTEST_SERIES: usize = 8;
/// Share of the samples that thinning must leave in series.
const KEPT: f64 = 0.9;

/// A run of samples without a missing input.
#[derive(Debug, Clone)]
pub struct Stretch {
    /// Which recording.
    pub recording: usize,
    /// Which of its samples.
    pub samples: Range<usize>,
    /// Time of the first sample, in seconds.
    pub start_s: f64,
    /// The inputs, in the order of the simulation's.
    pub drive: Drive,
    /// One column for each output of the simulation; `NaN` where missing or held out.
    pub outputs: Vec<Vec<f64>>,
    /// The same with nothing held out: what a free initial state may be estimated from.
    pub recorded: Arc<Vec<Vec<f64>>>,
}

impl Stretch {
    /// Number of samples.
    pub fn len(&self) -> usize {
        self.samples.len()
    }

    /// Whether there are no samples.
    pub fn is_empty(&self) -> bool {
        self.samples.is_empty()
    }

    /// Times of the samples, in seconds.
    pub fn times(&self) -> impl Iterator<Item = f64> + '_ {
        (0..self.len()).map(|n| self.start_s + n as f64 * self.drive.period_s())
    }
}

/// All estimation (or all hold-out) data.
#[derive(Debug, Clone)]
pub struct DataSet {
    /// Sampling period of the first recording, in seconds.
    pub period_s: f64,
    /// Names of the recordings.
    pub recordings: Vec<String>,
    /// The stretches.
    pub stretches: Vec<Stretch>,
    /// Samples from one row to the next: 1, or more where the outputs were thinned.
    pub step: usize,
    /// The rows.
    pub layout: Layout,
    /// The stacked measured outputs.
    pub y: Vec<f64>,
    /// Sentences about gaps and what was left out.
    pub notes: Vec<String>,
}

impl DataSet {
    fn from_stretches(
        period_s: f64,
        recordings: Vec<String>,
        stretches: Vec<Stretch>,
        outputs: usize,
        notes: Vec<String>,
        step: usize,
    ) -> Self {
        let mut layout = Layout { series: Vec::new(), outputs };
        let mut y = Vec::new();
        for (stretch, s) in stretches.iter().enumerate() {
            for (output, column) in s.outputs.iter().enumerate() {
                for range in runs(column.iter().map(|v| v.is_finite())) {
                    let count = range.len().div_ceil(step);
                    if count < SHORTEST_SERIES {
                        continue;
                    }
                    let rows = y.len()..y.len() + count;
                    let last = range.start + (count - 1) * step;
                    y.extend_from_slice(&thin(&column[range.start..=last], step));
                    layout.series.push(Series { stretch, output, first: range.start, rows });
                }
            }
        }
        Self { period_s, recordings, stretches, step, layout, y, notes }
    }

    /// One stretch with these inputs and outputs (`outputs[output][sample]`).
    pub fn of_drive(drive: Drive, outputs: Vec<Vec<f64>>, period_s: f64) -> Self {
        let count = outputs.len();
        let recorded = Arc::new(outputs.clone());
        let stretch =
            Stretch { recording: 0, samples: 0..drive.len(), start_s: drive.start_s(), drive, outputs, recorded };
        Self::from_stretches(period_s, vec![String::new()], vec![stretch], count, Vec::new(), 1)
    }

    /// The place of the longest stretch.
    pub fn longest(&self) -> Option<usize> {
        (0..self.stretches.len()).max_by_key(|&at| self.stretches[at].len())
    }

    /// Number of samples to simulate.
    pub fn samples(&self) -> usize {
        self.stretches.iter().map(Stretch::len).sum()
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.y.len()
    }

    /// Share of the rows that lie before a moment, in seconds on the recordings' clock.
    pub fn share_before(&self, moment_s: f64) -> f64 {
        let before = |s: &Series| self.time_of_rows(s).filter(|t| *t < moment_s).count();
        self.layout.series.iter().map(before).sum::<usize>() as f64 / self.rows().max(1) as f64
    }

    /// Stacks simulated outputs (`outputs[stretch][output][sample]`) in the order of the rows.
    pub fn stack(&self, outputs: &[Vec<Vec<f64>>]) -> Vec<f64> {
        let mut out = Vec::with_capacity(self.rows());
        for s in &self.layout.series {
            out.extend_from_slice(&self.rows_of(s, &outputs[s.stretch][s.output]));
        }
        out
    }

    /// The rows of a series from the samples of its stretch.
    pub fn rows_of<'a>(&self, series: &Series, samples: &'a [f64]) -> Cow<'a, [f64]> {
        let last = series.first + series.rows.len().saturating_sub(1) * self.step;
        thin(&samples[series.first..=last], self.step)
    }

    /// The outputs of a stretch at the last sample of each row, which tells nothing of the row itself to what follows; `NaN` elsewhere.
    pub fn last_of_rows(&self, stretch: usize) -> Vec<Vec<f64>> {
        let outputs = &self.stretches[stretch].outputs;
        let mut last: Vec<Vec<f64>> = outputs.iter().map(|y| vec![f64::NAN; y.len()]).collect();
        for s in self.layout.series.iter().filter(|s| s.stretch == stretch) {
            let ends = (0..s.rows.len()).map(|row| s.first + row * self.step + end_of_row(self.step));
            for n in ends.filter(|n| *n < outputs[s.output].len()) {
                last[s.output][n] = outputs[s.output][n];
            }
        }
        last
    }

    /// The stacked outputs, each less its mean.
    pub fn about_means(&self) -> Vec<f64> {
        let mut y = self.y.clone();
        for output in 0..self.layout.outputs {
            let series = || self.layout.series.iter().filter(move |s| s.output == output);
            let count: usize = series().map(|s| s.rows.len()).sum();
            let mean = series().flat_map(|s| &self.y[s.rows.clone()]).sum::<f64>() / count.max(1) as f64;
            series().for_each(|s| y[s.rows.clone()].iter_mut().for_each(|y| *y -= mean));
        }
        y
    }

    /// The unit in which errors of each output are compared with those of others: its rms about its mean, one where it does not vary.
    pub fn scales(&self) -> Vec<f64> {
        let rms = self.layout.rms(&self.about_means());
        rms.into_iter().map(|s| if s > 0.0 && s.is_finite() { s } else { 1.0 }).collect()
    }

    /// Sum of squares of a stack, each output in units of [`Self::scales`].
    pub fn relative_squares(&self, stack: &[f64]) -> f64 {
        let scales = self.scales();
        self.layout.series.iter().map(|s| norm2(&stack[s.rows.clone()]) / scales[s.output].powi(2)).sum()
    }

    /// Time from one row to the next, in seconds.
    pub fn row_period_s(&self) -> f64 {
        self.period_s * self.step as f64
    }

    /// Times of the rows of a series, in seconds.
    pub fn time_of_rows(&self, series: &Series) -> impl Iterator<Item = f64> + '_ {
        let start = self.stretches[series.stretch].start_s;
        let (first, step) = (series.first, self.step);
        let period_s = self.stretches[series.stretch].drive.period_s();
        (0..series.rows.len()).map(move |n| start + (first + n * step) as f64 * period_s)
    }

    /// The same data with only those rows for which `wanted(stretch, sample, samples of the stretch)` holds; the inputs stay.
    pub fn keep(&self, wanted: impl Fn(usize, usize, usize) -> bool) -> Self {
        let mut stretches = self.stretches.clone();
        for (i, s) in stretches.iter_mut().enumerate() {
            let len = s.len();
            for column in &mut s.outputs {
                column.iter_mut().enumerate().filter(|(n, _)| !wanted(i, *n, len)).for_each(|(_, y)| *y = f64::NAN);
            }
        }
        let notes = self.notes.clone();
        Self::from_stretches(self.period_s, self.recordings.clone(), stretches, self.layout.outputs, notes, self.step)
    }

    /// Samples for each row that the outputs need.
    pub fn own_step(&self) -> usize {
        let outputs = || self.stretches.iter().flat_map(|s| s.outputs.iter().map(Vec::as_slice));
        let wanted = step(outputs(), self.period_s, self.samples());
        let fed_back = |s: &Stretch| s.drive.inputs().iter().any(|u| s.outputs.iter().any(|y| together(u, y, wanted)));
        if wanted > 1 && (self.stretches.iter().any(fed_back) || (0..self.layout.outputs).any(|o| self.is_in_steps(o)))
        {
            return 1;
        }
        // Between gaps there must be rows enough: what is too short for a series is left out.
        let lengths: Vec<usize> =
            outputs().flat_map(|y| runs(y.iter().map(|v| v.is_finite()))).map(|r| r.len()).collect();
        let in_rows = |step: usize| -> usize {
            lengths
                .iter()
                .map(|n| n.div_ceil(step))
                .filter(|rows| *rows >= SHORTEST_SERIES)
                .map(|rows| rows * step)
                .sum()
        };
        let most = in_rows(1) as f64;
        (2..=wanted).rev().find(|step| in_rows(*step) as f64 >= KEPT * most).unwrap_or(1)
    }

    /// The same data with as few rows as its signals need.
    pub fn thinned(&self) -> Cow<'_, Self> {
        let step = self.own_step();
        if step == 1 {
            return Cow::Borrowed(self);
        }
        let mut notes = self.notes.clone();
        notes.push(format!("means of the outputs over {step} samples are compared: nothing in them moves faster"));
        let (recordings, stretches) = (self.recordings.clone(), self.stretches.clone());
        Cow::Owned(Self::from_stretches(self.period_s, recordings, stretches, self.layout.outputs, notes, step))
    }

    /// The first samples of each stretch (this share of them), those included that are held out elsewhere.
    pub fn head(&self, share: f64) -> Self {
        let mut all = self.clone();
        all.stretches.iter_mut().for_each(|s| s.outputs.clone_from(&s.recorded));
        all.keep(|_, n, len| (n as f64) < share * len as f64)
    }

    /// The same data with so many further inputs, zero throughout.
    pub fn with_still_inputs(&self, count: usize) -> Self {
        let still: Vec<Vec<f64>> = self.stretches.iter().map(|s| vec![0.0; s.len()]).collect();
        self.with_further_inputs(&vec![still; count])
    }

    /// The same data with further inputs, finite at each sample of each stretch: `[input][stretch][sample]`.
    pub fn with_further_inputs(&self, further: &[Vec<Vec<f64>>]) -> Self {
        let mut out = self.clone();
        for (i, s) in out.stretches.iter_mut().enumerate() {
            let mut inputs = s.drive.inputs().to_vec();
            inputs.extend(further.iter().filter_map(|input| input.get(i).cloned()));
            // A good drive with finite series beside it is a good drive.
            if let Ok(drive) = Drive::new(s.drive.start_s(), s.drive.period_s(), s.len(), inputs) {
                s.drive = drive;
            }
        }
        out
    }

    /// Moves a measured sample of a series, where each row is one.
    fn move_sample(&mut self, series: &Series, n: usize, by: f64) {
        self.y[series.rows.start + n] += by;
        let stretch = &mut self.stretches[series.stretch];
        stretch.outputs[series.output][series.first + n] += by;
        Arc::make_mut(&mut stretch.recorded)[series.output][series.first + n] += by;
    }

    /// The same inputs with other measured outputs (in the order of the rows).
    pub fn with_outputs(&self, y: Vec<f64>) -> Self {
        let mut out = self.clone();
        // Rows of thinned outputs are no samples; the rows alone are compared.
        for s in self.layout.series.iter().filter(|_| self.step == 1) {
            out.stretches[s.stretch].outputs[s.output][s.first..s.first + s.rows.len()]
                .copy_from_slice(&y[s.rows.clone()]);
        }
        out.stretches.iter_mut().for_each(|s| s.recorded = Arc::new(s.outputs.clone()));
        out.y = y;
        out
    }
}

/// The runs of `true`.
fn runs(good: impl Iterator<Item = bool>) -> Vec<Range<usize>> {
    let mut out = Vec::new();
    let (mut start, mut n) = (None, 0);
    for g in good {
        match (g, start) {
            (true, None) => start = Some(n),
            (false, Some(s)) => {
                out.push(s..n);
                start = None;
            }
            _ => {}
        }
        n += 1;
    }
    if let Some(s) = start {
        out.push(s..n);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::samples::{ramp, recording, simulation};
    use super::*;

    #[test]
    fn the_share_before_a_moment_counts_the_rows_of_all_recordings() {
        let both = [recording(ramp(100), ramp(100)), recording(ramp(300), ramp(300))];
        let data = DataSet::new(&simulation(), &both, 3).unwrap();
        // Both begin at zero, with a sample in each tenth of a second.
        let check = |moment: f64, rows: usize| assert_eq!(data.share_before(moment), rows as f64 / 400.0, "{moment}");
        check(-1.0, 0);
        check(2.05, 42);
        check(9.95, 200);
        check(20.05, 301);
        check(99.0, 400);
    }
}

/// What the tests of this module share.
#[cfg(test)]
mod samples {
    use hysid_plant::Simulation;
    use hysid_signal::{Channel, Clock, Recording};

    pub fn simulation() -> Simulation {
        Simulation::parse(
            "[time]\nperiod_s = 0.1\n[inputs]\nu = \"u_N\"\n[parameters]\nk = { value = 1.0, min = 0.0 }\n[outputs]\ny_m = \"k*u\"\n",
            "test.sim.toml",
        )
        .unwrap()
    }

    pub fn recording(u: Vec<f64>, y: Vec<f64>) -> Recording {
        let channels = vec![Channel { name: "u_N".into(), samples: u }, Channel { name: "y_m".into(), samples: y }];
        Recording::new("r.csv", Clock { start_s: 0.0, period_s: 0.1 }, channels).unwrap()
    }

    pub fn ramp(n: usize) -> Vec<f64> {
        (0..n).map(|i| i as f64).collect()
    }
}
