//! Sets the strength of the concealed effects by the difficulty that they make.
//!
//! DNR is the rms of the noise-free residual that is left after the best refit of the baseline, over the rms of the noise. It counts
//! what the baseline's own parameters absorb. It grows about as a power of the strength, so that a secant in logarithms,
//! bracketed and falling back to bisection, needs few refits.

use crate::design::{Design, Source};
use crate::input::Input;
use crate::law::Effect;
use crate::machine::Machine;
use crate::refit::{Refit, Scope, Target, refit};

/// Relative accuracy of the difficulty that is reached.
pub const ACCURACY: f64 = 0.02;
const LOWEST: f64 = 1e-5;
const HIGHEST: f64 = 30.0;

/// A machine whose effects have the strength that was asked for.
#[derive(Debug, Clone)]
pub struct Tuned {
    /// The machine.
    pub machine: Machine,
    /// Strength of each effect.
    pub strength: Vec<f64>,
    /// Difficulty reached.
    pub dnr: f64,
    /// The command as recorded, or the motion.
    pub input: Input,
    /// Outputs without noise.
    pub y: Vec<Vec<f64>>,
    /// Standard deviation of the noise on each channel.
    pub sigma: Vec<f64>,
}

/// The machine at given strengths, run and refitted. `noise` holds unit-variance noise that a controller sees.
pub fn measure(
    design: &Design,
    source: &Source,
    units: &[Effect],
    strength: &[f64],
    level: f64,
    noise: &[f64],
    rounds: usize,
) -> Option<Tuned> {
    let effects: Vec<Effect> = units.iter().zip(strength).map(|(e, s)| e.at(*s)).collect();
    let machine = design.machine(effects);
    let rms = |x: &[f64]| (x.iter().map(|v| v * v).sum::<f64>() / x.len().max(1) as f64).sqrt();
    let quiet = vec![0.0; noise.len()];
    let (mut input, mut y) = design.run(&machine, source, &quiet)?;
    let mut sigma: Vec<f64> = y.iter().map(|c| level * spread(c)).collect();
    if matches!(source, Source::Reference(_)) {
        let seen: Vec<f64> = noise.iter().map(|v| v * sigma[0]).collect();
        (input, y) = design.run(&machine, source, &seen)?;
        sigma = y.iter().map(|c| level * spread(c)).collect();
    }
    if !y.iter().flatten().all(|v| v.is_finite()) || sigma.iter().any(|s| *s <= 0.0) || rms(&y[0]) <= 0.0 {
        return None;
    }
    let dnr = residual(design, &machine.effects, &input, &y, &sigma, rounds)?.rms;
    Some(Tuned { machine, strength: strength.to_vec(), dnr, input, y, sigma })
}

/// The best refit of the baseline to outputs `y`.
pub fn residual(
    design: &Design,
    effects: &[Effect],
    input: &Input,
    y: &[Vec<f64>],
    sigma: &[f64],
    rounds: usize,
) -> Option<Refit> {
    refit(&design.baseline(effects), Target { input, y }, sigma, Scope::Plant, false, rounds)
}

/// Standard deviation about the mean.
pub fn spread(x: &[f64]) -> f64 {
    let n = x.len().max(1) as f64;
    let mean = x.iter().sum::<f64>() / n;
    (x.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt()
}

/// The machine at difficulty `dnr`. Several effects are first brought to equal difficulty one by one, then scaled together.
/// `None` where no strength in range makes the difficulty.
pub fn tune(design: &Design, source: &Source, units: &[Effect], dnr: f64, level: f64, noise: &[f64]) -> Option<Tuned> {
    if units.iter().any(|e| e.law.fixed()) {
        return measure(design, source, units, &vec![1.0; units.len()], level, noise, 15);
    }
    let mut relative = vec![1.0; units.len()];
    if units.len() > 1 {
        let each = dnr / (units.len() as f64).sqrt();
        for (i, unit) in units.iter().enumerate() {
            let alone = search(design, source, std::slice::from_ref(unit), &[1.0], each, level, noise, 0.2)?;
            relative[i] = alone.strength[0];
        }
    }
    search(design, source, units, &relative, dnr, level, noise, ACCURACY)
}

#[allow(clippy::too_many_arguments, reason = "the search is over one number; the rest says what is held")]
fn search(
    design: &Design,
    source: &Source,
    units: &[Effect],
    relative: &[f64],
    dnr: f64,
    level: f64,
    noise: &[f64],
    accuracy: f64,
) -> Option<Tuned> {
    let mut strength = if units.len() > 1 { 1.0 } else { 0.05 };
    let (mut below, mut above): (Option<(f64, f64)>, Option<(f64, f64)>) = (None, None);
    for _ in 0..18 {
        let list: Vec<f64> = relative.iter().map(|r| r * strength).collect();
        let found = measure(design, source, units, &list, level, noise, 4);
        let reached = found.as_ref().map_or(f64::INFINITY, |f| f.dnr);
        if (reached / dnr - 1.0).abs() < accuracy {
            // The quick refits of the search may stop early: what counts is the full one.
            let full = measure(design, source, units, &list, level, noise, 15)?;
            if (full.dnr / dnr - 1.0).abs() < accuracy.max(0.04) {
                return Some(full);
            }
        }
        let here = (strength.ln(), reached.ln());
        if reached < dnr {
            below = Some(here)
        } else {
            above = Some(here)
        }
        let target = dnr.ln();
        let next = match (below, above) {
            (Some(b), Some(a)) => {
                if (a.0 - b.0).abs() < 1e-4 {
                    return None;
                }
                let secant = b.0 + (a.0 - b.0) * (target - b.1) / (a.1 - b.1);
                // Well inside the bracket, or halve it.
                if secant.is_finite() && secant > b.0.min(a.0) && secant < b.0.max(a.0) {
                    secant
                } else {
                    0.5 * (a.0 + b.0)
                }
            }
            _ if reached.is_finite() => here.0 + (target - here.1).clamp(-4.0, 3.0),
            _ => here.0 - 2.0,
        };
        let clipped = next.clamp(LOWEST.ln(), HIGHEST.ln());
        if clipped == here.0 {
            return None;
        }
        strength = clipped.exp();
    }
    None
}
