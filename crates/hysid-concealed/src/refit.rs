//! Least-squares refit of a machine's parameters by damped Gauss-Newton with finite differences: the bank's own recalibration.
//!
//! Works on `ln theta` for positive parameters (a step is relative), on `theta` itself for signed ones. A parameter that moves nothing (the
//! drive's own friction where a bristle law stands in its place) stays where it is.
//! Used for the difficulty of a case (what the best baseline leaves) and for the recalibration-only competitor; [`crate::oracle`] builds on it.

use std::time::Instant;

use crate::input::Input;
use crate::machine::Machine;

/// One recording to fit: the input and a column for each output.
#[derive(Debug, Clone, Copy)]
pub struct Target<'a> {
    /// Input.
    pub input: &'a Input,
    /// Recorded outputs; only as many samples are simulated as they have.
    pub y: &'a [Vec<f64>],
}

/// What may be moved: plant parameters, effect parameters, and initial plant states.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Knob {
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
}

/// What a refit moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scope {
    /// Plant parameters.
    Plant,
    /// Plant parameters and the effects' magnitudes; what lays out a path or a grid stays.
    Effects,
    /// Whatever the recording tells of the plant and the effects: times of a change, widths and weights of plays, too.
    Whole,
}

/// Relative step of the finite differences: small enough for a derivative, large against the integrator's tolerance.
const STEP: f64 = 1e-4;

/// Refits `start` to `target`; channel `c` is divided by `scale[c]`. `None` when the machine cannot be run at the start.
pub fn refit(
    start: &Machine,
    target: Target,
    scale: &[f64],
    scope: Scope,
    free_initial: bool,
    rounds: usize,
) -> Option<Refit> {
    let knobs = knobs(start, scope, free_initial, target);
    let first = Fit::of(start.clone(), target, scale)?;
    Some(gauss_newton(first, &knobs, target, scale, STEP, rounds, None).refit())
}

/// A machine, its weighted residual and the sum of squares.
#[derive(Debug, Clone)]
pub(crate) struct Fit {
    pub(crate) machine: Machine,
    pub(crate) residual: Vec<Vec<f64>>,
    pub(crate) cost: f64,
}

impl Fit {
    /// The machine run on the target; `None` where it cannot be run.
    pub(crate) fn of(machine: Machine, target: Target, scale: &[f64]) -> Option<Self> {
        let residual = residuals(&machine, target, scale)?;
        let cost = residual.iter().flatten().map(|v| v * v).sum();
        Some(Self { machine, residual, cost })
    }

    /// Rms of the weighted residual.
    pub(crate) fn rms(&self) -> f64 {
        let samples: usize = self.residual.iter().map(Vec::len).sum();
        (self.cost / samples.max(1) as f64).sqrt()
    }

    /// What is handed out.
    pub(crate) fn refit(self) -> Refit {
        Refit { rms: self.rms(), machine: self.machine, residual: self.residual }
    }
}

/// Whether it is later than the deadline; never without one.
pub(crate) fn late(deadline: Option<Instant>) -> bool {
    deadline.is_some_and(|d| Instant::now() > d)
}

/// Damped Gauss-Newton from a fit, derivatives by forward differences with this relative step. Past the deadline the fit stays where it is.
pub(crate) fn gauss_newton(
    mut fit: Fit,
    knobs: &[Knob],
    target: Target,
    scale: &[f64],
    difference: f64,
    rounds: usize,
    deadline: Option<Instant>,
) -> Fit {
    let mut lambda = 1e-6;
    for _ in 0..rounds {
        let Some(jacobian) = jacobian(&fit, knobs, target, scale, difference, deadline) else { break };
        let (normal, gradient) = normal_equations(&jacobian, &fit.residual);
        let mut fall = 0.0;
        for _ in 0..8 {
            if late(deadline) {
                return fit;
            }
            let Some(step) = solve(&normal, &gradient, knobs.len(), lambda) else {
                lambda = (lambda * 10.0).max(1e-9);
                continue;
            };
            if let Some(trial) = Fit::of(moved(&fit.machine, knobs, &step, 0.7), target, scale)
                && trial.cost < fit.cost
            {
                fall = 1.0 - trial.cost / fit.cost;
                fit = trial;
                lambda = (lambda * 0.1).max(1e-12);
                break;
            }
            lambda = (lambda * 20.0).max(1e-9);
        }
        if fall < 1e-4 {
            break;
        }
    }
    fit
}

/// The machine with every knob turned by its step, `largest` at most.
pub(crate) fn moved(machine: &Machine, knobs: &[Knob], step: &[f64], largest: f64) -> Machine {
    let mut machine = machine.clone();
    for (knob, s) in knobs.iter().zip(step) {
        turn(&mut machine, *knob, s.clamp(-largest, largest));
    }
    machine
}

/// The knobs of the machine.
pub(crate) fn knobs(machine: &Machine, scope: Scope, free_initial: bool, target: Target) -> Vec<Knob> {
    let mut list: Vec<Knob> = (0..machine.theta.len()).map(Knob::Theta).collect();
    if scope != Scope::Plant {
        for (i, e) in machine.effects.iter().enumerate() {
            for (j, value) in e.p.iter().enumerate() {
                let name = e.law.parameters()[j];
                if *value != 0.0 && told_by_a_recording(name) && (scope == Scope::Whole || !lays_out(name)) {
                    list.push(Knob::Effect(i, j));
                }
            }
        }
    }
    if free_initial {
        list.extend(start(machine, target));
    }
    list
}

/// The knobs of the initial plant states.
fn start(machine: &Machine, target: Target) -> impl Iterator<Item = Knob> {
    let size = target.y.iter().flatten().fold(0.0_f64, |a, v| a.max(v.abs()));
    let rate = size / (target.input.period() * 10.0);
    let masses = machine.kind.masses();
    (0..machine.initial.len()).map(move |i| Knob::Initial(i, if i < masses.max(1) { size } else { rate }))
}

/// Rounds for an initial state alone.
const ROUNDS_OF_A_START: usize = 8;

/// The machine started from the state that fits the beginning of a recording best, its parameters as they are: what a user does who does not
/// know the initial state. `target.y` holds the samples that may settle it, `target.input` the whole input. The search begins at the machine's
/// own initial state and at rest: where friction sticks the two may end apart. Where the machine cannot be run, or its motion is prescribed, it
/// comes back unchanged.
pub fn started(machine: &Machine, target: Target, scale: &[f64]) -> Machine {
    let knobs: Vec<Knob> = start(machine, target).collect();
    if knobs.is_empty() {
        return machine.clone();
    }
    let at_rest = Machine { initial: vec![0.0; machine.initial.len()], ..machine.clone() };
    [machine.clone(), at_rest]
        .into_iter()
        .filter_map(|from| Fit::of(from, target, scale))
        .map(|fit| gauss_newton(fit, &knobs, target, scale, STEP, ROUNDS_OF_A_START, None))
        .min_by(|a, b| a.cost.total_cmp(&b.cost))
        .map_or_else(|| machine.clone(), |fit| fit.machine)
}

/// Parameters that lay out a path or a grid rather than give a magnitude.
fn lays_out(name: &str) -> bool {
    let of_a_play = |rest: &str| matches!(rest, "_1" | "_2" | "_3" | "_4" | "_5");
    matches!(name, "u_max" | "t_0") || name.strip_prefix(['r', 'w']).is_some_and(of_a_play)
}

/// Whether a recording tells a parameter at all: not the seed of a random walk, nor what only scales another parameter (a length of time, a
/// power), nor the bit of a converter, between whose steps nothing changes.
fn told_by_a_recording(name: &str) -> bool {
    !matches!(name, "T" | "seed" | "P_0" | "lsb")
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
    let samples = target.y.first().map_or(0, Vec::len);
    let y = machine.run_for(target.input, samples, None).ok()?;
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

/// Derivatives of the simulated output by forward differences; `None` where the machine cannot be run or the deadline passes.
pub(crate) fn jacobian(
    fit: &Fit,
    knobs: &[Knob],
    target: Target,
    scale: &[f64],
    difference: f64,
    deadline: Option<Instant>,
) -> Option<Vec<Vec<f64>>> {
    knobs
        .iter()
        .map(|&knob| {
            if late(deadline) {
                return None;
            }
            let mut moved = fit.machine.clone();
            turn(&mut moved, knob, difference);
            let r = residuals(&moved, target, scale)?;
            Some(r.iter().flatten().zip(fit.residual.iter().flatten()).map(|(a, b)| (b - a) / difference).collect())
        })
        .collect()
}

pub(crate) fn normal_equations(jacobian: &[Vec<f64>], residual: &[Vec<f64>]) -> (Vec<f64>, Vec<f64>) {
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

/// Solves `(A + lambda diag A) x = b` by Cholesky after equilibration; `None` when it is not positive definite. An unknown whose diagonal
/// is zero has no bearing on the rest and comes out as zero.
pub fn solve(a: &[f64], b: &[f64], n: usize, lambda: f64) -> Option<Vec<f64>> {
    let factor = Factor::of(a, n, lambda)?;
    let x = factor.back(factor.forth(b));
    x.iter().all(|v| v.is_finite()).then_some(x)
}

/// `D^-1 (A + lambda diag A) D^-1 = L L^T` with `D = sqrt(diag A)`.
pub(crate) struct Factor {
    n: usize,
    d: Vec<f64>,
    l: Vec<f64>,
}

impl Factor {
    pub(crate) fn of(a: &[f64], n: usize, lambda: f64) -> Option<Self> {
        let inert = |i: usize| a[i * n + i] <= 0.0;
        let d: Vec<f64> = (0..n).map(|i| if inert(i) { 1.0 } else { a[i * n + i].sqrt() }).collect();
        let mut l = vec![0.0; n * n];
        for i in 0..n {
            for j in 0..=i {
                let mut sum = a[i * n + j] / (d[i] * d[j]);
                if i == j {
                    sum += if inert(i) { 1.0 } else { lambda + 1e-13 };
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
        Some(Self { n, d, l })
    }

    /// `L^-1 D^-1 b`.
    fn forth(&self, b: &[f64]) -> Vec<f64> {
        let (n, l) = (self.n, &self.l);
        let mut x: Vec<f64> = (0..n).map(|i| b[i] / self.d[i]).collect();
        for i in 0..n {
            for k in 0..i {
                x[i] -= l[i * n + k] * x[k];
            }
            x[i] /= l[i * n + i];
        }
        x
    }

    /// `D^-1 L^-T x`: for a unit vector, a direction in which one step changes the sum of squares by one.
    pub(crate) fn back(&self, mut x: Vec<f64>) -> Vec<f64> {
        let (n, l) = (self.n, &self.l);
        for i in (0..n).rev() {
            for k in i + 1..n {
                x[i] -= l[k * n + i] * x[k];
            }
            x[i] /= l[i * n + i];
        }
        (0..n).map(|i| x[i] / self.d[i]).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::Kind;
    use crate::input::Hold;
    use crate::law::{Effect, Law};

    #[test]
    fn a_start_is_found_from_the_beginning_of_a_recording_and_the_rest_is_not_looked_at() {
        let truth = |effects, initial| Machine {
            kind: Kind::Drive,
            theta: vec![0.2, 0.3, 0.1],
            effects,
            initial,
            channels: 1,
            regularised: None,
        };
        let values = (0..200).map(|k| (f64::from(k) * 0.3).sin()).collect();
        let input = Input::Held { values, period: 0.05, hold: Hold::Zero };
        for effects in [Vec::new(), vec![Effect::new(Law::RateDependent, vec![0.3, 1.0, 0.5])]] {
            let moving = truth(effects.clone(), vec![0.2, 0.4]);
            let y = moving.run(&input, None).unwrap();
            let beginning = vec![y[0][..20].to_vec()];
            assert_eq!(moving.run_for(&input, 20, None).unwrap(), beginning);
            let still = truth(effects, vec![0.0, 0.0]);
            let found = started(&still, Target { input: &input, y: &beginning }, &[0.01]);
            assert_eq!(found.theta, still.theta);
            let off = |i: usize| (found.initial[i] - moving.initial[i]).abs();
            assert!(off(0) < 1e-3 && off(1) < 1e-2, "{:?}", found.initial);
        }
    }

    #[test]
    fn an_unknown_without_bearing_stays_and_the_others_are_solved_as_if_it_were_absent() {
        let with = solve(&[4.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 3.0], &[1.0, 0.0, 2.0], 3, 0.0).unwrap();
        let without = solve(&[4.0, 1.0, 1.0, 3.0], &[1.0, 2.0], 2, 0.0).unwrap();
        assert_eq!(with[1], 0.0);
        assert!((with[0] - without[0]).abs() < 1e-12 && (with[2] - without[1]).abs() < 1e-12);
        // (1/11, 7/11) solves 4 x + y = 1, x + 3 y = 2.
        assert!((without[0] - 1.0 / 11.0).abs() < 1e-12 && (without[1] - 7.0 / 11.0).abs() < 1e-12);
    }
}
