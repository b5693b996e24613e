//! The recordings at one rate with everything that the rounds of an identification ask of them.

use hysid_dictionary::{Signal, SignalName, Signals};
use hysid_narx::{Derived, Fit, NarxError, Trainer, Window};

use super::data::{Samples, Spread, noise_level, spread};
use super::growth::Stage;
use super::split::{Split, split};
use super::{IdentifyError, Options, Source, Stop};

/// The recordings at one rate.
pub(crate) struct Desk<'a> {
    pub source: Source<'a>,
    pub options: &'a Options,
    /// The model moves in steps of so many samples.
    pub decimation: usize,
    pub samples: Vec<Samples>,
    pub y: Spread,
    /// Signals of the recordings, with thresholds for the signs of differences; derived inputs join them.
    signals: Signals,
    trials: Vec<Trial>,
    stop: Stop<'a>,
}

/// What a sound model endures: a recording with its inputs held, enlarged, made smaller, or with pulses on them.
struct Trial {
    samples: Samples,
    /// The run must stay this close to the middle of the output's range.
    bound: f64,
}

/// A sign changes when the signal moves by more than so many standard deviations of its noise.
const SIGN_SIGMAS: f64 = 3.0;
/// Samples for which inputs are held.
const HELD: usize = 300;
/// Samples of an enlarged or diminished stretch.
const STRETCH: usize = 1200;
/// Size of pulses on the inputs, in standard deviations.
const PULSE: f64 = 0.7;
/// Parts of the held-out blocks, at least, on which models are compared pair by pair.
const PARTS: usize = 12;
/// A share of failed trials counts as this multiple of itself in the error.
const PENALTY: f64 = 2.0;

impl<'a> Desk<'a> {
    pub(crate) fn new(
        source: Source<'a>,
        options: &'a Options,
        all: &[Samples],
        decimation: usize,
        stop: Stop<'a>,
    ) -> Result<Self, IdentifyError> {
        let samples: Vec<Samples> = all.iter().map(|s| s.every(decimation)).collect();
        let y = spread(samples.iter().flat_map(|s| &s.y)).ok_or_else(|| IdentifyError::TooShort {
            samples: samples.iter().map(|s| s.y.len()).max().unwrap_or(0),
            needed: 3,
        })?;
        let inputs: Vec<&str> = source.inputs.iter().map(String::as_str).collect();
        let mut signals = Signals::from_columns(source.output, &inputs)?;
        for i in 0..inputs.len() {
            let noise = samples.iter().map(|s| noise_level(&s.inputs[i])).fold(0.0, f64::max);
            signals = signals.with_threshold(Signal::Input(i), SIGN_SIGMAS * noise);
        }
        let trials = trials(&samples, y);
        Ok(Self { source, options, decimation, samples, y, signals, trials, stop })
    }

    /// An error where the caller wants no more.
    pub(crate) fn go_on(&self) -> Result<(), IdentifyError> {
        if (self.stop)() { Err(IdentifyError::Stopped) } else { Ok(()) }
    }

    /// Number of recorded inputs.
    pub(crate) fn inputs(&self) -> usize {
        self.source.inputs.len()
    }

    /// The spread of an input over all recordings.
    pub(crate) fn input(&self, i: usize) -> Option<Spread> {
        spread(self.samples.iter().flat_map(|s| &s.inputs[i]))
    }

    /// A run beyond this size has diverged.
    pub(crate) fn limit(&self) -> f64 {
        let reach = (self.y.high - self.y.low).max(self.y.std);
        self.y.low.abs().max(self.y.high.abs()) + 5.0 * reach
    }

    fn with_derived(&self, derived: &[Derived]) -> Result<Signals, IdentifyError> {
        let mut all = self.signals.inputs().to_vec();
        let name = |d: &Derived| SignalName { symbol: d.symbol.clone(), column: d.symbol.clone(), threshold: 0.0 };
        all.extend(derived.iter().map(name));
        Ok(Signals::new(self.signals.output().clone(), all)?)
    }

    /// A trainer on the recordings.
    pub(crate) fn trainer(&self, derived: &[Derived], given: usize) -> Result<Trainer, IdentifyError> {
        let records: Vec<_> = self.samples.iter().map(Samples::record).collect();
        Ok(Trainer::new(self.with_derived(derived)?, derived.to_vec(), &records, given, self.limit())?)
    }

    /// The windows for runs that start from `given` samples, the search looking at about `most`.
    pub(crate) fn split(&self, trainer: &Trainer, most: usize) -> Result<Split, IdentifyError> {
        let windows = trainer.whole_windows();
        if windows.is_empty() {
            let longest = trainer.banks().iter().flat_map(|b| b.stretches()).map(ExactSizeIterator::len).max();
            return Err(IdentifyError::TooShort { samples: longest.unwrap_or(0), needed: 2 * trainer.given() + 1 });
        }
        Ok(split(&windows, trainer.given(), most))
    }

    /// Drops the trials that none of these linear models endures: where even a linear model leaves the range (an integrator
    /// under a held input), leaving it is physics and not a fault. A model that is alone in leaving it is at fault.
    pub(crate) fn calibrate_trials<'m>(
        &mut self,
        models: impl Iterator<Item = (&'m Fit, usize)>,
    ) -> Result<(), IdentifyError> {
        let mut keep = vec![false; self.trials.len()];
        for (fit, given) in models {
            keep.iter_mut().zip(self.endured(fit, given)?).for_each(|(k, e)| *k |= e);
        }
        let mut keep = keep.into_iter();
        self.trials.retain(|_| keep.next().unwrap_or(true));
        Ok(())
    }

    /// The share of the trials that the fit does not endure.
    pub(crate) fn failed_trials(&self, fit: &Fit, given: usize) -> Result<f64, IdentifyError> {
        let endured = self.endured(fit, given)?;
        let failed = endured.iter().filter(|e| !**e).count();
        Ok(failed as f64 / endured.len().max(1) as f64)
    }

    /// For each trial, whether the fit endures it.
    fn endured(&self, fit: &Fit, given: usize) -> Result<Vec<bool>, IdentifyError> {
        let records: Vec<_> = self.trials.iter().map(|t| t.samples.record()).collect();
        let mut trainer =
            Trainer::new(self.with_derived(&fit.derived)?, fit.derived.clone(), &records, given, self.limit() * 2.0)?;
        let middle = 0.5 * (self.y.low + self.y.high);
        let mut endured = Vec::with_capacity(self.trials.len());
        for (record, trial) in self.trials.iter().enumerate() {
            let range = 0..trial.samples.y.len();
            let short = range.len() <= given;
            let peak = if short { Vec::new() } else { trainer.peaks(fit, &[Window { record, range }], middle)? };
            endured.push(peak.iter().all(|p| *p <= trial.bound));
        }
        Ok(endured)
    }

    /// The mean squared error of a fit on parts of the held-out blocks, the same parts for every model.
    pub(crate) fn held_parts(&self, fit: &Fit, given: usize) -> Result<Vec<f64>, IdentifyError> {
        let mut trainer = self.trainer(&fit.derived, given)?;
        let hold = self.split(&trainer, usize::MAX / 8)?.hold;
        Ok(mean_squares(trainer.residuals(fit, &hold)?))
    }

    /// The held-out error, raised by the share of failed trials: what models are compared by.
    pub(crate) fn score(&self, stage: &Stage, given: usize) -> Result<f64, IdentifyError> {
        if !stage.held.rmse.is_finite() {
            return Ok(f64::INFINITY);
        }
        Ok(stage.held.rmse * (1.0 + PENALTY * self.failed_trials(&stage.fit, given)?))
    }
}

/// The mean squares of residuals, one list for each held-out block, on parts of equal length.
pub(crate) fn mean_squares(residuals: Vec<Vec<f64>>) -> Vec<f64> {
    let parts = PARTS.div_ceil(residuals.len().max(1));
    let mut out = Vec::new();
    for residual in &residuals {
        for part in residual.chunks(residual.len().div_ceil(parts).max(1)) {
            let there = part.iter().filter(|e| e.is_finite());
            let n = there.clone().count();
            out.push(there.map(|e| e * e).sum::<f64>() / n.max(1) as f64);
        }
    }
    out
}

/// Whether errors `a` exceed errors `b`, on the same parts, by no more than the standard error of their mean difference.
pub(crate) fn within_chance(a: &[f64], b: &[f64]) -> bool {
    let d: Vec<f64> = a.iter().zip(b).map(|(p, q)| p - q).collect();
    let n = d.len() as f64;
    let mean = d.iter().sum::<f64>() / n;
    let variance = d.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
    a.len() == b.len() && mean <= (variance / n).sqrt()
}

/// The trials: at some places of the recordings, inputs held, diminished and enlarged about their mean, with pulses.
fn trials(samples: &[Samples], y: Spread) -> Vec<Trial> {
    let half = 0.5 * (y.high - y.low);
    let middle = 0.5 * (y.low + y.high);
    let mut out = Vec::new();
    let step = samples.len().div_ceil(3).max(1);
    for s in samples.iter().step_by(step) {
        let n = s.y.len();
        let means: Vec<f64> = s.inputs.iter().map(|u| spread(u.iter()).map_or(0.0, |s| s.mean)).collect();
        let cut = |from: usize, len: usize| Samples {
            y: s.y[from..(from + len).min(n)].to_vec(),
            inputs: s.inputs.iter().map(|u| u[from..(from + len).min(n)].to_vec()).collect(),
        };
        for place in [0.0, 0.3, 0.55, 0.8] {
            let from = (place * n as f64) as usize;
            let free = (n / 10).clamp(1, 60);
            let mut held = cut(from, free);
            if !held.y.iter().chain(held.inputs.iter().flatten()).all(|v| v.is_finite()) {
                continue;
            }
            for column in held.inputs.iter_mut().chain([&mut held.y]) {
                let last = column.last().copied().unwrap_or(0.0);
                column.resize(free + HELD, last);
            }
            out.push(Trial { samples: held, bound: 2.0 * half });
        }
        for (place, scale) in [(0.1, 0.5), (0.5, 0.5), (0.1, 1.25), (0.5, 1.25)] {
            let mut scaled = cut((place * n as f64) as usize, STRETCH);
            if !scaled.y.iter().chain(scaled.inputs.iter().flatten()).all(|v| v.is_finite()) {
                continue;
            }
            for (u, mean) in scaled.inputs.iter_mut().zip(&means) {
                u.iter_mut().for_each(|v| *v = mean + scale * (*v - mean));
            }
            scaled.y.iter_mut().for_each(|v| *v = middle + scale * (*v - middle));
            out.push(Trial { samples: scaled, bound: 2.0 * f64::max(scale, 1.0) * half });
        }
        for (place, period) in [(0.2, 30), (0.6, 120)] {
            let mut pulsed = cut((place * n as f64) as usize, STRETCH);
            if !pulsed.y.iter().chain(pulsed.inputs.iter().flatten()).all(|v| v.is_finite()) {
                continue;
            }
            for u in &mut pulsed.inputs {
                let size = PULSE * spread(u.iter()).map_or(0.0, |s| s.std);
                for (n, v) in u.iter_mut().enumerate() {
                    // Up, nothing, down, nothing: the mean stays.
                    *v += size * [1.0, 0.0, -1.0, 0.0][n / period % 4];
                }
            }
            out.push(Trial { samples: pulsed, bound: 2.0 * half });
        }
    }
    out
}

impl From<hysid_dictionary::DictionaryError> for IdentifyError {
    fn from(error: hysid_dictionary::DictionaryError) -> Self {
        Self::Narx(NarxError::from(error))
    }
}
