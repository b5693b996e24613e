//! A start for the calibration from the measured frequency response: the linear core is fitted to it without simulating.
//!
//! The response is the best linear approximation by Welch's method (H1); the distance to the linearised equations is taken
//! between logarithms, so that a resonance far from the measured one still feels where to go. Lines are weighted by their
//! coherence. It is a start, not an estimate: noise bias and windowing do not matter at that point.
//! Reference: R. Pintelon, J. Schoukens, System Identification: A Frequency Domain Approach, 2012, chapter 4.

use nalgebra::Complex;

use super::Data;
use crate::document::Hold;
use crate::engine::Compiled;

pub(crate) type C = Complex<f64>;

/// One line of a response from samples to samples.
pub(crate) struct Line {
    /// Radians per second.
    pub omega: f64,
    /// Output by input, with weights.
    pub response: Vec<(C, f64)>,
}

/// Most lines that are kept.
const LINES: usize = 96;

/// The measured response of the longest stretch, where its outputs have no gaps; empty where nothing coherent is there.
pub(crate) fn measured_response(compiled: &Compiled, data: &Data) -> Vec<Line> {
    let (m, _, p) = compiled.sizes();
    let n = data.len().min(16384);
    let period = data.drive.period_s();
    if m == 0 || n < 128 {
        return Vec::new();
    }
    let segment = (n / (2 + m)).clamp(64, 4096);
    let cut = |s: &'_ [f64]| s.get(..n).unwrap_or(s).to_vec();
    let inputs: Vec<Vec<f64>> = data.drive.inputs().iter().map(|s| cut(s)).collect();
    let outputs: Vec<Vec<f64>> = data.measured.iter().map(|s| cut(s)).collect();
    let mut between = Vec::new();
    for a in &inputs {
        for b in inputs.iter().chain(&outputs) {
            let Ok(spectrum) = hysid_signal::cross_spectrum(a, b, period, segment) else { return Vec::new() };
            between.push(spectrum);
        }
    }
    let count = between.first().map_or(0, |s| s.frequency_hz.len());
    let width = m + p;
    let at = |i: usize, j: usize, k: usize| {
        between.get(i * width + j).and_then(|s| s.uy.get(k)).map_or(C::new(0.0, 0.0), |(re, im)| C::new(*re, *im))
    };
    let power = |k: usize| (0..m).map(|i| at(i, i, k).re).sum::<f64>();
    let strongest = (1..count).map(power).fold(0.0, f64::max);
    let mut lines = Vec::new();
    for k in 2..count.saturating_sub(1) {
        if power(k) < 1e-6 * strongest {
            continue;
        }
        // Rows: S_ui_uj^T G^T = S_ui_y.
        let mut system: Vec<C> = Vec::with_capacity(m * m);
        for i in 0..m {
            for j in 0..m {
                system.push(at(i, j, k));
            }
        }
        let mut right: Vec<C> = Vec::with_capacity(m * p);
        for i in 0..m {
            for j in 0..p {
                right.push(at(i, m + j, k));
            }
        }
        let source = right.clone();
        if !eliminate(&mut system, &mut right, m, p) {
            continue;
        }
        let mut response = Vec::with_capacity(p * m);
        for j in 0..p {
            let yy = between.get(m + j).and_then(|s| s.yy.get(k)).copied().unwrap_or(0.0);
            let explained: C = (0..m).map(|i| right[i * p + j] * source[i * p + j].conj()).sum();
            let coherence = if yy > 0.0 { (explained.re / yy).clamp(0.0, 0.9999) } else { 0.0 };
            let weight = if coherence < 0.2 { 0.0 } else { (coherence / (1.0 - coherence)).min(100.0).sqrt() };
            for i in 0..m {
                let g = right[i * p + j];
                response.push((g, if g.norm() > 0.0 { weight } else { 0.0 }));
            }
        }
        if response.iter().any(|(_, w)| *w > 0.0) {
            lines.push(Line { omega: std::f64::consts::TAU * k as f64 / (segment as f64 * period), response });
        }
    }
    thin(lines)
}

/// Keeps half of the lines evenly in frequency and half evenly in its logarithm.
fn thin(lines: Vec<Line>) -> Vec<Line> {
    let n = lines.len();
    if n <= LINES {
        return lines;
    }
    let mut keep = vec![false; n];
    for i in 0..LINES / 2 {
        let share = i as f64 / (LINES / 2 - 1) as f64;
        let even = share * (n - 1) as f64;
        let log = (n as f64).powf(share) - 1.0;
        for position in [even, log] {
            if let Some(flag) = keep.get_mut((position as usize).min(n - 1)) {
                *flag = true;
            }
        }
    }
    lines.into_iter().zip(keep).filter(|(_, keep)| *keep).map(|(line, _)| line).collect()
}

/// Solves `a x = b` in place (`n` unknowns, `columns` right sides, both by rows).
fn eliminate(a: &mut [C], b: &mut [C], n: usize, columns: usize) -> bool {
    for k in 0..n {
        let best = (k..n).max_by(|&i, &j| a[i * n + k].norm_sqr().total_cmp(&a[j * n + k].norm_sqr())).unwrap_or(k);
        if a[best * n + k].norm_sqr() < 1e-300 {
            return false;
        }
        if best != k {
            for j in 0..n {
                a.swap(k * n + j, best * n + j);
            }
            for j in 0..columns {
                b.swap(k * columns + j, best * columns + j);
            }
        }
        let inverse = a[k * n + k].inv();
        for i in 0..n {
            if i == k {
                continue;
            }
            let factor = a[i * n + k] * inverse;
            for j in k..n {
                let change = factor * a[k * n + j];
                a[i * n + j] -= change;
            }
            for j in 0..columns {
                let change = factor * b[k * columns + j];
                b[i * columns + j] -= change;
            }
        }
        for j in 0..columns {
            b[k * columns + j] *= inverse;
        }
        for j in k..n {
            a[k * n + j] *= inverse;
        }
    }
    true
}

/// What a hold does to a line at `phase` radians per sample.
pub(crate) fn hold_response(hold: Hold, phase: f64) -> C {
    let half = 0.5 * phase;
    let sinc = if half > 1e-9 { half.sin() / half } else { 1.0 };
    match hold {
        Hold::Zero => C::from_polar(sinc, -half),
        Hold::Linear => C::new(sinc * sinc, 0.0),
    }
}

/// Residuals of the linearised equations against a response; `None` where they are not finite.
pub(crate) fn residuals(
    compiled: &Compiled,
    lines: &[Line],
    theta: &[f64],
    x: &[f64],
    u: &[f64],
    period: f64,
) -> Option<Vec<f64>> {
    let (m, n, p) = compiled.sizes();
    let linear = compiled.linearise(theta, x, u);
    if linear.a.iter().chain(&linear.b).chain(&linear.c).chain(&linear.d).any(|x| !x.is_finite()) {
        return None;
    }
    let mut out = Vec::with_capacity(lines.len() * m * p * 2);
    let mut system = vec![C::new(0.0, 0.0); n * n];
    let mut right = vec![C::new(0.0, 0.0); n * m];
    for line in lines {
        for i in 0..n {
            for j in 0..n {
                let diagonal = if i == j { line.omega } else { 0.0 };
                system[i * n + j] = C::new(-linear.a[i * n + j], diagonal);
            }
            for j in 0..m {
                right[i * m + j] = C::new(linear.b[i * m + j], 0.0);
            }
        }
        let solved = eliminate(&mut system, &mut right, n, m);
        let hold = hold_response(compiled.hold(), line.omega * period);
        for j in 0..p {
            for i in 0..m {
                let (measured, weight) = line.response.get(j * m + i).copied()?;
                if weight == 0.0 {
                    continue;
                }
                let mut g = C::new(linear.d[j * m + i], 0.0);
                if solved {
                    for s in 0..n {
                        g += hold * right[s * m + i] * linear.c[j * n + s];
                    }
                }
                let ratio = g / measured;
                let size = ratio.norm().max(1e-12).ln();
                out.push(weight * size.clamp(-10.0, 10.0));
                out.push(weight * ratio.arg());
            }
        }
    }
    Some(out)
}
