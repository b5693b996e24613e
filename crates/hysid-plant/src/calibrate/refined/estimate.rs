//! Simplified refined instrumental variables for one output: transfer functions in continuous time from samples.
//!
//! With the model's own noise-free output x and its residual e = y - x, the equation error of the filtered data is e itself, so
//! that one iteration is `d = (sum z f')^-1 sum z e`, where `z` (instruments) are the filtered inputs and the filtered x, and
//! `f` the same with x + e in place of x. Filters of the inputs, and those of x, are exact under the inputs' hold; only e has to
//! be interpolated, which does not matter to where the iteration comes to rest.

use nalgebra::{Complex, DMatrix, DVector};

use super::filter::{Source, cascade, filtered, polynomial, roots};
use super::structure::Structure;
use crate::document::Hold;

/// One output beside the inputs, without gaps.
#[derive(Debug, Clone, Copy)]
pub(super) struct Record<'a> {
    pub inputs: &'a [Vec<f64>],
    pub output: &'a [f64],
    pub hold: Hold,
    /// Sampling period in the unit of time of the coefficients.
    pub period: f64,
}

impl Record<'_> {
    fn duration(&self) -> f64 {
        self.period * self.output.len() as f64
    }
}

/// Transfer functions with a common denominator, coefficients lowest power first.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Model {
    /// The denominator without its leading 1.
    pub a: Vec<f64>,
    /// The lowest coefficients of the denominator that are 0 by form.
    pub integrators: usize,
    /// Each input's numerator, empty where it does not act.
    pub b: Vec<Vec<f64>>,
    /// What the response to a constant and to the state at the first sample adds: one coefficient, then n; empty where the
    /// record starts at rest.
    pub nuisance: Vec<f64>,
    /// Mean square of the residual.
    pub variance: f64,
    /// Covariance of the free coefficients of `a`, then those of `b`, by columns.
    pub covariance: Vec<f64>,
}

/// The regressors of one iteration.
pub(super) struct Regression {
    residual: Vec<f64>,
    /// Columns of the instruments: denominator, numerators, nuisance.
    instruments: Vec<Vec<f64>>,
    /// What the residual adds to the denominator's columns.
    disturbed: Vec<Vec<f64>>,
    /// Number of nuisance columns.
    nuisance: usize,
}

impl Model {
    /// A denominator with these poles and the integrators of a structure; nothing else is known yet.
    pub fn new(structure: &Structure, poles: &[Complex<f64>], at_rest: bool) -> Self {
        let mut a = vec![0.0; structure.integrators];
        a.extend(polynomial(poles));
        let b = structure.degrees.iter().map(|d| d.map_or(Vec::new(), |d| vec![0.0; d + 1])).collect();
        let nuisance = vec![0.0; if at_rest { 0 } else { a.len() + 1 }];
        let integrators = structure.integrators;
        Self { a, integrators, b, nuisance, variance: f64::INFINITY, covariance: Vec::new() }
    }

    /// Number of free coefficients.
    pub fn unknowns(&self) -> usize {
        self.a.len() - self.integrators + self.b.iter().map(Vec::len).sum::<usize>() + self.nuisance.len()
    }

    /// The residual and the regressors at this model; `None` where a filter is not finite.
    pub fn regression(&self, record: Record<'_>) -> Option<Regression> {
        let n = self.a.len();
        let samples = record.output.len();
        let mut response = vec![0.0; samples];
        let mut denominator = vec![vec![0.0; samples]; n - self.integrators];
        let mut columns = Vec::new();
        let mut add = |source: Source<'_>, b: &[f64]| {
            let part = cascade(&self.a, b, source, samples, record.period)?;
            sum(&mut response, &part.response, 1.0);
            for (column, more) in denominator.iter_mut().zip(part.of_response.iter().skip(self.integrators)) {
                sum(column, more, -1.0);
            }
            let mut states = part.states;
            if let (Source::Series(series, _), true) = (source, b.len() > n) {
                // s^n/A u = u - sum a_k s^k/A u.
                let mut top = series.to_vec();
                for (a, state) in self.a.iter().zip(&states) {
                    sum(&mut top, state, -a);
                }
                states.push(top);
            }
            states.truncate(b.len());
            columns.extend(states);
            Some(())
        };
        for (series, b) in record.inputs.iter().zip(&self.b).filter(|(_, b)| !b.is_empty()) {
            add(Source::Series(series, record.hold), b)?;
        }
        if let Some((constant, initial)) = self.nuisance.split_first() {
            add(Source::Constant, &[*constant])?;
            add(Source::Impulse, initial)?;
        }
        let residual: Vec<f64> = record.output.iter().zip(&response).map(|(y, x)| y - x).collect();
        let disturbed: Vec<Vec<f64>> = filtered(&self.a, &residual, record.period)?
            .into_iter()
            .skip(self.integrators)
            .map(|column| column.iter().map(|e| -e).collect())
            .collect();
        let mut instruments = denominator;
        instruments.extend(columns);
        let finite = residual.iter().chain(instruments.iter().flatten()).all(|x| x.is_finite());
        finite.then_some(Regression { residual, instruments, disturbed, nuisance: self.nuisance.len() })
    }

    /// The model with its free coefficients moved by `step`, its poles kept where they can be.
    fn moved(&self, step: &[f64], record: Record<'_>) -> Option<Self> {
        let mut next = self.clone();
        let free = next.a.iter_mut().skip(self.integrators);
        let all = free.chain(next.b.iter_mut().flatten()).chain(next.nuisance.iter_mut());
        all.zip(step).for_each(|(slot, d)| *slot += d);
        let poles = roots(next.a.get(self.integrators..)?)?;
        let kept: Vec<Complex<f64>> = poles.iter().map(|p| keep(*p, record)).collect();
        if kept != poles {
            next.a.truncate(self.integrators);
            next.a.extend(polynomial(&kept));
        }
        Some(next)
    }

    /// Iterates from this model, by least squares first where nothing but the poles is known; the model with the smallest
    /// residual on the way. `None` where not one iteration succeeds.
    pub fn refined(&self, record: Record<'_>, iterations: usize) -> Option<Self> {
        let power = record.output.iter().map(|y| y * y).sum::<f64>();
        let samples = record.output.len() as f64;
        let mut model = self.clone();
        let mut best: Option<Self> = None;
        for _ in 0..=iterations {
            let Some(regression) = model.regression(record) else { break };
            let fresh = model.b.iter().flatten().all(|b| *b == 0.0);
            let squares = regression.residual.iter().map(|e| e * e).sum::<f64>();
            model.variance = squares / samples;
            if !fresh && best.as_ref().is_none_or(|b| model.variance < b.variance) {
                model.covariance = regression.covariance(model.variance).unwrap_or_default();
                best = Some(model.clone());
            }
            let Some((step, change)) = regression.step(!fresh) else { break };
            // A hundredth of the residual's deviation, or the last digits of the output.
            if !fresh && change <= (1e-4 * squares).max(1e-24 * power) {
                break;
            }
            let Some(next) = model.moved(&step, record) else { break };
            model = next;
        }
        best.filter(|b| !b.covariance.is_empty())
    }
}

/// A pole reflected into the left half-plane, away from the axis by a hundredth of the record's inverse, and within reach of the
/// sampling.
pub(super) fn keep(pole: Complex<f64>, record: Record<'_>) -> Complex<f64> {
    let fastest = 3.0 * std::f64::consts::PI / record.period;
    let size = pole.norm();
    let pole = if size > fastest { pole * (fastest / size) } else { pole };
    let slowest = 0.01 / record.duration();
    Complex::new(-pole.re.abs().max(slowest), pole.im)
}

impl Regression {
    /// The step of the coefficients and the change of the output that it makes (sum of squares, to first order); the
    /// regressors are their own instruments (least squares) where not `instrumental`.
    pub fn step(&self, instrumental: bool) -> Option<(Vec<f64>, f64)> {
        let regressors: Vec<Vec<f64>> =
            self.instruments.iter().enumerate().map(|(k, z)| self.regressor(k, z)).collect();
        let z = if instrumental { &self.instruments } else { &regressors };
        let scale: Vec<f64> = z.iter().zip(&regressors).map(|(z, f)| norm(z).max(1e-3 * norm(f))).collect();
        if scale.iter().any(|s| !(s.is_finite() && *s > 0.0)) {
            return None;
        }
        let n = z.len();
        let mut matrix =
            DMatrix::from_fn(n, n, |i, j| hysid_linalg::dot(&z[i], &regressors[j]) / (scale[i] * scale[j]));
        // What a constant or the state at the first sample explains as well as an input does is left to the input.
        for k in n - self.nuisance..n {
            matrix[(k, k)] += 1e-6;
        }
        let right = DVector::from_fn(n, |i, _| hysid_linalg::dot(&z[i], &self.residual) / scale[i]);
        let scaled = matrix.lu().solve(&right).filter(|s| s.iter().all(|x| x.is_finite()))?;
        let step: Vec<f64> = scaled.iter().zip(&scale).map(|(s, scale)| s / scale).collect();
        let mut moved = vec![0.0; self.residual.len()];
        for (z, d) in self.instruments.iter().zip(&step) {
            sum(&mut moved, z, *d);
        }
        Some((step, hysid_linalg::dot(&moved, &moved)))
    }

    fn regressor(&self, k: usize, instrument: &[f64]) -> Vec<f64> {
        match self.disturbed.get(k) {
            Some(more) => instrument.iter().zip(more).map(|(z, e)| z + e).collect(),
            None => instrument.to_vec(),
        }
    }

    /// The covariance of denominator and numerators for white noise of this variance.
    fn covariance(&self, variance: f64) -> Option<Vec<f64>> {
        let z = &self.instruments;
        let n = z.len();
        let scale: Vec<f64> = z.iter().map(|z| norm(z).max(f64::MIN_POSITIVE)).collect();
        let matrix = DMatrix::from_fn(n, n, |i, j| {
            hysid_linalg::dot(&z[i], &z[j]) / (scale[i] * scale[j]) + if i == j { 1e-12 } else { 0.0 }
        });
        let inverse = matrix.cholesky()?.inverse();
        let kept = n - self.nuisance;
        let entry = |i: usize, j: usize| variance * inverse[(i, j)] / (scale[i] * scale[j]);
        Some((0..kept * kept).map(|at| entry(at % kept, at / kept)).collect())
    }
}

fn norm(series: &[f64]) -> f64 {
    hysid_linalg::dot(series, series).sqrt()
}

fn sum(into: &mut [f64], series: &[f64], factor: f64) {
    into.iter_mut().zip(series).for_each(|(a, b)| *a += factor * b);
}
