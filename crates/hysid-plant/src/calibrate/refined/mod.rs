//! A start for the calibration from a linear identification in the time domain: refined instrumental variables in continuous
//! time.
//!
//! The linearised equations give the form of the transfer functions (`structure.rs`), the record their coefficients
//! (`estimate.rs`), and the linear core is fitted to these, then by the same distance as to a measured frequency response. Against
//! that response the coefficients have no windows: a record of a few periods will do, and noise on the output, whatever its
//! colour, leaves them without bias.
//! References: P. Young, A. Jakeman, Refined instrumental variable methods of recursive time-series analysis, Part III, Int. J.
//! Control 31 (1980); H. Garnier, L. Wang (eds.), Identification of Continuous-time Models from Sampled Data, 2008, chapter 4.

mod estimate;
mod filter;
mod structure;
#[cfg(test)]
mod tests;

use nalgebra::Complex;

use super::Data;
use super::frequency::{C, Line, hold_response};
use crate::engine::{Compiled, Linearisation};
use estimate::{Model, Record, keep};
use filter::roots;
use structure::{Structure, coefficients, structures};

/// Lines at which the transfer functions are told, beside those at resonances.
const LINES: usize = 40;
/// Fewest samples for each unknown.
const FOR_EACH: usize = 5;
/// Iterations from every start, and from the best of them.
const ITERATIONS: (usize, usize) = (4, 30);

/// The transfer functions to one output, in a unit of time of their own.
struct Identified {
    model: Model,
    /// The states whose equations they belong to, if they are all there.
    states: Vec<usize>,
    /// The unit of time in seconds.
    unit_s: f64,
}

/// How far a linear model with free coefficients follows one output.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Attained {
    /// Mean square of its residual.
    pub mean_square: f64,
    /// Its free coefficients.
    pub unknowns: usize,
}

/// The transfer functions that were identified from a record, to each output where that succeeded.
pub(crate) struct Identification {
    outputs: Vec<Option<Identified>>,
    inputs: usize,
}

/// Identifies the linear core; `None` where no output allows it.
///
/// `linear` holds the linearised equations at the user's values first, and at others. Outputs with gaps are left out.
pub(crate) fn identification(compiled: &Compiled, data: &Data, linear: &[Linearisation]) -> Option<Identification> {
    let inputs = data.drive.inputs().len();
    if inputs == 0 || data.is_empty() {
        return None;
    }
    let outputs: Vec<_> = (0..data.measured.len()).map(|j| identify(compiled, data, linear, j)).collect();
    outputs.iter().any(Option::is_some).then_some(Identification { outputs, inputs })
}

impl Identification {
    /// Each output's mean square residual under free coefficients, and what fewer of them may add to it by chance; `None` where
    /// not every output was identified.
    pub fn attained(&self) -> Option<Vec<Attained>> {
        let each = |found: &Option<Identified>| {
            let model = &found.as_ref()?.model;
            Some(Attained { mean_square: model.variance, unknowns: model.unknowns() })
        };
        self.outputs.iter().map(each).collect()
    }

    /// As lines of a frequency response with their certainty.
    pub fn lines(&self, compiled: &Compiled, data: &Data) -> Vec<Line> {
        let period = data.drive.period_s();
        let line = |omega: f64| {
            let hold = hold_response(compiled.hold(), omega * period);
            let mut response = Vec::with_capacity(self.outputs.len() * self.inputs);
            for identified in &self.outputs {
                match identified {
                    Some(found) => response.extend((0..self.inputs).map(|i| found.at(i, omega, hold))),
                    None => response.extend(std::iter::repeat_n((C::new(0.0, 0.0), 0.0), self.inputs)),
                }
            }
            Line { omega, response }
        };
        frequencies(&self.outputs, period, data.len()).into_iter().map(line).collect()
    }

    /// The logarithms of the coefficients of linearised equations by those identified, each by its certainty; `None` where
    /// they are not finite.
    ///
    /// Where parameters are factors of terms, logarithms of coefficients change evenly with logarithms of parameters, and a
    /// search is not caught between resonances as it is in the distance between responses.
    pub fn coefficient_errors(&self, linear: &Linearisation) -> Option<Vec<f64>> {
        let mut out = Vec::new();
        for (j, found) in self.outputs.iter().enumerate() {
            let Some(found) = found.as_ref().filter(|f| !f.states.is_empty()) else { continue };
            let (a, b) = coefficients(linear, j, &found.states, found.unit_s);
            let model = &found.model;
            let free = |a: &[f64]| a.get(model.integrators..).unwrap_or_default().to_vec();
            let mut pairs: Vec<(f64, f64)> = free(&a).into_iter().zip(free(&model.a)).collect();
            for (own, given) in b.iter().zip(&model.b) {
                pairs.extend(own.iter().copied().zip(given.iter().copied()));
            }
            let unknowns = pairs.len();
            for (k, (own, given)) in pairs.into_iter().enumerate() {
                let deviation = model.covariance.get(k + k * unknowns).copied().unwrap_or(f64::NAN).max(0.0).sqrt();
                let certainty = (given.abs() / deviation.max(f64::MIN_POSITIVE)).min(10.0);
                if !own.is_finite() {
                    return None;
                }
                if certainty >= 2.0 {
                    out.push(certainty * (own / given).max(1e-4).ln().min(10.0));
                }
            }
        }
        Some(out)
    }
}

/// Frequencies evenly in their logarithm from one period in the record to the Nyquist frequency, and about each resonance.
fn frequencies(all: &[Option<Identified>], period: f64, samples: usize) -> Vec<f64> {
    let (low, high) = (std::f64::consts::TAU / (period * samples as f64), 0.95 * std::f64::consts::PI / period);
    let share = |i: usize| i as f64 / (LINES - 1) as f64;
    let mut out: Vec<f64> = (0..LINES).map(|i| low * (high / low).powf(share(i))).collect();
    for found in all.iter().flatten() {
        let poles = roots(&found.model.a).unwrap_or_default();
        for pole in poles.iter().filter(|p| p.im > 0.3 * p.norm()) {
            let about = |k: i32| (pole.norm() + f64::from(k) * 0.7 * pole.re.abs()) / found.unit_s;
            out.extend((-2..=2).map(about).filter(|w| *w > low && *w < high));
        }
    }
    out.sort_by(f64::total_cmp);
    out
}

/// The transfer functions to output `j` with the least residual, over the forms and over starts; the longer form and the more
/// unknowns by BIC.
fn identify(compiled: &Compiled, data: &Data, linear: &[Linearisation], j: usize) -> Option<Identified> {
    let output = data.measured.get(j)?;
    if output.iter().any(|y| !y.is_finite()) {
        return None;
    }
    let (period, samples) = (data.drive.period_s(), output.len());
    let duration = period * samples as f64;
    let mut best: Option<(f64, Identified)> = None;
    for structure in structures(linear, j, period, duration) {
        let sizes = structure.poles.iter().map(|p| p.norm().clamp(1.0 / duration, 1.0 / period).ln());
        let unit_s = (-sizes.sum::<f64>() / structure.poles.len().max(1) as f64).exp();
        let structure = structure.in_unit(unit_s);
        let record = Record { inputs: data.drive.inputs(), output, hold: compiled.hold(), period: period / unit_s };
        let Some(whole) = from_starts(&structure, record) else { continue };
        let mut candidates = vec![whole];
        if data.free.is_empty() {
            // At rest at the first sample, perhaps, which takes fewer unknowns.
            let mut rest = candidates[0].clone();
            rest.nuisance.clear();
            candidates.extend(rest.refined(record, ITERATIONS.1));
        }
        for model in candidates {
            let bic = samples as f64 * model.variance.max(f64::MIN_POSITIVE).ln()
                + model.unknowns() as f64 * (samples as f64).ln();
            if best.as_ref().is_none_or(|(least, _)| bic < *least) {
                best = Some((bic, Identified { model, states: structure.states.clone(), unit_s }));
            }
        }
    }
    best.map(|(_, identified)| identified)
}

/// Iterations from the user's poles and from poles of one size each over the record's range; the best is followed to its end.
fn from_starts(structure: &Structure, record: Record<'_>) -> Option<Model> {
    let count = structure.poles.len();
    let own: Vec<Complex<f64>> = structure.poles.iter().map(|p| keep(*p, record)).collect();
    let samples = record.output.len();
    let slow = 10.0 / (record.period * samples as f64);
    let fast = 1.0 / record.period;
    let spread = |i: u32| vec![Complex::new(-slow * (fast / slow).powf(f64::from(i) / 3.0), 0.0); count];
    let starts = std::iter::once(own).chain((0..if count == 0 { 0 } else { 4 }).map(spread));
    let mut best: Option<Model> = None;
    for poles in starts {
        let model = Model::new(structure, &poles, false);
        if samples < FOR_EACH * model.unknowns() {
            return None;
        }
        if let Some(found) = model.refined(record, ITERATIONS.0)
            && best.as_ref().is_none_or(|b| found.variance < b.variance)
        {
            best = Some(found);
        }
    }
    best?.refined(record, ITERATIONS.1)
}

impl Identified {
    /// The response to input `i` under the hold, with its certainty: its size by its standard deviation, at most 10 and 0 where
    /// it is below one half.
    fn at(&self, i: usize, omega: f64, hold: C) -> (C, f64) {
        let model = &self.model;
        let n = model.a.len();
        let Some(b) = model.b.get(i).filter(|b| !b.is_empty()) else { return (C::new(0.0, 0.0), 0.0) };
        let s = C::new(0.0, omega * self.unit_s);
        let powers: Vec<C> = (0..=n).map(|k| s.powu(k as u32)).collect();
        let value = |c: &[f64]| c.iter().zip(&powers).map(|(c, s)| s * *c).sum::<C>();
        let denominator = value(&model.a) + powers[n];
        let g = value(b) / denominator;
        // Derivatives of B/A by the coefficients.
        let free = n - model.integrators;
        let before: usize = free + model.b.iter().take(i).map(Vec::len).sum::<usize>();
        let mut slopes: Vec<(usize, C)> =
            (0..free).map(|k| (k, -g * powers[k + model.integrators] / denominator)).collect();
        slopes.extend((0..b.len()).map(|k| (before + k, powers[k] / denominator)));
        let unknowns = (model.covariance.len() as f64).sqrt() as usize;
        let mut variance = 0.0;
        for (p, x) in &slopes {
            for (q, y) in &slopes {
                variance += (x * y.conj()).re * model.covariance.get(p + q * unknowns).copied().unwrap_or(f64::NAN);
            }
        }
        let direct = b.get(n).copied().unwrap_or(0.0);
        let measured = (g - direct) * hold + direct;
        let certainty = (g.norm_sqr() / variance.max(f64::MIN_POSITIVE)).sqrt().min(10.0);
        let usable = measured.norm() > 0.0 && measured.is_finite() && certainty >= 0.5;
        (measured, if usable { certainty } else { 0.0 })
    }
}
