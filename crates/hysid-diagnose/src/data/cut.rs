//! Recordings cut into stretches at the samples where an input is missing, and refused where too little is left.

use std::ops::Range;
use std::sync::Arc;

use hysid_plant::{ClockSource, Drive, Simulation};
use hysid_signal::Recording;

use super::{DataSet, SHORTEST_SERIES, SHORTEST_STRETCH, Stretch, runs};
use crate::error::DiagnoseError;

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
                let outputs: Vec<Vec<f64>> = y.iter().map(|c| c[range.clone()].to_vec()).collect();
                stretches.push(Stretch {
                    recording: index,
                    start_s,
                    drive: Drive::new(start_s, own_period_s, range.len(), inputs)
                        .map_err(|e| DiagnoseError::Simulation { file: r.name().to_owned(), problem: e.to_string() })?,
                    recorded: Arc::new(outputs.clone()),
                    outputs,
                    samples: range,
                });
            }
            let missing = y.iter().flat_map(|c| c.iter()).filter(|v| !v.is_finite()).count();
            let unknown = (0..r.len()).filter(|&i| u.iter().any(|c| !c[i].is_finite())).count();
            let cut = stretches.len() - before;
            let found: usize = stretches[before..].iter().map(rows_in_runs).sum();
            if found < needed {
                return Err(DiagnoseError::TooManyGaps {
                    recording: r.name().to_owned(),
                    found,
                    run: SHORTEST_STRETCH,
                    measured: SHORTEST_SERIES,
                    needed,
                });
            }
            if cut > 1 || dropped > 0 || missing > 0 {
                notes.push(format!(
                    "{}: used in {cut} stretch{} because samples are missing ({} without an input value, which cut it; {missing} output values that are missing, of which each is left out by itself; {dropped} samples in stretches that are too short)",
                    r.name(),
                    if cut == 1 { "" } else { "es" },
                    unknown,
                ));
            }
        }
        Ok(Self::from_stretches(
            period_s,
            recordings.iter().map(|r| r.name().to_owned()).collect(),
            stretches,
            outputs.len(),
            notes,
            1,
        ))
    }
}

/// Rows of the best measured output that take part.
fn rows_in_runs(stretch: &Stretch) -> usize {
    let rows = |column: &Vec<f64>| -> usize {
        runs(column.iter().map(|v| v.is_finite())).iter().map(Range::len).filter(|n| *n >= SHORTEST_SERIES).sum()
    };
    stretch.outputs.iter().map(rows).max().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::super::samples::{ramp, recording, simulation};
    use super::*;
    use hysid_signal::{Channel, Clock};

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
    fn the_head_of_held_out_blocks_is_what_was_recorded() {
        let d = DataSet::new(&simulation(), &[recording(ramp(200), ramp(200))], 1).unwrap();
        let blocks = d.keep(|_, n, _| n >= 100);
        assert_eq!(blocks.rows(), 100);
        assert_eq!(blocks.head(0.05).y, (0..10).map(f64::from).collect::<Vec<_>>());
    }

    #[test]
    fn bad_recordings_are_refused_with_a_reason() {
        let s = simulation();
        let e = |r: Recording| DataSet::new(&s, &[r], 1).unwrap_err().to_string();
        assert!(e(recording(ramp(100), vec![2.0; 100])).contains("constant"));
        assert!(e(recording(ramp(10), ramp(10))).contains("usable samples"));
        let gappy = ramp(100).iter().map(|u| if u % 20.0 == 0.0 { f64::NAN } else { *u }).collect();
        assert!(e(recording(gappy, ramp(100))).contains("only 0 of them lie in runs"));
        let blinking = ramp(100).iter().map(|y| if y % 5.0 == 0.0 { f64::NAN } else { *y }).collect();
        assert!(e(recording(ramp(100), blinking)).contains("only 0 of them lie in runs"));
        let other = Recording::new(
            "o.csv",
            Clock { start_s: 0.0, period_s: 0.1 },
            vec![Channel { name: "u_N".into(), samples: ramp(50) }],
        )
        .unwrap();
        assert!(e(other).contains("no column `y_m`"));
        assert!(matches!(DataSet::new(&s, &[], 1), Err(DiagnoseError::NoRecording)));
    }
}
