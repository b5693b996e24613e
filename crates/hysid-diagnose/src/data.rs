//! The data set of a diagnosis: recordings cut into stretches that can be simulated in one go, and the stack of their outputs.
//!
//! A stretch is a run of samples in which no input is missing; outputs may have gaps inside (their rows are left out). Each stretch has
//! its own initial state. Rows are ordered by stretch, then output, then time.

use std::ops::Range;

use hysid_plant::{ClockSource, Drive, Simulation};
use hysid_signal::Recording;

use crate::error::DiagnoseError;
use crate::evidence::{Layout, Series};

/// Gaps cut a recording into stretches; shorter ones than this are left out.
const SHORTEST_STRETCH: usize = 24;
/// Rows of one output shorter than this between gaps are left out.
const SHORTEST_SERIES: usize = 8;

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
    /// One column for each output of the simulation; `NaN` where missing.
    pub outputs: Vec<Vec<f64>>,
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
    /// The rows.
    pub layout: Layout,
    /// The stacked measured outputs.
    pub y: Vec<f64>,
    /// Sentences about gaps and what was left out.
    pub notes: Vec<String>,
}

impl DataSet {
    /// The data that `simulation` can be judged on.
    ///
    /// # Errors
    /// No recording, a missing column, a constant output, unequal sampling periods, too few samples.
    pub fn new(
        simulation: &Simulation,
        recordings: &[Recording],
        free_parameters: usize,
    ) -> Result<Self, DiagnoseError> {
        let first = recordings.first().ok_or(DiagnoseError::NoRecording)?;
        let declared = match simulation.time.clock {
            ClockSource::Period(p) => Some(p),
            ClockSource::Column(_) => None,
        };
        let period_s = declared.unwrap_or(first.clock().period_s);
        let inputs: Vec<&str> = simulation.inputs.iter().map(|i| i.column.as_str()).collect();
        let outputs: Vec<&str> = simulation.outputs.iter().map(|o| o.column.as_str()).collect();
        let mut stretches = Vec::new();
        let mut notes = Vec::new();
        let states = simulation.states.len();
        for (index, r) in recordings.iter().enumerate() {
            // Each recording keeps its own clock; what is told in seconds or hertz for all of them goes by the first.
            let own_period_s = declared.unwrap_or(r.clock().period_s);
            if (own_period_s - period_s).abs() > 1e-4 * period_s
                && !notes.iter().any(|n: &String| n.starts_with("the recordings have"))
            {
                notes.push(
                    "the recordings have different sampling periods; frequencies are told for that of the first".into(),
                );
            }
            let column = |name: &str| {
                r.channel(name).map(|c| c.samples.as_slice()).ok_or_else(|| DiagnoseError::MissingColumn {
                    recording: r.name().to_owned(),
                    column: name.to_owned(),
                    available: r.channels().iter().map(|c| format!("`{}`", c.name)).collect::<Vec<_>>().join(", "),
                })
            };
            let u = inputs.iter().map(|n| column(n)).collect::<Result<Vec<_>, _>>()?;
            let y = outputs.iter().map(|n| column(n)).collect::<Result<Vec<_>, _>>()?;
            let complete = |n: usize| u.iter().all(|c| c[n].is_finite());
            let measured = |n: usize| y.iter().any(|c| c[n].is_finite());
            let usable = (0..r.len()).filter(|&n| complete(n) && measured(n)).count();
            let needed = (3 * (free_parameters + states)).max(SHORTEST_STRETCH);
            if usable < needed {
                return Err(DiagnoseError::TooFewSamples {
                    recording: r.name().to_owned(),
                    found: usable,
                    parameters: free_parameters,
                    needed,
                });
            }
            for (name, column) in outputs.iter().zip(&y) {
                let mut values = column.iter().copied().filter(|v| v.is_finite());
                if let Some(value) = values.next()
                    && values.all(|v| v == value)
                {
                    return Err(DiagnoseError::ConstantOutput {
                        recording: r.name().to_owned(),
                        column: (*name).to_owned(),
                        value,
                    });
                }
            }
            let before = stretches.len();
            let mut dropped = 0;
            for range in runs((0..r.len()).map(complete)) {
                if range.len() < SHORTEST_STRETCH {
                    dropped += range.len();
                    continue;
                }
                let start_s = r.clock().start_s + own_period_s * range.start as f64;
                let inputs = u.iter().map(|c| c[range.clone()].to_vec()).collect();
                stretches.push(Stretch {
                    recording: index,
                    start_s,
                    drive: Drive::new(start_s, own_period_s, range.len(), inputs)
                        .map_err(|e| DiagnoseError::Simulation { file: r.name().to_owned(), problem: e.to_string() })?,
                    outputs: y.iter().map(|c| c[range.clone()].to_vec()).collect(),
                    samples: range,
                });
            }
            let missing = y.iter().flat_map(|c| c.iter()).filter(|v| !v.is_finite()).count();
            let cut = stretches.len() - before;
            if cut > 1 || dropped > 0 || missing > 0 {
                notes.push(format!(
                    "{}: used in {cut} stretch{} because samples are missing ({missing} missing output values; {dropped} samples in stretches that are too short)",
                    r.name(),
                    if cut == 1 { "" } else { "es" },
                ));
            }
        }
        Ok(Self::from_stretches(
            period_s,
            recordings.iter().map(|r| r.name().to_owned()).collect(),
            stretches,
            outputs.len(),
            notes,
        ))
    }

    fn from_stretches(
        period_s: f64,
        recordings: Vec<String>,
        stretches: Vec<Stretch>,
        outputs: usize,
        notes: Vec<String>,
    ) -> Self {
        let mut layout = Layout { series: Vec::new(), outputs };
        let mut y = Vec::new();
        for (stretch, s) in stretches.iter().enumerate() {
            for (output, column) in s.outputs.iter().enumerate() {
                for range in runs(column.iter().map(|v| v.is_finite())) {
                    if range.len() < SHORTEST_SERIES {
                        continue;
                    }
                    let rows = y.len()..y.len() + range.len();
                    y.extend_from_slice(&column[range.clone()]);
                    layout.series.push(Series { stretch, output, first: range.start, rows });
                }
            }
        }
        Self { period_s, recordings, stretches, layout, y, notes }
    }

    /// One stretch with these inputs and outputs (`outputs[output][sample]`).
    pub fn of_drive(drive: Drive, outputs: Vec<Vec<f64>>, period_s: f64) -> Self {
        let count = outputs.len();
        let stretch = Stretch { recording: 0, samples: 0..drive.len(), start_s: drive.start_s(), drive, outputs };
        Self::from_stretches(period_s, vec![String::new()], vec![stretch], count, Vec::new())
    }

    /// Number of samples to simulate.
    pub fn samples(&self) -> usize {
        self.stretches.iter().map(Stretch::len).sum()
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.y.len()
    }

    /// Stacks simulated outputs (`outputs[stretch][output][sample]`) in the order of the rows.
    pub fn stack(&self, outputs: &[Vec<Vec<f64>>]) -> Vec<f64> {
        let mut out = Vec::with_capacity(self.rows());
        for s in &self.layout.series {
            out.extend_from_slice(&outputs[s.stretch][s.output][s.first..s.first + s.rows.len()]);
        }
        out
    }

    /// Time of a row, in seconds, with the recording that it is from.
    pub fn time_of_rows(&self, series: &Series) -> impl Iterator<Item = f64> + '_ {
        let start = self.stretches[series.stretch].start_s;
        let first = series.first;
        let period_s = self.stretches[series.stretch].drive.period_s();
        (0..series.rows.len()).map(move |n| start + (first + n) as f64 * period_s)
    }

    /// A data set of at most about `limit` samples: windows of equal length, the first and the last at the ends of the data and the loudest
    /// among them, so that thousands of simulations of a long recording stay affordable. The data set itself where it is short enough.
    pub fn within(&self, limit: usize) -> Self {
        let total = self.samples();
        if total <= limit {
            return self.clone();
        }
        let windows = 4.max(self.stretches.len().min(8));
        let length = (limit / windows).max(SHORTEST_STRETCH);
        let mut chosen: Vec<Stretch> = Vec::new();
        for s in &self.stretches {
            let share = ((windows * s.len()) as f64 / total as f64).round().max(1.0) as usize;
            let length = length.min(s.len());
            let mut starts: Vec<usize> =
                if share == 1 { vec![0] } else { (0..share).map(|i| i * (s.len() - length) / (share - 1)).collect() };
            let power = |start: usize| -> f64 {
                let y = &s.outputs[0][start..start + length];
                let v: Vec<f64> = y.iter().copied().filter(|v| v.is_finite()).collect();
                let mean = v.iter().sum::<f64>() / v.len().max(1) as f64;
                v.iter().map(|x| (x - mean).powi(2)).sum()
            };
            // One window in the middle moves to the loudest place, unless it would overlap the others.
            if share > 2 {
                let loudest = (0..=(s.len() - length) / length.max(1))
                    .map(|i| i * length)
                    .max_by(|a, b| power(*a).total_cmp(&power(*b)));
                if let Some(loudest) = loudest {
                    let middle = share / 2;
                    let clear = starts.iter().enumerate().all(|(i, &o)| i == middle || loudest.abs_diff(o) >= length);
                    if clear {
                        starts[middle] = loudest;
                    }
                }
            }
            starts.sort_unstable();
            starts.dedup_by(|b, a| *b < *a + length);
            for start in starts {
                let range = start..start + length;
                let start_s = s.start_s + start as f64 * s.drive.period_s();
                let inputs = s.drive.inputs().iter().map(|c| c[range.clone()].to_vec()).collect();
                // The parts of a good drive are a good drive.
                let Ok(drive) = Drive::new(start_s, s.drive.period_s(), length, inputs) else { continue };
                chosen.push(Stretch {
                    recording: s.recording,
                    samples: s.samples.start + start..s.samples.start + start + length,
                    start_s,
                    drive,
                    outputs: s.outputs.iter().map(|c| c[range.clone()].to_vec()).collect(),
                });
            }
        }
        let mut notes = self.notes.clone();
        let used: usize = chosen.iter().map(Stretch::len).sum();
        notes.push(format!("of {total} samples the search used {used}, in {} windows", chosen.len()));
        Self::from_stretches(self.period_s, self.recordings.clone(), chosen, self.layout.outputs, notes)
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
        Self::from_stretches(self.period_s, self.recordings.clone(), stretches, self.layout.outputs, self.notes.clone())
    }

    /// The same inputs with other measured outputs (in the order of the rows).
    pub fn with_outputs(&self, y: Vec<f64>) -> Self {
        let mut out = self.clone();
        for s in &self.layout.series {
            out.stretches[s.stretch].outputs[s.output][s.first..s.first + s.rows.len()]
                .copy_from_slice(&y[s.rows.clone()]);
        }
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

/// The rows that are held out of the estimation to veto and to break ties: `1` where a row takes part in the fit, `0` where it is held out.
///
/// Each long series is cut into ten blocks; the third, the sixth and the ninth are held out, and the loudest one if it is none of these.
pub fn held_out_blocks(layout: &Layout, y: &[f64]) -> Vec<f64> {
    let mut weights = vec![1.0; layout.len()];
    for s in &layout.series {
        let n = s.rows.len();
        if n < 100 {
            continue;
        }
        let edges: Vec<usize> = (0..=10).map(|i| i * n / 10).collect();
        let rows = &y[s.rows.clone()];
        let mean = rows.iter().sum::<f64>() / n as f64;
        let power = |i: usize| {
            rows[edges[i]..edges[i + 1]].iter().map(|v| (v - mean).powi(2)).sum::<f64>()
                / (edges[i + 1] - edges[i]) as f64
        };
        let mut out = vec![2, 5, 8];
        if let Some(loudest) = (0..10).max_by(|a, b| power(*a).total_cmp(&power(*b)))
            && !out.contains(&loudest)
            && power(loudest) > 1.5 * power(2).max(power(5)).max(power(8))
        {
            out.push(loudest);
        }
        for i in out {
            weights[s.rows.start + edges[i]..s.rows.start + edges[i + 1]].fill(0.0);
        }
    }
    weights
}

#[cfg(test)]
mod tests {
    use super::*;
    use hysid_signal::{Channel, Clock};

    fn simulation() -> Simulation {
        Simulation::parse(
            "[time]\nperiod_s = 0.1\n[inputs]\nu = \"u_N\"\n[parameters]\nk = { value = 1.0, min = 0.0 }\n[outputs]\ny_m = \"k*u\"\n",
            "test.sim.toml",
        )
        .unwrap()
    }

    fn recording(u: Vec<f64>, y: Vec<f64>) -> Recording {
        let channels = vec![Channel { name: "u_N".into(), samples: u }, Channel { name: "y_m".into(), samples: y }];
        Recording::new("r.csv", Clock { start_s: 0.0, period_s: 0.1 }, channels).unwrap()
    }

    fn ramp(n: usize) -> Vec<f64> {
        (0..n).map(|i| i as f64).collect()
    }

    #[test]
    fn gaps_cut_and_the_stack_knows_its_rows() {
        let mut u = ramp(200);
        let mut y = ramp(200);
        u[100] = f64::NAN;
        y[50] = f64::NAN;
        let d = DataSet::new(&simulation(), &[recording(u, y)], 1).unwrap();
        assert_eq!(d.stretches.len(), 2);
        assert_eq!(d.layout.series.len(), 3);
        assert_eq!(d.rows(), 198);
        assert_eq!(d.notes.len(), 1);
        let outputs: Vec<Vec<Vec<f64>>> = d.stretches.iter().map(|s| s.outputs.clone()).collect();
        assert_eq!(d.stack(&outputs), d.y);
    }

    #[test]
    fn bad_recordings_are_refused_with_a_reason() {
        let s = simulation();
        let e = |r: Recording| DataSet::new(&s, &[r], 1).unwrap_err().to_string();
        assert!(e(recording(ramp(100), vec![2.0; 100])).contains("constant"));
        assert!(e(recording(ramp(10), ramp(10))).contains("usable samples"));
        let other = Recording::new(
            "o.csv",
            Clock { start_s: 0.0, period_s: 0.1 },
            vec![Channel { name: "u_N".into(), samples: ramp(50) }],
        )
        .unwrap();
        assert!(e(other).contains("no column `y_m`"));
        assert!(matches!(DataSet::new(&s, &[], 1), Err(DiagnoseError::NoRecording)));
    }

    #[test]
    fn a_long_recording_is_windowed_from_end_to_end() {
        let n = 10_000;
        let d = DataSet::new(&simulation(), &[recording(ramp(n), (0..n).map(|i| (i as f64 * 0.1).sin()).collect())], 1)
            .unwrap();
        let w = d.within(4000);
        assert!(w.samples() <= 4000 && w.samples() > 2500, "{}", w.samples());
        assert_eq!(w.stretches.first().unwrap().samples.start, 0);
        assert_eq!(w.stretches.last().unwrap().samples.end, n);
    }

    #[test]
    fn three_blocks_of_ten_are_held_out() {
        let layout = Layout { series: vec![Series { stretch: 0, output: 0, first: 0, rows: 0..1000 }], outputs: 1 };
        let y: Vec<f64> = (0..1000).map(|i| (i as f64 * 0.7).sin()).collect();
        assert_eq!(held_out_blocks(&layout, &y).iter().filter(|w| **w == 0.0).count(), 300);
    }
}
