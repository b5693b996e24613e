//! Recordings as an identification sees them: the named columns, at the model's rate, and what they say of themselves.

use hysid_dictionary::Record;
use hysid_narx::mean_over_step;

use super::{IdentifyError, Source};

/// The samples of one recording at the model's rate.
#[derive(Debug, Clone)]
pub(crate) struct Samples {
    pub y: Vec<f64>,
    pub inputs: Vec<Vec<f64>>,
}

impl Samples {
    pub(crate) fn record(&self) -> Record<'_> {
        Record::new(&self.y, self.inputs.iter().map(Vec::as_slice).collect())
    }

    /// Every `l`-th sample of the output, and of the inputs' means over as many samples.
    pub(crate) fn every(&self, l: usize) -> Self {
        let take = |x: &[f64]| x.iter().copied().step_by(l.max(1)).collect();
        Self { y: take(&self.y), inputs: self.inputs.iter().map(|u| take(&mean_over_step(u, l))).collect() }
    }
}

/// The named columns of each recording.
pub(crate) fn gather(source: Source<'_>) -> Result<Vec<Samples>, IdentifyError> {
    let all = || source.inputs.iter().map(String::as_str).chain([source.output]);
    for (i, name) in all().enumerate() {
        if all().take(i).any(|n| n == name) {
            return Err(IdentifyError::Twice(name.to_string()));
        }
    }
    source
        .recordings
        .iter()
        .map(|r| {
            let column = |name: &str| {
                r.channel(name).map(|c| c.samples.clone()).ok_or_else(|| IdentifyError::MissingColumn {
                    recording: r.name().to_string(),
                    column: name.to_string(),
                })
            };
            Ok(Samples {
                y: column(source.output)?,
                inputs: source.inputs.iter().map(|i| column(i)).collect::<Result<_, _>>()?,
            })
        })
        .collect()
}

/// Where a signal lies and how far it goes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Spread {
    pub mean: f64,
    pub std: f64,
    pub low: f64,
    pub high: f64,
}

/// The spread of what is there; `None` without two samples.
pub(crate) fn spread<'a>(all: impl Iterator<Item = &'a f64> + Clone) -> Option<Spread> {
    let there = all.filter(|v| v.is_finite());
    let n = there.clone().count();
    if n < 2 {
        return None;
    }
    let mean = there.clone().sum::<f64>() / n as f64;
    let variance = there.clone().map(|v| (v - mean) * (v - mean)).sum::<f64>() / n as f64;
    let (low, high) = hysid_signal::range(there.copied());
    Some(Spread { mean, std: variance.sqrt(), low, high })
}

/// The standard deviation of white noise on a signal that is smooth beneath it; 0 where the two cannot be told apart.
///
/// The k-th difference of white noise has the variance C(2k, k) sigma^2, that of a smooth signal falls with k. Where the
/// estimates from k = 3, 4 and 5 agree within a factor of 1.5 and are small against the first difference, they are noise.
pub(crate) fn noise_level(x: &[f64]) -> f64 {
    let mut estimates = Vec::new();
    let mut d: Vec<f64> = x.to_vec();
    let mut binomial = 1.0;
    for k in 1..=5u32 {
        d = d.windows(2).map(|w| w[1] - w[0]).collect();
        let k = f64::from(k);
        binomial *= 2.0 * (2.0 * k - 1.0) / k;
        let there: Vec<f64> = d.iter().copied().filter(|v| v.is_finite()).collect();
        if there.len() < 20 {
            return 0.0;
        }
        estimates.push((there.iter().map(|v| v * v).sum::<f64>() / there.len() as f64 / binomial).sqrt());
    }
    let (low, high) = estimates[2..].iter().fold((f64::INFINITY, 0.0f64), |(a, b), v| (a.min(*v), b.max(*v)));
    if high < 1.5 * low && high < 0.5 * estimates[0] { low } else { 0.0 }
}

/// The size of a signal's step from sample to sample, `lag` samples apart, over its standard deviation.
pub(crate) fn step_size(x: &[f64], lag: usize) -> f64 {
    let Some(s) = spread(x.iter()) else { return f64::INFINITY };
    let (mut sum, mut n) = (0.0, 0usize);
    for (a, b) in x.iter().zip(x.iter().skip(lag)) {
        let d = b - a;
        if d.is_finite() {
            sum += d * d;
            n += 1;
        }
    }
    if n == 0 || s.std == 0.0 { f64::INFINITY } else { (sum / n as f64).sqrt() / s.std }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_told_from_a_smooth_signal() {
        let smooth: Vec<f64> = (0..4000).map(|n| (n as f64 * 0.01).sin() + 0.3 * (n as f64 * 0.037).cos()).collect();
        assert_eq!(noise_level(&smooth), 0.0);
        let mut x = 1u64;
        let mut uniform = || {
            x ^= x << 13;
            x ^= x >> 7;
            x ^= x << 17;
            (x >> 11) as f64 / (1u64 << 53) as f64 - 0.5
        };
        let white: Vec<f64> = (0..4000).map(|_| uniform()).collect();
        // A white input is a signal, not noise on one.
        assert_eq!(noise_level(&white), 0.0);
        let noisy: Vec<f64> = smooth.iter().zip(&white).map(|(s, w)| s + 0.001 * w).collect();
        let sigma = 0.001 / 12f64.sqrt();
        let found = noise_level(&noisy);
        assert!((found / sigma - 1.0).abs() < 0.1, "{found} {sigma}");
    }
}
