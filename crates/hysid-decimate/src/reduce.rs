//! The reduction of a recording, gaps included: the new clock stays uniform and each stretch is filtered by itself.

use hysid_signal::{Channel, Clock, Recording, Segment};

use crate::decimator::{DecimateError, Decimator, Phase};

/// A recording at the lower rate and what the reduction cost.
#[derive(Debug, Clone, PartialEq)]
pub struct Reduced {
    /// The named channels at the lower rate. Its clock starts at the first sample kept; the group delay of every decimator is 0.
    pub recording: Recording,
    /// Samples per channel before and after.
    pub samples: (usize, usize),
    /// Original samples before the first and after the last one kept: what plain compression throws off the ends.
    pub off_the_ends: usize,
    /// Samples kept that became missing because their stretch is too short for the filter (all channels together).
    pub too_short: usize,
    /// Samples kept, per stretch and end, whose values rest on the continuation of the stretch beyond its end.
    pub edge: usize,
}

/// The first `Segment`s of a channel without a missing sample.
pub(crate) fn stretches<'a>(recording: &'a Recording, name: &str) -> Result<Vec<(Segment, &'a [f64])>, DecimateError> {
    let channel = recording.channel(name).ok_or_else(|| DecimateError::MissingChannel(name.to_owned()))?;
    Ok(recording.segments(&[name]).into_iter().map(|s| (s.clone(), &channel.samples[s])).collect())
}

/// Every `factor`-th sample of the named channels.
///
/// The samples kept are the same for all channels and stretches, so the clock stays uniform and a gap stays a gap. A stretch too
/// short for the filter becomes missing.
///
/// # Errors
/// A factor of 0, a channel that is not there, not one sample left.
pub fn reduce(
    recording: &Recording,
    names: &[&str],
    factor: usize,
    decimator: Decimator,
    phase: Phase,
) -> Result<Reduced, DecimateError> {
    if factor == 0 {
        return Err(DecimateError::Factor);
    }
    let before = recording.len();
    let offset = phase.offset(before, factor);
    let left = before.saturating_sub(offset).div_ceil(factor);
    if left == 0 {
        return Err(DecimateError::TooFewSamples { samples: before, factor, left, needed: 1 });
    }
    let mut too_short = 0;
    let mut channels = Vec::with_capacity(names.len());
    for name in names {
        let mut samples = vec![f64::NAN; left];
        for (range, x) in stretches(recording, name)? {
            let first = range.start.saturating_sub(offset).div_ceil(factor);
            let inside = offset + first * factor - range.start;
            let count = range.len().saturating_sub(inside).div_ceil(factor);
            if count > 0 {
                match decimator.apply(x, factor, Phase::Offset(inside)) {
                    Ok(kept) => samples[first..first + count].copy_from_slice(&kept),
                    Err(_) => too_short += count,
                }
            }
        }
        channels.push(Channel { name: (*name).to_owned(), samples });
    }
    let clock = recording.clock();
    let clock = Clock { start_s: clock.time(offset), period_s: clock.period_s * factor as f64 };
    // The parts come from a sound recording: names differ unless the caller named a channel twice.
    let mut reduced = Recording::new(recording.name(), clock, channels)
        .map_err(|_| DecimateError::MissingChannel(names.join(", ")))?;
    for line in recording.history() {
        reduced.note(line.clone());
    }
    reduced.note(format!("every {factor}th sample kept from sample {offset} on; {}", decimator.label()));
    let last = offset + (left - 1) * factor;
    Ok(Reduced {
        recording: reduced,
        samples: (before, left),
        off_the_ends: offset + (before - 1 - last),
        too_short,
        edge: decimator.edge(factor).div_ceil(factor),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn recording(y: Vec<f64>) -> Recording {
        let u = (0..y.len()).map(|n| n as f64).collect();
        let channels = vec![Channel { name: "u".into(), samples: u }, Channel { name: "y".into(), samples: y }];
        Recording::new("test", Clock { start_s: 1.0, period_s: 0.1 }, channels).unwrap()
    }

    #[test]
    fn gaps_stay_gaps_on_a_uniform_clock() {
        let mut y: Vec<f64> = (0..100).map(f64::from).collect();
        y[30] = f64::NAN;
        y[77] = f64::NAN;
        let r = reduce(&recording(y), &["u", "y"], 10, Decimator::Plain, Phase::First).unwrap();
        assert_eq!((r.samples, r.off_the_ends, r.too_short, r.edge), ((100, 10), 9, 0, 0));
        assert!((r.recording.clock().period_s - 1.0).abs() < 1e-12);
        let kept = &r.recording.channel("y").unwrap().samples;
        assert!(kept[3].is_nan());
        assert!((0..10).filter(|k| *k != 3).all(|k| kept[k] == 10.0 * k as f64));
        assert!(r.recording.channel("u").unwrap().samples.iter().all(|u| u.is_finite()));
        let r = reduce(&recording((0..100).map(f64::from).collect()), &["y"], 7, Decimator::Plain, Phase::Lth).unwrap();
        assert_eq!((r.samples, r.off_the_ends), ((100, 14), 8));
        assert!((r.recording.clock().start_s - 1.6).abs() < 1e-12);
    }

    #[test]
    fn each_stretch_is_filtered_by_itself() {
        let mut y: Vec<f64> = (0..300).map(|n| (0.05 * f64::from(n)).sin()).collect();
        y[10] = f64::NAN;
        let r = reduce(&recording(y.clone()), &["y"], 5, Decimator::Chebyshev, Phase::First).unwrap();
        assert_eq!(r.too_short, 2, "ten samples are too few for the filter");
        let alone = Decimator::Chebyshev.apply(&y[11..], 5, Phase::Offset(4)).unwrap();
        assert_eq!(&r.recording.channel("y").unwrap().samples[3..], alone);
        let line =
            reduce(&recording((0..200).map(f64::from).collect()), &["y"], 4, Decimator::Kaiser, Phase::First).unwrap();
        for (k, v) in line.recording.channel("y").unwrap().samples.iter().enumerate() {
            assert!((v - 4.0 * k as f64).abs() < 1e-9, "odd reflection keeps a line a line");
        }
    }

    #[test]
    fn bad_input_is_refused() {
        let r = recording(vec![1.0; 10]);
        assert_eq!(reduce(&r, &["y"], 0, Decimator::Plain, Phase::First), Err(DecimateError::Factor));
        assert!(matches!(reduce(&r, &["x"], 2, Decimator::Plain, Phase::First), Err(DecimateError::MissingChannel(_))));
        let far = reduce(&r, &["y"], 11, Decimator::Plain, Phase::Lth);
        assert!(matches!(far, Err(DecimateError::TooFewSamples { left: 0, .. })));
        assert!(reduce(&r, &["y", "y"], 2, Decimator::Plain, Phase::First).is_err());
    }
}
