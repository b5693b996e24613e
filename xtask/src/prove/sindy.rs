//! The discrepancy competitor: sparse regression of the missing force on smoothed derivatives, then simulated.
//!
//! For plants with one mass: displacement is smoothed by a local cubic (Savitzky-Golay), its derivatives give the force that the recalibrated
//! baseline misses, and sequentially thresholded least squares picks terms of a static library
//! `1, q, v, q^2, q^3, v|v|, q^2 v, sgn v`. After Kaheman, Kaiser, Strom, Kutz, Brunton 2019.

use hysid_concealed::body::{Body, body};
use hysid_concealed::case::Case;
use hysid_concealed::input::Input;
use hysid_concealed::law::{Effect, Law};
use hysid_concealed::machine::Machine;
use hysid_concealed::refit::solve;

/// Half-width of the smoothing window in samples.
const HALF: usize = 6;
/// A term whose share of the explained force is smaller is dropped.
const THRESHOLD: f64 = 0.05;

/// The baseline with the terms found; `None` for plants that are not one mass.
pub fn discrepancy(case: &Case, calibrated: &Machine) -> Option<Machine> {
    let Body::Chain(chain) = body(case.design.kind, &calibrated.theta) else { return None };
    let Input::Held { values: u, period, .. } = &case.est.input else { return None };
    if chain.n != 1 {
        return None;
    }
    let y = &case.est.y[0];
    let mut features: Vec<Vec<f64>> = vec![Vec::new(); LIBRARY];
    let mut missing = Vec::new();
    for n in HALF..y.len().saturating_sub(HALF) {
        let (q, v, a) = smooth(&y[n - HALF..=n + HALF], *period);
        let friction = chain.friction * v.signum();
        let known = chain.m[0] * a + chain.c[0] * v + chain.k[0] * q + chain.gravity * q.sin() + friction;
        missing.push(chain.gain * u[n] - known);
        let row = [1.0, q, v, q * q, q.powi(3), v * v.abs(), q * q * v, v.signum()];
        for (column, value) in features.iter_mut().zip(row) {
            column.push(value);
        }
    }
    let weights = sparse(&features, &missing);
    let mut machine = calibrated.clone();
    // Linear terms belong to the parameters where the plant has them.
    let kind = case.design.kind;
    let place = |name: &str| kind.parameters().iter().position(|p| *p == name);
    if let Some(k) = place("k") {
        machine.theta[k] = (machine.theta[k] + weights[1]).max(1e-9 * machine.theta[k]);
    }
    if let Some(c) = place("c").or(place("b")) {
        machine.theta[c] = (machine.theta[c] + weights[2]).max(1e-9 * machine.theta[c]);
    }
    let mut add = |law: Law, w: f64| {
        if w != 0.0 {
            machine.effects.push(Effect::new(law, vec![w]));
        }
    };
    add(Law::InputOffset, -weights[0] / chain.gain);
    add(Law::QuadraticStiffness, weights[3]);
    add(Law::Cubic, weights[4]);
    add(Law::QuadraticDamping, weights[5]);
    add(Law::DisplacementDamping, weights[6]);
    add(Law::Coulomb, weights[7].max(0.0));
    Some(machine)
}

const LIBRARY: usize = 8;

/// Value and first two derivatives in the middle of an odd window, from the least-squares cubic.
fn smooth(window: &[f64], period: f64) -> (f64, f64, f64) {
    let half = (window.len() / 2) as f64;
    let mut s = [0.0; 7];
    let mut b = [0.0; 4];
    for (i, y) in window.iter().enumerate() {
        let x = i as f64 - half;
        for (k, s) in s.iter_mut().enumerate() {
            *s += x.powi(k as i32);
        }
        for (k, b) in b.iter_mut().enumerate() {
            *b += y * x.powi(k as i32);
        }
    }
    let normal: Vec<f64> = (0..16).map(|i| s[i / 4 + i % 4]).collect();
    let c = solve(&normal, &b, 4, 0.0).unwrap_or_else(|| vec![0.0; 4]);
    (c[0], c[1] / period, 2.0 * c[2] / (period * period))
}

/// Sequentially thresholded least squares.
fn sparse(features: &[Vec<f64>], target: &[f64]) -> Vec<f64> {
    let p = features.len();
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    let mut active: Vec<usize> = (0..p).collect();
    let mut weights = vec![0.0; p];
    for _ in 0..p {
        let n = active.len();
        if n == 0 {
            break;
        }
        let normal: Vec<f64> = (0..n * n).map(|i| dot(&features[active[i / n]], &features[active[i % n]])).collect();
        let right: Vec<f64> = active.iter().map(|i| dot(&features[*i], target)).collect();
        let Some(found) = solve(&normal, &right, n, 1e-12) else { break };
        weights.fill(0.0);
        for (i, w) in active.iter().zip(&found) {
            weights[*i] = *w;
        }
        let size = |i: usize| weights[i].abs() * dot(&features[i], &features[i]).sqrt();
        let largest = active.iter().map(|i| size(*i)).fold(0.0, f64::max);
        let kept: Vec<usize> = active.iter().copied().filter(|i| size(*i) >= THRESHOLD * largest).collect();
        if kept.len() == active.len() {
            break;
        }
        active = kept;
    }
    weights
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cubic_is_differentiated_exactly_and_a_sparse_law_found() {
        let h = 0.1;
        let window: Vec<f64> =
            (0..13).map(|i| 2.0 + 3.0 * ((i as f64 - 6.0) * h) - ((i as f64 - 6.0) * h).powi(2)).collect();
        let (q, v, a) = smooth(&window, h);
        assert!((q - 2.0).abs() < 1e-9 && (v - 3.0).abs() < 1e-9 && (a + 2.0).abs() < 1e-8, "{q} {v} {a}");
        let x: Vec<f64> = (0..200).map(|i| (f64::from(i) * 0.1).sin()).collect();
        let columns = vec![x.clone(), x.iter().map(|v| v * v).collect(), x.iter().map(|v| v.powi(3)).collect()];
        let target: Vec<f64> = x.iter().map(|v| 5.0 * v.powi(3)).collect();
        let w = sparse(&columns, &target);
        assert!(w[0] == 0.0 && w[1] == 0.0 && (w[2] - 5.0).abs() < 1e-9, "{w:?}");
    }
}
