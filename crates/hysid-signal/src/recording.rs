//! One recording: named channels on one uniform clock, and the history of what was done to them.

use std::ops::Range;

/// A stretch of consecutive samples, as a half-open range of sample numbers.
pub type Segment = Range<usize>;

/// The uniform clock of a recording.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clock {
    /// Time of sample 0, in seconds.
    pub start_s: f64,
    /// Sampling period, in seconds; finite and above zero.
    pub period_s: f64,
}

impl Clock {
    /// The time of sample `n`, in seconds.
    pub fn time(&self, n: usize) -> f64 {
        self.start_s + self.period_s * n as f64
    }
}

/// One named signal. A missing sample is `NaN`.
#[derive(Debug, Clone, PartialEq)]
pub struct Channel {
    /// The column's name as recorded, unit suffix included (`force_N`).
    pub name: String,
    /// The samples, in the unit that the name ends in.
    pub samples: Vec<f64>,
}

impl Channel {
    /// The unit that the name ends in (`force_N` gives `N`), if it has one.
    pub fn unit(&self) -> Option<&str> {
        self.name.split_once('_').map(|(_, unit)| unit).filter(|unit| !unit.is_empty())
    }
}

/// What can be wrong with the parts of a recording.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RecordingError {
    /// Channels of one recording must have equally many samples.
    #[error("channel `{name}` has {found} samples, the first channel has {expected}")]
    UnequalLengths {
        /// The offending channel.
        name: String,
        /// Its number of samples.
        found: usize,
        /// The first channel's number of samples.
        expected: usize,
    },
    /// Two channels have the same name.
    #[error("two channels are named `{0}`")]
    DuplicateChannel(String),
    /// The sampling period is not a finite number above zero.
    #[error("the sampling period is {0} s; it must be a finite number above zero")]
    BadPeriod(f64),
}

/// A table of named channels on one uniform clock.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    name: String,
    clock: Clock,
    channels: Vec<Channel>,
    history: Vec<String>,
}

impl Recording {
    /// A recording of these channels.
    ///
    /// # Errors
    /// Unequal lengths, a name given twice, a period that is not finite and above zero.
    pub fn new(name: impl Into<String>, clock: Clock, channels: Vec<Channel>) -> Result<Self, RecordingError> {
        if !(clock.period_s.is_finite() && clock.period_s > 0.0) {
            return Err(RecordingError::BadPeriod(clock.period_s));
        }
        let expected = channels.first().map_or(0, |c| c.samples.len());
        for (i, channel) in channels.iter().enumerate() {
            if channel.samples.len() != expected {
                return Err(RecordingError::UnequalLengths {
                    name: channel.name.clone(),
                    found: channel.samples.len(),
                    expected,
                });
            }
            if channels[..i].iter().any(|c| c.name == channel.name) {
                return Err(RecordingError::DuplicateChannel(channel.name.clone()));
            }
        }
        Ok(Self { name: name.into(), clock, channels, history: Vec::new() })
    }

    /// The recording's name: the file it came from, or what its maker called it.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The same recording under another name.
    pub fn named(self, name: impl Into<String>) -> Self {
        Self { name: name.into(), ..self }
    }

    /// The clock.
    pub fn clock(&self) -> Clock {
        self.clock
    }

    /// Number of samples in each channel.
    pub fn len(&self) -> usize {
        self.channels.first().map_or(0, |c| c.samples.len())
    }

    /// Whether there is not a single sample.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// All channels, in the order of the file.
    pub fn channels(&self) -> &[Channel] {
        &self.channels
    }

    /// The channel of this name.
    pub fn channel(&self, name: &str) -> Option<&Channel> {
        self.channels.iter().find(|c| c.name == name)
    }

    /// What was done to the recording since it was read, oldest first, a sentence each.
    pub fn history(&self) -> &[String] {
        &self.history
    }

    /// Adds a sentence to the history.
    pub fn note(&mut self, what: impl Into<String>) {
        self.history.push(what.into());
    }

    /// The stretches in which none of the named channels misses a sample, in order of time.
    ///
    /// A name that the recording lacks counts as missing throughout: the result is then empty.
    pub fn segments(&self, names: &[&str]) -> Vec<Segment> {
        let Some(columns) = names.iter().map(|n| self.channel(n)).collect::<Option<Vec<_>>>() else {
            return Vec::new();
        };
        let mut segments = Vec::new();
        let mut start = None;
        for n in 0..self.len() {
            let whole = columns.iter().all(|c| c.samples[n].is_finite());
            match (whole, start) {
                (true, None) => start = Some(n),
                (false, Some(s)) => {
                    segments.push(s..n);
                    start = None;
                }
                _ => {}
            }
        }
        if let Some(s) = start {
            segments.push(s..self.len());
        }
        segments
    }

    /// Whether both hold the same channels with the same samples to the bit, missing ones included.
    pub fn same_samples(&self, other: &Self) -> bool {
        let same = |a: &Channel, b: &Channel| {
            a.name == b.name
                && a.samples.len() == b.samples.len()
                && a.samples.iter().zip(&b.samples).all(|(x, y)| x.to_bits() == y.to_bits())
        };
        self.channels.len() == other.channels.len()
            && self.channels.iter().zip(&other.channels).all(|(a, b)| same(a, b))
    }

    /// The samples `range` of every channel as a recording of its own; the clock starts where the range does.
    pub fn slice(&self, range: Segment) -> Self {
        let range = range.start.min(self.len())..range.end.min(self.len());
        let channels = self
            .channels
            .iter()
            .map(|c| Channel { name: c.name.clone(), samples: c.samples[range.clone()].to_vec() })
            .collect();
        let clock = Clock { start_s: self.clock.time(range.start), period_s: self.clock.period_s };
        let mut history = self.history.clone();
        history.push(format!("samples {} to {} of `{}`", range.start, range.end, self.name));
        Self { name: self.name.clone(), clock, channels, history }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn recording(u: Vec<f64>, y: Vec<f64>) -> Result<Recording, RecordingError> {
        let channels = vec![Channel { name: "u_V".into(), samples: u }, Channel { name: "y_mm".into(), samples: y }];
        Recording::new("test", Clock { start_s: 1.0, period_s: 0.5 }, channels)
    }

    #[test]
    fn segments_are_cut_at_gaps_of_the_named_channels_only() {
        let nan = f64::NAN;
        let r = recording(vec![1.0, nan, 2.0, 3.0, 4.0], vec![1.0, 2.0, 3.0, nan, 5.0]).unwrap();
        assert_eq!(r.segments(&["u_V", "y_mm"]), vec![0..1, 2..3, 4..5]);
        assert_eq!(r.segments(&["u_V"]), vec![0..1, 2..5]);
        assert!(r.segments(&["missing"]).is_empty());
    }

    #[test]
    fn the_same_samples_are_known_again() {
        let nan = f64::NAN;
        let r = recording(vec![1.0, nan], vec![2.0, 3.0]).unwrap();
        assert!(r.same_samples(&r.clone()));
        assert!(!r.same_samples(&recording(vec![1.0, nan], vec![2.0, 3.1]).unwrap()));
        assert!(!r.same_samples(&recording(vec![1.0], vec![2.0]).unwrap()));
        let renamed = vec![Channel { name: "x_V".into(), ..r.channels()[0].clone() }, r.channels()[1].clone()];
        assert!(!r.same_samples(&Recording::new("r", r.clock(), renamed).unwrap()));
    }

    #[test]
    fn a_slice_keeps_its_time() {
        let r = recording(vec![1.0, 2.0, 3.0], vec![4.0, 5.0, 6.0]).unwrap();
        let s = r.slice(1..3);
        assert_eq!(s.clock().start_s, 1.5);
        assert_eq!(s.channel("y_mm").unwrap().samples, vec![5.0, 6.0]);
    }

    #[test]
    fn unequal_lengths_are_refused() {
        let e = recording(vec![1.0], vec![1.0, 2.0]).unwrap_err();
        assert!(matches!(e, RecordingError::UnequalLengths { found: 2, expected: 1, .. }));
    }

    #[test]
    fn a_unit_is_what_follows_the_first_underscore() {
        let c = |n: &str| Channel { name: n.into(), samples: vec![] };
        assert_eq!(c("force_N").unit(), Some("N"));
        assert_eq!(c("v_mm_s").unit(), Some("mm_s"));
        assert_eq!(c("q").unit(), None);
    }
}
