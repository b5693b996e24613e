//! The oracle: what a good estimator makes of a recording when it is told the true structure, and nothing else.
//!
//! It is an estimate, not the truth: the least-squares fit to the noisy recording, so that its error is that of estimation. A search that
//! starts at the truth and cannot move has an error of zero, which nobody without the truth could reach: where friction sticks, gaps close
//! and relays switch, the sum of squares has kinks and small jumps, and finite differences with a small step see the jumps. Hence starts off
//! the truth, coarse differences before fine ones, and, where two searches disagree, a polish without derivatives in steps of one standard error. The least
//! sum of squares wins, and it is never above that of the truth.
//!
//! Estimated is whatever the recording tells ([`Scope::Whole`]): the time of a change, the widths and weights of plays, and, where the simulation
//! file leaves it free, the initial state. Told beforehand are the path of a random walk and the bit of a converter.

use std::time::{Duration, Instant};

use crate::machine::Machine;
use crate::refit::{
    Factor, Fit, Knob, Refit, Scope, Target, gauss_newton, jacobian, knobs, late, moved, normal_equations,
};
use crate::seed::{Random, Stream};

/// Starts beside the truth, and their distance from it (standard deviation, relative).
const STARTS: usize = 2;
const AWAY: f64 = 0.05;
/// Relative steps of the differences, coarse to fine, and Gauss-Newton rounds with each.
const STEPS: [(f64, usize); 3] = [(1e-2, 3), (1e-3, 4), (1e-4, 4)];
/// Two searches have found the same minimum where their sums of squares differ by less than this, in units of the noise: a hundredth of what
/// one standard error of one parameter costs.
const AGREED: f64 = 0.01;
/// Steps of the polish in standard errors.
const POLISH: [f64; 3] = [1.0, 0.5, 0.25];

/// The estimate, and whether the search for it came to its end.
#[derive(Debug, Clone)]
pub struct Estimate {
    /// The best fit that was found.
    pub refit: Refit,
    /// The patience sufficed. Where it did not, the fit is the best so far; it starts at the truth, so that its error may be too small, never
    /// that of a search gone astray.
    pub complete: bool,
}

/// Estimates the parameters of plant and effects of `truth` from a recording, its initial state too where that is free; channel `c` is divided
/// by `scale[c]`. `None` where the true machine cannot be run.
///
/// A stiff law over a long recording costs seconds a simulation, and the search hundreds of them: past `patience` it ends with what it has.
pub fn oracle(
    truth: &Machine,
    target: Target,
    scale: &[f64],
    free_initial: bool,
    patience: Duration,
) -> Option<Estimate> {
    let deadline = Instant::now().checked_add(patience);
    let knobs = knobs(truth, Scope::Whole, free_initial, target);
    let from = |start: Machine, steps: &[(f64, usize)]| {
        let start = Fit::of(start, target, scale)?;
        Some(
            steps
                .iter()
                .fold(start, |fit, &(step, rounds)| gauss_newton(fit, &knobs, target, scale, step, rounds, deadline)),
        )
    };
    let mut best = from(truth.clone(), &[(1e-4, 12)])?;
    // The same starts for every case: no stream of the bank is touched.
    let mut random = Random::for_case(Stream::Development, u64::MAX, knobs.len() as u64);
    for _ in 0..STARTS {
        let off: Vec<f64> = knobs.iter().map(|_| AWAY * random.normal()).collect();
        let Some(found) = from(moved(truth, &knobs, &off, 0.2), &STEPS) else { continue };
        let agreed = (found.cost - best.cost).abs() < AGREED * best.rms().powi(2);
        if found.cost < best.cost {
            best = found;
        }
        if agreed {
            return Some(Estimate { refit: best.refit(), complete: !late(deadline) });
        }
    }
    let refit = polish(best, &knobs, target, scale, deadline).refit();
    Some(Estimate { refit, complete: !late(deadline) })
}

/// Line searches along the principal directions of the estimate, without derivatives: three points, the parabola through them, the best of all.
fn polish(mut fit: Fit, knobs: &[Knob], target: Target, scale: &[f64], deadline: Option<Instant>) -> Fit {
    let n = knobs.len();
    let Some(factor) = jacobian(&fit, knobs, target, scale, 1e-3, deadline)
        .and_then(|j| Factor::of(&normal_equations(&j, &fit.residual).0, n, 1e-9))
    else {
        return fit;
    };
    let unit = |i: usize| (0..n).map(|j| if i == j { 1.0 } else { 0.0 }).collect();
    let directions: Vec<Vec<f64>> = (0..n).map(|i| factor.back(unit(i))).collect();
    for radius in POLISH {
        for direction in &directions {
            if late(deadline) {
                return fit;
            }
            let size = radius * fit.rms();
            let at = |t: f64| {
                let step: Vec<f64> = direction.iter().map(|d| t * size * d).collect();
                Fit::of(moved(&fit.machine, knobs, &step, 0.2), target, scale)
            };
            let (Some(back), Some(forth)) = (at(-1.0), at(1.0)) else { continue };
            let bend = back.cost - 2.0 * fit.cost + forth.cost;
            let vertex = (bend > 0.0).then(|| (0.5 * (back.cost - forth.cost) / bend).clamp(-3.0, 3.0)).and_then(at);
            for trial in [Some(back), Some(forth), vertex].into_iter().flatten() {
                if trial.cost < fit.cost {
                    fit = trial;
                }
            }
        }
    }
    fit
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::Kind;
    use crate::input::{Hold, Input};
    use crate::law::{Effect, Law};
    use crate::refit::refit;

    const PATIENCE: Duration = Duration::from_secs(3600);

    /// A noisy recording of a machine under steps of changing height: input, outputs, standard deviation of the noise.
    fn recorded(machine: &Machine, samples: usize, period: f64, level: f64) -> (Input, Vec<Vec<f64>>, Vec<f64>) {
        let mut random = Random::for_case(Stream::Development, 5, samples as u64);
        let mut values = Vec::with_capacity(samples);
        while values.len() < samples {
            let height = level * random.uniform(-1.5, 1.5);
            values.extend(std::iter::repeat_n(height, (3 + random.below(12)).min(samples - values.len())));
        }
        let input = Input::Held { values, period, hold: Hold::Zero };
        let mut y = machine.run(&input, None).unwrap();
        let sigma = 0.01 * crate::strength::spread(&y[0]);
        y[0].iter_mut().for_each(|v| *v += sigma * random.normal());
        (input, y, vec![sigma])
    }

    fn machine(kind: Kind, theta: &[f64], effects: Vec<Effect>) -> Machine {
        let theta = theta.to_vec();
        Machine { kind, theta, effects, initial: vec![0.0; 2], channels: 1, regularised: None }
    }

    /// A spring that loses a third of its stiffness.
    fn change() -> Effect {
        Effect { theta: 2, ..Effect::new(Law::AbruptChange, vec![-0.33, 4.0]) }
    }

    /// Machines that move smoothly, that stick, that strike, one whose own friction a bristle law replaces, one that changes, one behind plays.
    fn machines() -> Vec<(&'static str, bool, Machine, f64, f64)> {
        let oscillator = [2.0, 1.5, 80.0];
        let drive = [0.2, 0.3, 0.5];
        vec![
            (
                "cubic",
                true,
                machine(Kind::Oscillator, &oscillator, vec![Effect::new(Law::Cubic, vec![300.0])]),
                0.03,
                10.0,
            ),
            (
                "dry",
                false,
                machine(Kind::Oscillator, &oscillator, vec![Effect::new(Law::Coulomb, vec![3.0])]),
                0.03,
                10.0,
            ),
            (
                "stop",
                false,
                machine(Kind::Oscillator, &oscillator, vec![Effect::new(Law::GapStop, vec![200.0, 0.08])]),
                0.03,
                10.0,
            ),
            ("stuck", false, machine(Kind::Drive, &drive, vec![Effect::new(Law::InputOffset, vec![0.1])]), 0.05, 1.0),
            ("bristles", false, machine(Kind::Drive, &drive, vec![Effect::new(Law::Dahl, vec![0.5, 0.05])]), 0.05, 1.0),
            ("change", false, machine(Kind::Oscillator, &oscillator, vec![change()]), 0.03, 10.0),
            (
                "plays",
                false,
                machine(
                    Kind::Oscillator,
                    &oscillator,
                    vec![Effect::new(
                        Law::PrandtlIshlinskii,
                        vec![0.5, 2.0, 4.0, 6.0, 8.0, 10.0, 0.3, 0.2, 0.2, 0.2, 0.1],
                    )],
                ),
                0.03,
                10.0,
            ),
        ]
    }

    #[test]
    fn never_worse_on_its_recording_than_the_truth_and_never_the_truth_itself() {
        for (name, _, truth, period, level) in machines() {
            let (input, y, sigma) = recorded(&truth, 300, period, level);
            let target = Target { input: &input, y: &y };
            let exact = Fit::of(truth.clone(), target, &sigma).unwrap();
            let found = oracle(&truth, target, &sigma, false, PATIENCE).unwrap().refit;
            assert!(found.rms <= exact.rms(), "{name}: {} against {} at the truth", found.rms, exact.rms());
            // A least-squares estimate of p parameters takes about p variances off the sum of squares; one that found nothing takes none.
            let taken = 300.0 * (exact.rms().powi(2) - found.rms.powi(2));
            assert!((0.3..30.0).contains(&taken), "{name}: {taken} variances taken off");
        }
    }

    #[test]
    fn on_a_smooth_machine_a_refit_from_the_truth_is_the_same_estimate() {
        for (name, smooth, truth, period, level) in machines() {
            let (input, y, sigma) = recorded(&truth, 300, period, level);
            let target = Target { input: &input, y: &y };
            let near = refit(&truth, target, &sigma, Scope::Whole, false, 20).unwrap();
            let found = oracle(&truth, target, &sigma, false, PATIENCE).unwrap().refit;
            assert!(found.rms <= near.rms * (1.0 + 1e-9), "{name}");
            for (a, b) in found.machine.theta.iter().zip(&near.machine.theta).filter(|_| smooth) {
                assert!((a / b - 1.0).abs() < 1e-3, "{name}: {a} against {b}");
            }
        }
    }
    #[test]
    fn the_time_of_a_change_is_estimated_and_so_is_a_start_that_is_free() {
        let mut truth = machine(Kind::Oscillator, &[2.0, 1.5, 80.0], vec![change()]);
        truth.initial = vec![0.05, -0.3];
        let (input, y, sigma) = recorded(&truth, 400, 0.03, 10.0);
        let target = Target { input: &input, y: &y };
        let at_rest = oracle(&truth, target, &sigma, false, PATIENCE).unwrap().refit.machine;
        assert_eq!(at_rest.initial, truth.initial, "a start that is known stays");
        let found = oracle(&truth, target, &sigma, true, PATIENCE).unwrap().refit.machine;
        let time = found.effects[0].p[1];
        assert!(time != 4.0 && (time - 4.0).abs() < 0.03, "{time}");
        assert!(found.initial != truth.initial);
        assert!((found.initial[0] - 0.05).abs() < 0.02 && (found.initial[1] + 0.3).abs() < 0.1, "{:?}", found.initial);
    }

    #[test]
    fn without_patience_it_stays_at_the_truth_and_says_so() {
        let (_, _, truth, period, level) = machines().remove(0);
        let (input, y, sigma) = recorded(&truth, 300, period, level);
        let target = Target { input: &input, y: &y };
        let cut = oracle(&truth, target, &sigma, false, Duration::ZERO).unwrap();
        assert!(!cut.complete);
        assert_eq!(cut.refit.machine.theta, truth.theta);
        assert!(oracle(&truth, target, &sigma, false, PATIENCE).unwrap().complete);
    }
}
