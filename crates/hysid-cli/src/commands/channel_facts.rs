//! What can be said of one channel by looking at it: range, resolution, clipping, period, band.

use std::fmt;

use hysid_signal::tell::counted;
use hysid_signal::{Channel, correlation, power_spectrum};
use serde_json::{Value, json};

/// Samples of a stretch that the search for a period looks at.
const PERIOD_SAMPLES: usize = 1 << 18;

/// Facts about one channel. What cannot be told is `None`.
pub struct ChannelFacts {
    /// The column's name.
    pub name: String,
    /// Its unit.
    unit: Option<String>,
    /// Missing samples.
    missing: usize,
    /// Smallest sample; `NaN` where all are missing.
    pub smallest: f64,
    /// Largest sample; `NaN` where all are missing.
    pub largest: f64,
    mean: f64,
    std: f64,
    /// The step of which all samples are multiples, up to a constant: the resolution of the sensor or of the file.
    resolution: Option<f64>,
    /// Samples in plateaus of four or more at the smallest and at the largest value.
    clipped: (usize, usize),
    /// The period with which the channel repeats, in seconds, and the correlation at that lag.
    period: Option<(f64, f64)>,
    /// Frequencies in Hz between which 98 % of the power lies.
    band_hz: Option<(f64, f64)>,
}

/// Looks at a channel whose samples are `period_s` seconds apart.
pub fn channel_facts(channel: &Channel, period_s: f64) -> ChannelFacts {
    let x: Vec<f64> = channel.samples.iter().copied().filter(|v| v.is_finite()).collect();
    let count = x.len() as f64;
    let mean = x.iter().sum::<f64>() / count;
    let smallest = x.iter().copied().fold(f64::NAN, f64::min);
    let largest = x.iter().copied().fold(f64::NAN, f64::max);
    let longest = longest_stretch(&channel.samples);
    ChannelFacts {
        name: channel.name.clone(),
        unit: channel.unit().map(str::to_owned),
        missing: channel.samples.len() - x.len(),
        smallest,
        largest,
        mean,
        std: (x.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / count).sqrt(),
        resolution: resolution(&x),
        clipped: if smallest < largest { (plateau(&x, smallest), plateau(&x, largest)) } else { (0, 0) },
        period: period(longest).map(|(lag, r)| (lag * period_s, r)),
        band_hz: band(longest, period_s),
    }
}

fn longest_stretch(x: &[f64]) -> &[f64] {
    x.split(|v| !v.is_finite()).max_by_key(|s| s.len()).unwrap_or_default()
}

/// The greatest step of which all differences are multiples: the smallest difference between values, where it divides the others.
fn resolution(x: &[f64]) -> Option<f64> {
    let mut values = x.to_vec();
    values.sort_unstable_by(f64::total_cmp);
    let scale = values.last()?.abs().max(values.first()?.abs());
    let gaps: Vec<f64> = values.windows(2).map(|w| w[1] - w[0]).filter(|d| *d > 1e-12 * scale).collect();
    let step = gaps.iter().copied().fold(f64::INFINITY, f64::min);
    let multiple = |d: &f64| (d / step - (d / step).round()).abs() < 0.02 + 1e-9 * scale / step;
    let regular = gaps.iter().filter(|d| **d < 1000.0 * step).all(multiple);
    // Without repeated values the smallest difference is an accident and not a step.
    (step.is_finite() && regular && gaps.len() + 1 < x.len() / 2).then_some(step)
}

/// Samples that lie at `level` in runs of at least four.
fn plateau(x: &[f64], level: f64) -> usize {
    x.chunk_by(|a, b| (*a == level) == (*b == level))
        .filter(|run| run[0] == level && run.len() >= 4)
        .map(<[f64]>::len)
        .sum()
}

/// The first lag (in samples, between samples by a parabola) at which the channel repeats itself with a correlation above 0.9.
fn period(x: &[f64]) -> Option<(f64, f64)> {
    let x = &x[..x.len().min(PERIOD_SAMPLES)];
    let mean = x.iter().sum::<f64>() / x.len() as f64;
    let centred: Vec<f64> = x.iter().map(|v| v - mean).collect();
    let most = x.len() / 2;
    if most < 4 {
        return None;
    }
    let products = correlation(&centred, &centred, most);
    let squares: Vec<f64> = std::iter::once(0.0)
        .chain(centred.iter().scan(0.0, |sum, v| {
            *sum += v * v;
            Some(*sum)
        }))
        .collect();
    let total = *squares.last()?;
    if total <= 0.0 {
        return None;
    }
    // Each lag is judged by the two stretches that it lays over each other.
    let r: Vec<f64> = (0..products.len())
        .map(|k| products[k] / (squares[x.len() - k] * (total - squares[k])).sqrt().max(1e-12 * total))
        .collect();
    let start = r.iter().position(|v| *v < 0.5)?;
    let (lag, best) = (start + 1..r.len() - 1)
        .map(|k| (k, r[k]))
        .filter(|(k, v)| *v > 0.9 && *v >= r[k - 1] && *v >= r[k + 1])
        .fold(None, |best: Option<(usize, f64)>, here| match best {
            // A multiple of the period may correlate a little better by chance.
            Some(b) if here.1 < b.1 + 0.02 => Some(b),
            _ => Some(here),
        })?;
    let curve = r[lag - 1] - 2.0 * r[lag] + r[lag + 1];
    let shift = if curve < 0.0 { 0.5 * (r[lag - 1] - r[lag + 1]) / curve } else { 0.0 };
    Some((lag as f64 + shift, best))
}

fn band(x: &[f64], period_s: f64) -> Option<(f64, f64)> {
    let segment = x.len().min(4096);
    let (hz, power) = power_spectrum(x, period_s, segment).ok()?;
    let total: f64 = power.iter().skip(1).sum();
    if total <= 0.0 {
        return None;
    }
    let at = |share: f64| {
        let mut sum = 0.0;
        let line = power.iter().enumerate().skip(1).find(|(_, p)| {
            sum += **p;
            sum >= share * total
        });
        line.and_then(|(k, _)| hz.get(k)).copied()
    };
    Some((at(0.01)?, at(0.99)?))
}

impl ChannelFacts {
    /// The facts for machines.
    pub fn as_json(&self) -> Value {
        json!({
            "name": self.name, "unit": self.unit, "missing": self.missing, "smallest": self.smallest, "largest": self.largest,
            "mean": self.mean, "std": self.std, "constant": self.smallest == self.largest, "resolution": self.resolution,
            "clipped_low": self.clipped.0, "clipped_high": self.clipped.1,
            "repeats_every_s": self.period.map(|p| p.0), "repeats_with_correlation": self.period.map(|p| p.1),
            "band_hz": self.band_hz.map(|b| [b.0, b.1]),
        })
    }
}

impl fmt::Display for ChannelFacts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.name)?;
        if let Some(unit) = &self.unit {
            write!(f, "  [{unit}]")?;
        }
        writeln!(f)?;
        if self.smallest.is_nan() {
            return writeln!(f, "  every sample is missing");
        }
        if self.smallest == self.largest {
            writeln!(f, "  constant: {}", self.smallest)?;
        } else {
            writeln!(
                f,
                "  {:.6} to {:.6}, mean {:.6}, standard deviation {:.6}",
                self.smallest, self.largest, self.mean, self.std
            )?;
        }
        if self.missing > 0 {
            writeln!(f, "  {} missing", counted(self.missing, "sample"))?;
        }
        if let Some(step) = self.resolution {
            writeln!(f, "  resolution {step:.3e} ({:.0} steps over its range)", (self.largest - self.smallest) / step)?;
        }
        if self.clipped.0 + self.clipped.1 > 0 {
            writeln!(
                f,
                "  may be clipped: {} samples in plateaus at the bottom, {} at the top",
                self.clipped.0, self.clipped.1
            )?;
        }
        if let Some((period, r)) = self.period {
            writeln!(f, "  repeats every {period:.6} s (correlation {r:.3})")?;
        }
        if let Some((low, high)) = self.band_hz {
            writeln!(f, "  98 % of its power lies between {low:.4} and {high:.4} Hz")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn facts(samples: Vec<f64>) -> ChannelFacts {
        channel_facts(&Channel { name: "y_mm".into(), samples }, 0.01)
    }

    #[test]
    fn a_clipped_and_quantised_sine_is_seen_through() {
        let x =
            (0..4000).map(|n| ((0.0628 * n as f64).sin() * 1.2).clamp(-1.0, 1.0)).map(|v| (v / 0.02).round() * 0.02);
        let f = facts(x.collect());
        assert!((f.resolution.unwrap() / 0.02 - 1.0).abs() < 1e-6);
        assert!(f.clipped.0 > 500 && f.clipped.1 > 500, "{:?}", f.clipped);
        assert!((f.period.unwrap().0 / (std::f64::consts::TAU * 0.01 / 0.0628) - 1.0).abs() < 1e-2, "{:?}", f.period);
        let band = f.band_hz.unwrap();
        assert!(band.0 < 1.1 && (0.9..6.0).contains(&band.1), "{band:?}");
    }

    #[test]
    fn what_is_not_there_is_not_claimed() {
        let noise: Vec<f64> = (0..3000_u64).map(|n| ((n * n * 2_654_435_761 % 1_000_003) as f64).sin()).collect();
        let f = facts(noise);
        assert!(f.period.is_none() && f.resolution.is_none() && f.clipped == (0, 0));
        let constant = facts(vec![2.0; 100]);
        assert!(constant.period.is_none() && constant.band_hz.is_none() && constant.clipped == (0, 0));
        for few in [vec![], vec![1.0], vec![f64::NAN; 9], vec![1.0, 2.0, f64::NAN]] {
            let text = facts(few).to_string();
            assert!(text.starts_with("y_mm  [mm]"));
        }
    }
}
