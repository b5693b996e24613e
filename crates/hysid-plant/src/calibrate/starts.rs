//! Where calibrations start: the user's values, the linear core fitted to identified transfer functions and to the measured
//! frequency response, a seeded design.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::Data;
use super::frequency::{Line, measured_response, residuals};
use super::least_squares::{Limits, Normal, minimise};
use super::refined::{Attained, identification};
use crate::engine::{Compiled, Linearisation, Run};

/// Bounds of a variable, finite on both sides for drawing.
fn drawing_range(value: f64, lower: f64, upper: f64) -> (f64, f64) {
    let size = value.abs().max(1e-3);
    let lo = if lower.is_finite() { lower } else { (value - 10.0 * size).min(upper - 10.0 * size) };
    let hi = if upper.is_finite() { upper } else { (value + 10.0 * size).max(lo + 10.0 * size) };
    (lo, hi)
}

/// `count` points: the first half within a factor of 3 about the user's values, the rest over the bounds.
///
/// An additive recurrence (R. Roberts' generalised golden ratio) with a seeded shift.
pub(crate) fn design(compiled: &Compiled, estimated: &[usize], count: usize, seed: u64) -> Vec<Vec<f64>> {
    let d = estimated.len();
    let mut phi = 2.0_f64;
    for _ in 0..40 {
        phi = (1.0 + phi).powf(1.0 / (d as f64 + 1.0));
    }
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let shift: Vec<f64> = (0..d).map(|_| random.random::<f64>()).collect();
    let parameters = compiled.parameters();
    (0..count)
        .map(|i| {
            let mut theta = compiled.theta();
            for (k, &number) in estimated.iter().enumerate() {
                let Some(p) = parameters.get(number) else { continue };
                let share = (shift[k] + (i + 1) as f64 * phi.powi(-(k as i32 + 1))).fract();
                let (mut lo, mut hi) = drawing_range(p.value, p.lower(), p.upper());
                let near = i < count / 2;
                if near && p.value != 0.0 {
                    let (a, b) = (p.value / 3.0, p.value * 3.0);
                    lo = lo.max(a.min(b));
                    hi = hi.min(a.max(b));
                }
                // Positive ranges over more than a decade are drawn by their logarithm.
                let floor = if lo == 0.0 && p.value > 0.0 { 1e-2 * p.value.min(hi) } else { lo };
                if let Some(slot) = theta.get_mut(number) {
                    *slot = if floor > 0.0 && hi > 10.0 * floor {
                        (floor * (hi / floor).powf(share)).clamp(lo, hi)
                    } else {
                        lo + share * (hi - lo)
                    };
                }
            }
            theta
        })
        .collect()
}

/// Fewest and most fits of the core to a response.
const FITS: (usize, usize) = (2, 8);
/// Mean square of a fit's residuals below which no better one is looked for, by their own uncertainty.
const KNOWN: f64 = 0.3;

/// The linear core of a simulation, to be fitted to responses.
pub(crate) struct Core<'a> {
    compiled: &'a Compiled,
    data: &'a Data,
    estimated: &'a [usize],
    user: &'a [f64],
    designed: &'a [Vec<f64>],
    /// The operating point: states and inputs.
    point: (Vec<f64>, Vec<f64>),
    /// Another one, at the highest values.
    edge: (Vec<f64>, Vec<f64>),
}

impl<'a> Core<'a> {
    /// The core beside the mean of the user's own simulation, or beside rest; `None` where there is nothing to fit.
    pub fn new(
        compiled: &'a Compiled,
        data: &'a Data,
        estimated: &'a [usize],
        user: &'a [f64],
        designed: &'a [Vec<f64>],
        substeps: usize,
    ) -> Option<Self> {
        if compiled.simulation().is_static() || estimated.is_empty() {
            return None;
        }
        let short = data.drive.shortened(1000);
        let response = compiled.simulate(&Run::new(&short, user).with_substeps(substeps));
        let mean = |s: &Vec<f64>| s.iter().sum::<f64>() / s.len().max(1) as f64;
        let at = |value: &dyn Fn(&Vec<f64>) -> f64| -> (Vec<f64>, Vec<f64>) {
            let x = match response.diverged {
                None => response.states.iter().map(value).collect(),
                Some(_) => compiled.start_states(user),
            };
            (x, data.drive.inputs().iter().map(value).collect())
        };
        let highest = |s: &Vec<f64>| s.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        Some(Self { compiled, data, estimated, user, designed, point: at(&mean), edge: at(&highest) })
    }

    /// Parameter sets for which the core fits the measured frequency response, best first; at most `count`.
    pub fn by_measured_response(&self, count: usize) -> Vec<Vec<f64>> {
        let lines = measured_response(self.compiled, self.data);
        if lines.len() < 4 {
            return Vec::new();
        }
        distinct(self.fitted(|theta| self.response_errors(&lines, theta), self.designed), count)
    }

    /// Parameter sets for which the core fits the transfer functions that are identified from the record, best first, at most
    /// `count`; with what those transfer functions leave of the outputs where there is nothing beside the
    /// core.
    pub fn by_identification(&self, count: usize) -> (Vec<Vec<f64>>, Option<Vec<Attained>>) {
        let tried = std::iter::once(self.user).chain(self.designed.iter().map(Vec::as_slice).take(2));
        let linear: Vec<_> = tried.map(|theta| self.linear(theta)).collect();
        let Some(found) = identification(self.compiled, self.data, &linear) else {
            return (Vec::new(), None);
        };
        let lines = found.lines(self.compiled, self.data);
        // Coefficients lead there from far away, the response weighs them right.
        let near = self.fitted(|theta| found.coefficient_errors(&self.linear(theta)), self.designed);
        let near = if near.is_empty() { self.designed.to_vec() } else { distinct(near, FITS.1) };
        (
            distinct(self.fitted(|theta| self.response_errors(&lines, theta), &near), count),
            found.attained().filter(|_| self.is_all()),
        )
    }

    /// Whether the core is the whole simulation, as far as can be seen: the same everywhere, and moved by every parameter.
    fn is_all(&self) -> bool {
        let matrices = |theta: &[f64], (x, u): &(Vec<f64>, Vec<f64>)| {
            let l = self.compiled.linearise(theta, x, u);
            [l.a, l.b, l.c, l.d].concat()
        };
        let own = matrices(self.user, &self.point);
        let differs = |other: &[f64]| {
            own.iter().zip(other).any(|(a, b)| a.is_nan() || b.is_nan() || (a - b).abs() > 1e-9 * a.abs().max(b.abs()))
        };
        let moves = |&i: &usize| {
            let mut theta = self.user.to_vec();
            theta[i] = if theta[i] == 0.0 { 1.0 } else { 1.001 * theta[i] };
            differs(&matrices(&theta, &self.point))
        };
        !differs(&matrices(self.user, &self.edge)) && self.estimated.iter().all(moves)
    }

    fn linear(&self, theta: &[f64]) -> Linearisation {
        self.compiled.linearise(theta, &self.point.0, &self.point.1)
    }

    fn response_errors(&self, lines: &[Line], theta: &[f64]) -> Option<Vec<f64>> {
        residuals(self.compiled, lines, theta, &self.point.0, &self.point.1, self.data.drive.period_s())
    }

    /// Fits with their costs, the user's values first, then from the closest of some others.
    fn fitted(&self, at: impl Fn(&[f64]) -> Option<Vec<f64>>, others: &[Vec<f64>]) -> Vec<(f64, Vec<f64>)> {
        let cost = |theta: &[f64]| at(theta).map_or(f64::INFINITY, |r| 0.5 * r.iter().map(|e| e * e).sum::<f64>());
        let mut ranked: Vec<(f64, &[f64])> = others.iter().map(|theta| (cost(theta), theta.as_slice())).collect();
        ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
        let parameters = self.compiled.parameters();
        let scales: Vec<Scale> =
            self.estimated.iter().filter_map(|&i| parameters.get(i)).map(|p| Scale::of(p.lower(), p.upper())).collect();
        let lower: Vec<f64> = scales.iter().map(|s| s.lower).collect();
        let upper: Vec<f64> = scales.iter().map(|s| s.upper).collect();
        // Fewer where one of them is as close as the response itself is known.
        let known = at(self.user).map_or(0.0, |r| KNOWN * 0.5 * r.len() as f64);
        let mut found: Vec<(f64, Vec<f64>)> = Vec::new();
        let tried = std::iter::once(self.user).chain(ranked.into_iter().map(|(_, theta)| theta));
        for (done, theta) in tried.take(FITS.1).enumerate() {
            if done >= FITS.0 && found.iter().any(|(cost, _)| *cost < known) {
                break;
            }
            let whole = |p: &[f64]| {
                let mut whole = theta.to_vec();
                for ((&i, value), scale) in self.estimated.iter().zip(p).zip(&scales) {
                    whole[i] = scale.value(*value);
                }
                whole
            };
            let start: Vec<f64> = self.estimated.iter().zip(&scales).map(|(&i, s)| s.variable(theta[i])).collect();
            let evaluate = |p: &[f64]| {
                let base = at(&whole(p)).filter(|r| !r.is_empty())?;
                let mut columns = Vec::with_capacity(p.len());
                for k in 0..p.len() {
                    // Inwards at a bound.
                    let size = if scales[k].logarithmic { 1e-5 } else { 1e-5 * p[k].abs().max(1e-6) };
                    let eps = if p[k] + size > upper[k] { -size } else { size };
                    let mut moved = p.to_vec();
                    moved[k] += eps;
                    let shifted = at(&whole(&moved)).filter(|s| s.len() == base.len())?;
                    columns.push(shifted.iter().zip(&base).map(|(s, b)| (s - b) / eps).collect::<Vec<f64>>());
                }
                let mut normal = Normal::zero(p.len());
                let index: Vec<usize> = (0..p.len()).collect();
                let columns: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
                normal.add(&base, &columns, &index);
                Some(normal)
            };
            let limits = Limits { iterations: 25, tolerance: 1e-3 };
            if let Some(minimum) = minimise(&start, &lower, &upper, limits, evaluate) {
                found.push((minimum.normal.cost, whole(&minimum.p)));
            }
        }
        found
    }
}

/// How a parameter varies in a fit: by its logarithm where its bounds are above 0.
struct Scale {
    logarithmic: bool,
    lower: f64,
    upper: f64,
}

impl Scale {
    fn of(lower: f64, upper: f64) -> Self {
        let logarithmic = lower > 0.0;
        if logarithmic {
            Self { logarithmic, lower: lower.ln(), upper: upper.ln() }
        } else {
            Self { logarithmic, lower, upper }
        }
    }

    fn variable(&self, value: f64) -> f64 {
        if self.logarithmic { value.ln() } else { value }
    }

    fn value(&self, variable: f64) -> f64 {
        if self.logarithmic { variable.exp() } else { variable }
    }
}

/// The best of some fits that differ, at most `count`; where parameters are not settled one by one, the first comes first,
/// which began at the user's values.
fn distinct(mut found: Vec<(f64, Vec<f64>)>, count: usize) -> Vec<Vec<f64>> {
    let least = found.iter().map(|(cost, _)| *cost).fold(f64::INFINITY, f64::min);
    if let Some((cost, _)) = found.first_mut().filter(|(cost, _)| *cost <= 1.05 * least) {
        *cost = least;
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut distinct: Vec<Vec<f64>> = Vec::new();
    for (_, theta) in found {
        if !distinct.iter().any(|known| same(known, &theta)) {
            distinct.push(theta);
        }
    }
    distinct.truncate(count);
    distinct
}

/// Whether two parameter sets agree to 2 %.
pub(crate) fn same(a: &[f64], b: &[f64]) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 0.02 * a.abs().max(b.abs()) + 1e-12)
}
