//! The courses by which a parameter may vary: those of a walk over time, the two phases of an oscillation, a signal of the simulation.

use std::f64::consts::{PI, SQRT_2, TAU};

use hysid_signal::range;

use super::followed::Followed;
use crate::model::base::Base;

/// Courses of a walk: the slowest that a Brownian motion is made of.
pub const COURSES: usize = 16;
/// Samples that a common clock may have for each one recorded.
const HOLES: usize = 4;

/// How a parameter varies.
#[derive(Debug, Clone, PartialEq)]
pub enum Course {
    /// It wanders; amplitudes are normal with this scale.
    Walk(f64),
    /// It oscillates at this frequency, in hertz.
    Line(f64),
    /// It follows an input or a state.
    Follows(Followed),
}

impl Course {
    /// What the scale of the amplitudes weighs in a regression of whitened rows, each of which counts for this share of one.
    pub fn precision(&self, share: f64) -> f64 {
        match self {
            Self::Walk(scale) => 1.0 / (scale * scale * share),
            Self::Line(_) | Self::Follows(_) => 0.0,
        }
    }
}

/// The two phases of an oscillation of this angular frequency, as they are written.
pub fn phases(frequency: &str) -> [String; 2] {
    ["sin", "cos"].map(|phase| format!("{phase}({frequency}*t)"))
}

/// Samples of a signal by stretch.
pub type Series = Vec<Vec<f64>>;

/// The recording's time.
pub struct Time {
    start: f64,
    /// From the first to the last sample, in seconds.
    pub length: f64,
    /// `[stretch][sample]`.
    at: Series,
}

impl Time {
    /// Of the recordings of a fit; `None` where they have no length.
    pub fn of(base: &Base<'_>) -> Option<Self> {
        let stretches = &base.model.data().stretches;
        let at: Series = stretches.iter().map(|s| s.times().collect()).collect();
        let range = range(at.iter().flatten().copied());
        (range.1 > range.0).then_some(Self { start: range.0, length: range.1 - range.0, at })
    }

    /// Number of samples.
    pub fn samples(&self) -> usize {
        self.at.iter().map(Vec::len).sum()
    }

    fn over(&self, f: impl Fn(f64) -> f64) -> Series {
        self.at.iter().map(|s| s.iter().map(|t| f(*t)).collect()).collect()
    }

    /// The courses of a walk, each for one standard deviation of a walk that ends one away, the two phases of an oscillation, or those of a signal.
    pub fn courses(&self, course: &Course) -> Vec<Series> {
        match course {
            Course::Walk(_) => (0..COURSES)
                .map(|k| {
                    let w = (k as f64 + 0.5) * PI;
                    self.over(|t| SQRT_2 / w * (w * (t - self.start) / self.length).sin())
                })
                .collect(),
            Course::Line(f) => vec![self.over(|t| (TAU * f * t).sin()), self.over(|t| (TAU * f * t).cos())],
            Course::Follows(input) => input.courses.clone(),
        }
    }

    /// The same as they are written.
    pub fn texts(&self, course: &Course) -> Vec<String> {
        match course {
            Course::Walk(_) => (0..COURSES)
                .map(|k| {
                    let w = (k as f64 + 0.5) * PI;
                    format!("{:.6}*sin({:.8}*(t - {}))", SQRT_2 / w, w / self.length, self.start)
                })
                .collect(),
            Course::Line(f) => phases(&format!("{:.8}", TAU * f)).to_vec(),
            Course::Follows(input) => input.texts(),
        }
    }

    /// Standard deviation over the recording of the courses with these amplitudes.
    pub fn deviation(&self, course: &Course, amplitudes: &[f64]) -> f64 {
        let mut sum = vec![0.0; self.samples()];
        for (course, a) in self.courses(course).iter().zip(amplitudes) {
            sum.iter_mut().zip(course.iter().flatten()).for_each(|(m, c)| *m += a * c);
        }
        let count = sum.len().max(1) as f64;
        let mean = sum.iter().sum::<f64>() / count;
        (sum.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / count).sqrt()
    }

    /// A series by stretch on one clock; `None` where that would be mostly holes.
    pub fn together(&self, series: &[Vec<f64>], period_s: f64) -> Option<Vec<f64>> {
        let samples = (self.length / period_s).round();
        let known: usize = series.iter().map(Vec::len).sum();
        // Not a number counts as too many.
        if samples.is_nan() || samples > (HOLES * known) as f64 {
            return None;
        }
        let mut out = vec![0.0; samples as usize + 1];
        for (t, x) in self.at.iter().flatten().zip(series.iter().flatten()) {
            if let Some(o) = out.get_mut(((t - self.start) / period_s).round() as usize) {
                *o += x;
            }
        }
        Some(out)
    }
}
