//! Parts of a data set: windows that a search can afford, and blocks that are held out.

use std::sync::Arc;

use hysid_plant::Drive;

use super::{DataSet, SHORTEST_STRETCH, Stretch};
use crate::evidence::Layout;

/// Most stretches that windows are taken from.
const MOST_STRETCHES: usize = 8;

impl DataSet {
    /// A data set of at most about `limit` samples: windows of equal length, the first and the last at the ends of the data and the loudest
    /// among them, so that thousands of simulations of a long recording stay affordable. The data set itself where it is short enough.
    pub fn within(&self, limit: usize) -> Self {
        let total = self.samples();
        if total <= limit {
            return self.clone();
        }
        let windows = 4.max(self.stretches.len().min(MOST_STRETCHES));
        let length = (limit / windows).max(SHORTEST_STRETCH);
        let scales = self.scales();
        let loudness = |s: &Stretch, start: usize, length: usize| -> f64 {
            let of = |(column, scale): (&Vec<f64>, &f64)| {
                let v: Vec<f64> = column[start..start + length].iter().copied().filter(|v| v.is_finite()).collect();
                let mean = v.iter().sum::<f64>() / v.len().max(1) as f64;
                v.iter().map(|x| ((x - mean) / scale).powi(2)).sum::<f64>()
            };
            s.outputs.iter().zip(&scales).map(of).sum()
        };
        // Each stretch brings initial states that nobody knows: of many the longest are taken, and of those the loudest.
        let mut taken: Vec<&Stretch> = self.stretches.iter().collect();
        let worth = |s: &Stretch| (s.len().min(length), loudness(s, 0, s.len().min(length)));
        taken.sort_by(|a, b| {
            let ((long, loud), (short, quiet)) = (worth(b), worth(a));
            long.cmp(&short).then(loud.total_cmp(&quiet))
        });
        taken.truncate(MOST_STRETCHES);
        taken.sort_by_key(|s| (s.recording, s.samples.start));
        let within: usize = taken.iter().map(|s| s.len()).sum();
        let mut chosen: Vec<Stretch> = Vec::new();
        for s in taken {
            let share = ((windows * s.len()) as f64 / within as f64).round().max(1.0) as usize;
            let length = length.min(s.len());
            let mut starts: Vec<usize> =
                if share == 1 { vec![0] } else { (0..share).map(|i| i * (s.len() - length) / (share - 1)).collect() };
            let power = |start: usize| loudness(s, start, length);
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
                let part = |columns: &[Vec<f64>]| columns.iter().map(|c| c[range.clone()].to_vec()).collect::<Vec<_>>();
                // The parts of a good drive are a good drive.
                let Ok(drive) = Drive::new(start_s, s.drive.period_s(), length, part(s.drive.inputs())) else {
                    continue;
                };
                chosen.push(Stretch {
                    recording: s.recording,
                    samples: s.samples.start + start..s.samples.start + start + length,
                    start_s,
                    drive,
                    outputs: part(&s.outputs),
                    recorded: Arc::new(part(&s.recorded)),
                });
            }
        }
        let mut notes = self.notes.clone();
        let used: usize = chosen.iter().map(Stretch::len).sum();
        notes.push(format!("of {total} samples the search used {used}, in {} windows", chosen.len()));
        Self::from_stretches(self.period_s, self.recordings.clone(), chosen, self.layout.outputs, notes, self.step)
    }
}

/// The rows that are held out of the estimation to veto and to break ties: `1` where a row takes part in the fit, `0` where it is held out.
///
/// Each long series is cut into ten blocks; the third, the sixth and the ninth are held out, and the loudest one if it is none of these. The
/// first never is: a free initial state is estimated on it, and without it each effect would be judged by how it runs backwards in time.
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
        if let Some(loudest) = (1..10).max_by(|a, b| power(*a).total_cmp(&power(*b)))
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
    use super::super::samples::{ramp, recording, simulation};
    use super::*;
    use crate::evidence::Series;

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
    fn of_many_stretches_no_more_than_the_limit_is_taken() {
        let n = 100_000;
        let mut u = ramp(n);
        // A gap every thousand samples, and one stretch that is longer.
        (1..100).filter(|k| *k != 50).for_each(|k| u[1000 * k] = f64::NAN);
        let y: Vec<f64> = (0..n).map(|i| (i as f64 * 0.1).sin()).collect();
        let d = DataSet::new(&simulation(), &[recording(u, y)], 1).unwrap();
        let w = d.within(12_000);
        assert!(w.samples() <= 12_000 && w.samples() > 6000, "{}", w.samples());
        assert!(
            w.stretches.iter().any(|s| (49_000..51_000).contains(&s.samples.start)),
            "the longest one is among them"
        );
        assert!(w.stretches.windows(2).all(|p| p[0].samples.end <= p[1].samples.start));
    }

    #[test]
    fn three_blocks_of_ten_are_held_out() {
        let layout = Layout { series: vec![Series { stretch: 0, output: 0, first: 0, rows: 0..1000 }], outputs: 1 };
        let y: Vec<f64> = (0..1000).map(|i| (i as f64 * 0.7).sin()).collect();
        assert_eq!(held_out_blocks(&layout, &y).iter().filter(|w| **w == 0.0).count(), 300);
    }

    #[test]
    fn the_block_that_the_initial_state_is_estimated_on_stays() {
        let layout = Layout { series: vec![Series { stretch: 0, output: 0, first: 0, rows: 0..1000 }], outputs: 1 };
        let decaying = |from: usize| -> Vec<f64> {
            (0..1000)
                .map(|i| {
                    (i as f64 * 0.7).sin() + if i < from { 0.0 } else { 20.0 * (-((i - from) as f64) / 30.0).exp() }
                })
                .collect()
        };
        let out = |y: &[f64]| -> Vec<usize> {
            let weights = held_out_blocks(&layout, y);
            (0..10).filter(|b| weights[b * 100 + 50] == 0.0).collect()
        };
        assert_eq!(out(&decaying(0)), [2, 5, 8], "the transient at the start is the loudest");
        assert_eq!(out(&decaying(300)), [2, 3, 5, 8]);
    }
}
