//! What the linearised equations say about the transfer functions to one output: their order, the degrees of the numerators,
//! which poles are integrators, and where the user's own values put the rest.
//!
//! Order and degrees are read off the graph of the equations (which entry is zero), not from ranks: ranks depend on the units
//! and on a tolerance.

use nalgebra::{Complex, DMatrix};

use super::filter::eigenvalues;
use crate::engine::Linearisation;

/// Highest order that is identified.
const HIGHEST: usize = 8;

/// The form of the transfer functions from all inputs to one output.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Structure {
    /// The states between inputs and output; empty where some of them are too fast to be identified.
    pub states: Vec<usize>,
    /// Number of poles.
    pub order: usize,
    /// How many of them are at 0.
    pub integrators: usize,
    /// The highest power in each input's numerator; none where the input does not act.
    pub degrees: Vec<Option<usize>>,
    /// The other poles at the user's values, in 1/s or in the record's unit of time.
    pub poles: Vec<Complex<f64>>,
}

impl Structure {
    /// With the poles in another unit of time.
    pub fn in_unit(mut self, unit_s: f64) -> Self {
        self.poles.iter_mut().for_each(|p| *p *= unit_s);
        self
    }
}

/// The forms to try for output `j`: the equations' own and, where poles are too fast for the sampling, without those.
///
/// `linear` holds the linearised equations at the user's values first and at others, so that a zero by coincidence does not
/// pass for a zero by form.
pub(super) fn structures(linear: &[Linearisation], j: usize, period: f64, duration: f64) -> Vec<Structure> {
    let Some(first) = linear.first() else { return Vec::new() };
    let n = first.flow.len();
    let inputs = first.b.len().checked_div(n).unwrap_or(0);
    let any = |f: &dyn Fn(&Linearisation) -> f64| linear.iter().any(|l| f(l) != 0.0);
    // Steps from a state to the output: the states of the output itself are one away.
    let mut away: Vec<Option<usize>> = (0..n).map(|s| any(&|l| l.c[j * n + s]).then_some(1)).collect();
    for distance in 1..n {
        for s in 0..n {
            let leads = |t: usize| away[t] == Some(distance) && any(&|l| l.a[t * n + s]);
            if away[s].is_none() && (0..n).any(leads) {
                away[s] = Some(distance + 1);
            }
        }
    }
    let mut driven: Vec<bool> = (0..n).map(|s| (0..inputs).any(|i| any(&|l| l.b[s * inputs + i]))).collect();
    for _ in 0..n {
        for s in 0..n {
            driven[s] |= (0..n).any(|t| driven[t] && any(&|l| l.a[s * n + t]));
        }
    }
    let kept: Vec<usize> = (0..n).filter(|&s| away[s].is_some() && driven[s]).collect();
    let order = kept.len();
    if order == 0 || order > HIGHEST {
        return Vec::new();
    }
    let relative = |i: usize| {
        if any(&|l| l.d[j * inputs + i]) {
            return Some(0);
        }
        kept.iter().filter(|&&s| any(&|l| l.b[s * inputs + i])).filter_map(|&s| away[s]).min()
    };
    let degrees: Vec<Option<usize>> = (0..inputs).map(|i| relative(i).map(|r| order.saturating_sub(r))).collect();
    let poles = |l: &Linearisation| {
        let mut all = eigenvalues(DMatrix::from_fn(order, order, |a, b| l.a[kept[a] * n + kept[b]]))?;
        all.sort_by(|a, b| a.norm_sqr().total_cmp(&b.norm_sqr()));
        Some(all)
    };
    let at_rest = |all: &[Complex<f64>]| all.iter().filter(|p| p.norm() * duration < 1e-3).count();
    let Some(own) = poles(first) else { return Vec::new() };
    let integrators = linear.iter().filter_map(poles).map(|all| at_rest(&all)).min().unwrap_or(0);
    let whole = Structure {
        states: kept.clone(),
        order,
        integrators,
        degrees,
        poles: own.get(integrators..).unwrap_or_default().to_vec(),
    };
    let fast = whole.poles.iter().filter(|p| p.norm() * period > std::f64::consts::PI).count();
    let mut all = vec![whole];
    if fast > 0 && fast < order {
        let mut reduced = all[0].clone();
        reduced.states.clear();
        reduced.order -= fast;
        reduced.poles.truncate(reduced.poles.len() - fast);
        for degree in reduced.degrees.iter_mut().flatten() {
            *degree = if *degree == order { reduced.order } else { (*degree).min(reduced.order - 1) };
        }
        all.push(reduced);
    }
    all
}

/// Denominator (without its leading 1) and the numerators from all inputs to output `j`, lowest power first, of the linearised
/// equations of some states; time in units of `unit_s`. By Faddeev and Le Verrier.
pub(super) fn coefficients(
    linear: &Linearisation,
    j: usize,
    states: &[usize],
    unit_s: f64,
) -> (Vec<f64>, Vec<Vec<f64>>) {
    let (n, all) = (states.len(), linear.flow.len());
    let inputs = linear.b.len().checked_div(all).unwrap_or(0);
    let a = DMatrix::from_fn(n, n, |r, c| linear.a[states[r] * all + states[c]] * unit_s);
    let b = DMatrix::from_fn(n, inputs, |r, i| linear.b[states[r] * inputs + i] * unit_s);
    let c = DMatrix::from_fn(1, n, |_, s| linear.c[j * all + states[s]]);
    let mut denominator = vec![0.0; n];
    let mut numerators = vec![vec![0.0; n + 1]; inputs];
    // The adjoint of s - A has this matrix at the power n - k.
    let mut adjoint = DMatrix::zeros(n, n);
    let mut leading = 1.0;
    for k in 1..=n {
        adjoint = &a * adjoint + DMatrix::identity(n, n) * leading;
        leading = -(&a * &adjoint).trace() / k as f64;
        denominator[n - k] = leading;
        let through = &c * &adjoint * &b;
        for (i, numerator) in numerators.iter_mut().enumerate() {
            let direct = linear.d[j * inputs + i];
            numerator[n - k] = through[(0, i)] + direct * leading;
            numerator[n] = direct;
        }
    }
    (denominator, numerators)
}
