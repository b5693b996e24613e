//! Least-squares refit of a machine's parameters by damped Gauss-Newton with finite differences: the bank's own recalibration.
//!
//! Works on `ln theta` for positive parameters (a step is relative), on `theta` itself for signed ones.
//! Used for the difficulty of a case (what the best baseline leaves), for the recalibration-only competitor and for the oracle.

use crate::input::Input;
use crate::machine::Machine;

/// One recording to fit: the input and a column for each output.
#[derive(Debug, Clone, Copy)]
pub struct Target<'a> {
    /// Input.
    pub input: &'a Input,
    /// Recorded outputs.
    pub y: &'a [Vec<f64>],
}

/// What may be moved: plant parameters, effect parameters, and initial plant states.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Knob {
    Theta(usize),
    Effect(usize, usize),
    Initial(usize, f64),
}

/// A refit and what it leaves.
#[derive(Debug, Clone)]
pub struct Refit {
    /// The machine with the refitted parameters.
    pub machine: Machine,
    /// Rms of the weighted residual over all channels.
    pub rms: f64,
    /// Residual of each channel.
    pub residual: Vec<Vec<f64>>,
    /// Names and standard errors of the effects' parameters (in their own unit), for unit residual variance scaled by `rms`.
    pub errors: Vec<(usize, usize, f64)>,
}

/// What a refit moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scope {
    /// Plant parameters.
    Plant,
    /// Plant parameters and the effects' parameters.
    Effects,
}

/// Refits `start` to `target`; channel `c` is divided by `scale[c]`. `None` when the machine cannot be run at the start.
pub fn refit(
    start: &Machine,
    target: Target,
    scale: &[f64],
    scope: Scope,
    free_initial: bool,
    rounds: usize,
) -> Option<Refit> {
    let mut machine = start.clone();
    let knobs = knobs(&machine, scope, free_initial, target);
    let mut residual = residuals(&machine, target, scale)?;
    let mut cost = square(&residual);
    let mut lambda = 1e-6;
    let mut last_normal = Vec::new();
    let n = knobs.len();
    for _ in 0..rounds {
        let Some(jacobian) = jacobian(&machine, &knobs, target, scale, &residual) else { break };
        let (normal, gradient) = normal_equations(&jacobian, &residual);
        let mut improved = false;
        let mut fall = 0.0;
        for _ in 0..8 {
            let Some(step) = solve(&normal, &gradient, n, lambda) else {
                lambda = (lambda * 10.0).max(1e-9);
                continue;
            };
            let mut trial = machine.clone();
            for (knob, s) in knobs.iter().zip(&step) {
                turn(&mut trial, *knob, s.clamp(-0.7, 0.7));
            }
            if let Some(r) = residuals(&trial, target, scale) {
                let c = square(&r);
                if c < cost {
                    fall = 1.0 - c / cost;
                    (machine, residual, cost) = (trial, r, c);
                    lambda = (lambda * 0.1).max(1e-12);
                    improved = true;
                    break;
                }
            }
            lambda = (lambda * 20.0).max(1e-9);
        }
        last_normal = normal;
        if !improved || fall < 1e-4 {
            break;
        }
    }
    let samples: usize = residual.iter().map(Vec::len).sum();
    let rms = (cost / samples.max(1) as f64).sqrt();
    let errors = standard_errors(&machine, &knobs, &last_normal, rms);
    Some(Refit { machine, rms, residual, errors })
}

/// The knobs of the machine.
fn knobs(machine: &Machine, scope: Scope, free_initial: bool, target: Target) -> Vec<Knob> {
    let mut list: Vec<Knob> = (0..machine.theta.len()).map(Knob::Theta).collect();
    if scope == Scope::Effects {
        for (i, e) in machine.effects.iter().enumerate() {
            for (j, value) in e.p.iter().enumerate() {
                if *value != 0.0 && fitted(e.law.parameters()[j]) {
                    list.push(Knob::Effect(i, j));
                }
            }
        }
    }
    if free_initial {
        let size = target.y.iter().flatten().fold(0.0_f64, |a, v| a.max(v.abs()));
        let rate = size / (target.input.period() * 10.0);
        let masses = machine.kind.masses();
        for i in 0..machine.initial.len() {
            list.push(Knob::Initial(i, if i < masses.max(1) { size } else { rate }));
        }
    }
    list
}

/// Parameters that define a path or a grid rather than a magnitude stay as they are.
fn fitted(name: &str) -> bool {
    !matches!(
        name,
        "T" | "seed"
            | "u_max"
            | "w_1"
            | "w_2"
            | "w_3"
            | "w_4"
            | "w_5"
            | "r_1"
            | "r_2"
            | "r_3"
            | "r_4"
            | "r_5"
            | "P_0"
            | "t_0"
            | "lsb"
    )
}

fn turn(machine: &mut Machine, knob: Knob, step: f64) {
    match knob {
        Knob::Theta(i) => {
            if machine.kind.signed(machine.kind.parameters()[i]) {
                // A signed parameter moves in units of its own size or of one.
                machine.theta[i] += step * machine.theta[i].abs().max(0.1 * size_of_signed(machine, i));
            } else {
                machine.theta[i] *= step.exp();
            }
        }
        Knob::Effect(i, j) => {
            let value = machine.effects[i].p[j];
            machine.effects[i].p[j] = value * step.exp();
        }
        Knob::Initial(i, size) => machine.initial[i] += step * size,
    }
}

/// A size for a signed parameter that may stand at zero.
fn size_of_signed(machine: &Machine, i: usize) -> f64 {
    machine
        .theta
        .iter()
        .enumerate()
        .filter(|(j, _)| *j != i)
        .fold(0.0_f64, |a, (_, v)| a.max(v.abs()))
        .clamp(1e-3, 10.0)
}

fn residuals(machine: &Machine, target: Target, scale: &[f64]) -> Option<Vec<Vec<f64>>> {
    let y = machine.run(target.input, None).ok()?;
    let mut out = Vec::with_capacity(y.len());
    for ((simulated, recorded), s) in y.iter().zip(target.y).zip(scale) {
        let column: Vec<f64> = recorded.iter().zip(simulated).map(|(a, b)| (a - b) / s).collect();
        if !column.iter().all(|v| v.is_finite()) {
            return None;
        }
        out.push(column);
    }
    Some(out)
}

fn square(residual: &[Vec<f64>]) -> f64 {
    residual.iter().flatten().map(|v| v * v).sum()
}

/// Derivatives of the simulated output by forward differences.
fn jacobian(
    machine: &Machine,
    knobs: &[Knob],
    target: Target,
    scale: &[f64],
    residual: &[Vec<f64>],
) -> Option<Vec<Vec<f64>>> {
    knobs
        .iter()
        .map(|&knob| {
            let step = 1e-4;
            let mut moved = machine.clone();
            turn(&mut moved, knob, step);
            let r = residuals(&moved, target, scale)?;
            Some(r.iter().flatten().zip(residual.iter().flatten()).map(|(a, b)| (b - a) / step).collect())
        })
        .collect()
}

fn normal_equations(jacobian: &[Vec<f64>], residual: &[Vec<f64>]) -> (Vec<f64>, Vec<f64>) {
    let n = jacobian.len();
    let flat: Vec<f64> = residual.iter().flatten().copied().collect();
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    let mut normal = vec![0.0; n * n];
    for i in 0..n {
        for j in 0..=i {
            normal[i * n + j] = dot(&jacobian[i], &jacobian[j]);
            normal[j * n + i] = normal[i * n + j];
        }
    }
    (normal, jacobian.iter().map(|g| dot(g, &flat)).collect())
}

/// Solves `(A + lambda diag A) x = b` by Cholesky after equilibration; `None` when it is not positive definite.
pub fn solve(a: &[f64], b: &[f64], n: usize, lambda: f64) -> Option<Vec<f64>> {
    let d: Vec<f64> = (0..n).map(|i| a[i * n + i].sqrt().max(1e-300)).collect();
    let mut l = vec![0.0; n * n];
    for i in 0..n {
        for j in 0..=i {
            let mut sum = a[i * n + j] / (d[i] * d[j]);
            if i == j {
                sum += lambda + 1e-13;
            }
            for k in 0..j {
                sum -= l[i * n + k] * l[j * n + k];
            }
            if i == j {
                // The negated comparison also refuses NaN.
                if !(sum > 1e-14 && sum.is_finite()) {
                    return None;
                }
                l[i * n + i] = sum.sqrt();
            } else {
                l[i * n + j] = sum / l[j * n + j];
            }
        }
    }
    let mut x: Vec<f64> = (0..n).map(|i| b[i] / d[i]).collect();
    for i in 0..n {
        for k in 0..i {
            x[i] -= l[i * n + k] * x[k];
        }
        x[i] /= l[i * n + i];
    }
    for i in (0..n).rev() {
        for k in i + 1..n {
            x[i] -= l[k * n + i] * x[k];
        }
        x[i] /= l[i * n + i];
    }
    let x: Vec<f64> = (0..n).map(|i| x[i] / d[i]).collect();
    x.iter().all(|v| v.is_finite()).then_some(x)
}

fn standard_errors(machine: &Machine, knobs: &[Knob], normal: &[f64], rms: f64) -> Vec<(usize, usize, f64)> {
    let n = knobs.len();
    if normal.len() != n * n {
        return Vec::new();
    }
    let mut out = Vec::new();
    for (i, knob) in knobs.iter().enumerate() {
        if let Knob::Effect(effect, parameter) = *knob {
            let mut unit = vec![0.0; n];
            unit[i] = 1.0;
            if let Some(column) = solve(normal, &unit, n, 0.0) {
                let relative = rms * column[i].max(0.0).sqrt();
                out.push((effect, parameter, relative * machine.effects[effect].p[parameter].abs()));
            }
        }
    }
    out
}
