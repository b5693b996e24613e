//! The courses by which a parameter may vary: those of a walk over time, the two phases of an oscillation, a recorded input.

use std::f64::consts::{PI, SQRT_2, TAU};

use crate::model::base::Base;
use crate::slot::{Place, Structure};
use crate::text::number;

/// Courses of a walk: the slowest that a Brownian motion is made of.
pub const COURSES: usize = 16;
/// Samples that a common clock may have for each one recorded.
const HOLES: usize = 4;

/// How a parameter varies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Course {
    /// It wanders; amplitudes are normal with this scale.
    Walk(f64),
    /// It oscillates at this frequency, in hertz.
    Line(f64),
    /// It follows an input.
    Follows(Followed),
}

/// An input that a parameter may follow: itself or its square, counted from its mean in multiples of its standard deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Followed {
    /// Its place among the inputs.
    pub input: usize,
    squared: bool,
    mean: f64,
    deviation: f64,
}

impl Followed {
    /// All that a parameter of a fitted simulation may follow: what is recorded besides the one input that drives it, and besides a prescribed motion. A
    /// parameter that follows those is a curved law, which has terms of its own.
    pub fn all(base: &Base<'_>) -> Vec<Self> {
        let stretches = &base.model.data().stretches;
        let simulation = base.model.simulation();
        let structure = Structure::of(simulation);
        let laws = structure.slots.iter().filter(|s| s.place == Place::ForceLaw);
        let motion: Vec<String> = laws
            .flat_map(|s| ["x", "v"].map(|n| s.quantity(n)))
            .flatten()
            .flat_map(|q| q.expression.symbols())
            .collect();
        let several = simulation.inputs.len() > 1;
        let inputs = simulation.inputs.iter().enumerate().filter(|(_, u)| several && !motion.contains(&u.symbol));
        let of = |(input, squared): (usize, bool)| {
            let raw = Self { input, squared, mean: 0.0, deviation: 1.0 };
            let all: Vec<f64> = stretches.iter().flat_map(|s| raw.series(&s.drive.inputs()[input])).collect();
            let count = all.len().max(1) as f64;
            let mean = all.iter().sum::<f64>() / count;
            let deviation = (all.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / count).sqrt();
            (deviation > 1e-9 * mean.abs() && deviation.is_finite()).then_some(Self { mean, deviation, ..raw })
        };
        inputs.flat_map(|(i, _)| [(i, false), (i, true)]).filter_map(of).collect()
    }

    fn series(&self, u: &[f64]) -> Vec<f64> {
        u.iter().map(|u| (if self.squared { u * u } else { *u } - self.mean) / self.deviation).collect()
    }

    /// The course of a parameter that follows it, by stretch.
    pub fn course(&self, base: &Base<'_>) -> Series {
        base.model.data().stretches.iter().map(|s| self.series(&s.drive.inputs()[self.input])).collect()
    }

    /// The same as it is written over the input's symbol.
    pub fn text(&self, symbol: &str) -> String {
        let Self { mean, deviation, .. } = self;
        if self.squared {
            format!("({symbol}^2 - {mean})/{deviation}")
        } else {
            format!("({symbol} - {mean})/{deviation}")
        }
    }

    /// What it does to a parameter with this amplitude, in words.
    pub fn words(&self, symbol: &str, amplitude: f64) -> String {
        let rises = if amplitude < 0.0 { "falls" } else { "rises" };
        let of = if self.squared { "the square of " } else { "" };
        let share = number(100.0 * (amplitude / self.deviation).abs());
        format!("{rises} with {of}the input `{symbol}`, by {share} % of its value for each unit of it")
    }
}

impl Course {
    /// What the scale of the amplitudes weighs in a regression of whitened rows, each of which counts for this share of one.
    pub fn precision(self, share: f64) -> f64 {
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
        let at: Series = stretches
            .iter()
            .map(|s| (0..s.len()).map(|n| s.start_s + n as f64 * s.drive.period_s()).collect())
            .collect();
        let range = at.iter().flatten().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), t| (a.min(*t), b.max(*t)));
        (range.1 > range.0).then_some(Self { start: range.0, length: range.1 - range.0, at })
    }

    /// Number of samples.
    pub fn samples(&self) -> usize {
        self.at.iter().map(Vec::len).sum()
    }

    fn over(&self, f: impl Fn(f64) -> f64) -> Series {
        self.at.iter().map(|s| s.iter().map(|t| f(*t)).collect()).collect()
    }

    /// The courses of a walk, each for one standard deviation of a walk that ends one away, or the two phases of an oscillation; none over time of what
    /// follows an input.
    pub fn courses(&self, course: Course) -> Vec<Series> {
        match course {
            Course::Walk(_) => (0..COURSES)
                .map(|k| {
                    let w = (k as f64 + 0.5) * PI;
                    self.over(|t| SQRT_2 / w * (w * (t - self.start) / self.length).sin())
                })
                .collect(),
            Course::Line(f) => vec![self.over(|t| (TAU * f * t).sin()), self.over(|t| (TAU * f * t).cos())],
            Course::Follows(_) => Vec::new(),
        }
    }

    /// The same as they are written.
    pub fn texts(&self, course: Course) -> Vec<String> {
        match course {
            Course::Walk(_) => (0..COURSES)
                .map(|k| {
                    let w = (k as f64 + 0.5) * PI;
                    format!("{:.6}*sin({:.8}*(t - {}))", SQRT_2 / w, w / self.length, self.start)
                })
                .collect(),
            Course::Line(f) => phases(&format!("{:.8}", TAU * f)).to_vec(),
            Course::Follows(_) => Vec::new(),
        }
    }

    /// Standard deviation over the recording of the courses with these amplitudes.
    pub fn deviation(&self, course: Course, amplitudes: &[f64]) -> f64 {
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
