//! Where calibrations start: the user's values, the linear core fitted to identified transfer functions and to the measured
//! frequency response, a seeded design.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::Data;
use super::frequency::{Line, measured_response, residuals};
use super::least_squares::{Limits, Normal, minimise};
use super::refined::identified_response;
use crate::engine::{Compiled, Run};

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

/// The linear core of a simulation, to be fitted to responses.
pub(crate) struct Core<'a> {
    compiled: &'a Compiled,
    data: &'a Data,
    estimated: &'a [usize],
    designed: &'a [Vec<f64>],
    /// The operating point: states and inputs.
    point: (Vec<f64>, Vec<f64>),
}

impl<'a> Core<'a> {
    /// The core beside the mean of the user's own simulation, or beside rest; `None` where there is nothing to fit.
    pub fn new(
        compiled: &'a Compiled,
        data: &'a Data,
        estimated: &'a [usize],
        designed: &'a [Vec<f64>],
        substeps: usize,
    ) -> Option<Self> {
        if compiled.simulation().is_static() || estimated.is_empty() {
            return None;
        }
        let user = compiled.theta();
        let short = data.drive.shortened(1000);
        let response = compiled.simulate(&Run::new(&short, &user).with_substeps(substeps));
        let mean = |s: &Vec<f64>| s.iter().sum::<f64>() / s.len().max(1) as f64;
        let x: Vec<f64> = match response.diverged {
            None => response.states.iter().map(mean).collect(),
            Some(_) => compiled.start_states(&user),
        };
        let u: Vec<f64> = data.drive.inputs().iter().map(mean).collect();
        Some(Self { compiled, data, estimated, designed, point: (x, u) })
    }

    /// Parameter sets for which the core fits the measured frequency response, best first; at most `count`.
    pub fn from_measured_response(&self, count: usize) -> Vec<Vec<f64>> {
        self.fitted(&measured_response(self.compiled, self.data), count)
    }

    /// Parameter sets for which the core fits the transfer functions that are identified from the record, best first; at most
    /// `count`.
    pub fn from_identification(&self, count: usize) -> Vec<Vec<f64>> {
        let user = self.compiled.theta();
        let (x, u) = &self.point;
        let at = |theta: &Vec<f64>| self.compiled.linearise(theta, x, u);
        let linear: Vec<_> = std::iter::once(&user).chain(self.designed.iter().take(2)).map(at).collect();
        self.fitted(&identified_response(self.compiled, self.data, &linear), count)
    }

    fn fitted(&self, lines: &[Line], count: usize) -> Vec<Vec<f64>> {
        if lines.len() < 4 {
            return Vec::new();
        }
        let Self { compiled, estimated, designed, point: (x, u), .. } = self;
        let user = compiled.theta();
        let period = self.data.drive.period_s();
        let at = |theta: &[f64]| residuals(compiled, lines, theta, x, u, period);
        let cost = |theta: &[f64]| at(theta).map_or(f64::INFINITY, |r| 0.5 * r.iter().map(|e| e * e).sum::<f64>());
        let mut ranked: Vec<(f64, &Vec<f64>)> =
            std::iter::once(&user).chain(*designed).map(|theta| (cost(theta), theta)).collect();
        ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
        let parameters = compiled.parameters();
        let bound = |upper: bool| -> Vec<f64> {
            let all = estimated.iter().filter_map(|&i| parameters.get(i));
            all.map(|p| if upper { p.upper() } else { p.lower() }).collect()
        };
        let (lower, upper) = (bound(false), bound(true));
        let mut found: Vec<(f64, Vec<f64>)> = Vec::new();
        for (_, theta) in ranked.into_iter().take(4) {
            let whole = |p: &[f64]| {
                let mut whole = theta.clone();
                for (&i, value) in estimated.iter().zip(p) {
                    whole[i] = *value;
                }
                whole
            };
            let start: Vec<f64> = estimated.iter().map(|&i| theta[i]).collect();
            let evaluate = |p: &[f64]| {
                let base = at(&whole(p))?;
                let mut columns = Vec::with_capacity(p.len());
                for k in 0..p.len() {
                    // Inwards at a bound.
                    let size = 1e-5 * p[k].abs().max(1e-6);
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
            let limits = Limits { iterations: 15, tolerance: 1e-3 };
            if let Some(minimum) = minimise(&start, &lower, &upper, limits, evaluate) {
                found.push((minimum.normal.cost, whole(&minimum.p)));
            }
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
}

/// Whether two parameter sets agree to 2 %.
pub(crate) fn same(a: &[f64], b: &[f64]) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 0.02 * a.abs().max(b.abs()) + 1e-12)
}
