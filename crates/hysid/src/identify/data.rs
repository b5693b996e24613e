//! Recordings as an identification sees them: the named columns, checked, at the model's rate.

use hysid_dictionary::Record;
use hysid_signal::Recording;

use super::IdentifyError;

/// The samples of one recording (or of one phase of it, where the rate is reduced).
#[derive(Debug, Clone)]
pub(crate) struct Samples {
    pub y: Vec<f64>,
    pub inputs: Vec<Vec<f64>>,
}

impl Samples {
    pub(crate) fn record(&self) -> Record<'_> {
        Record::new(&self.y, self.inputs.iter().map(Vec::as_slice).collect())
    }

    /// Every `l`-th sample.
    pub(crate) fn every(&self, l: usize) -> Self {
        let take = |x: &[f64]| x.iter().copied().step_by(l).collect();
        Self { y: take(&self.y), inputs: self.inputs.iter().map(|u| take(u)).collect() }
    }
}

/// The named columns of each recording.
pub(crate) fn gather(recordings: &[Recording], inputs: &[String], output: &str) -> Result<Vec<Samples>, IdentifyError> {
    let column = |r: &Recording, name: &str| {
        r.channel(name)
            .map(|c| c.samples.clone())
            .ok_or_else(|| IdentifyError::MissingColumn { recording: r.name().to_string(), column: name.to_string() })
    };
    recordings
        .iter()
        .map(|r| {
            Ok(Samples {
                y: column(r, output)?,
                inputs: inputs.iter().map(|i| column(r, i)).collect::<Result<_, _>>()?,
            })
        })
        .collect()
}

/// Mean and standard deviation of what is there; `None` without two samples.
pub(crate) fn spread<'a>(all: impl Iterator<Item = &'a f64> + Clone) -> Option<(f64, f64)> {
    let there = all.filter(|v| v.is_finite());
    let n = there.clone().count();
    if n < 2 {
        return None;
    }
    let mean = there.clone().sum::<f64>() / n as f64;
    let variance = there.map(|v| (v - mean) * (v - mean)).sum::<f64>() / n as f64;
    Some((mean, variance.sqrt()))
}
