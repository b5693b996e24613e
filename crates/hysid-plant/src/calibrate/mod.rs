//! Calibration: the parameters and initial states that make a simulation reproduce recordings, found globally in their bounds.
//!
//! A bad parameter must never pass for missing physics, so one local search is not enough: starts are the user's values, the
//! linear core fitted to the measured frequency response, and a seeded design; from each, a homotopy leads from prediction
//! (an observer holds the simulation near the measurement, which makes the landscape nearly convex) to the free run. The best
//! is polished on all data. Coloured noise is weighted by an autoregression, in rounds of generalised least squares.
//!
//! A stretch that diverges has infinite cost. Nothing here draws a conclusion from what remains: it returns the residuals.

mod data;
mod frequency;
mod initial;
mod least_squares;
mod noise;
mod objective;
mod observer;
mod starts;

use nalgebra::DMatrix;

use crate::engine::{Compiled, Start};
use least_squares::{Limits, Minimum, minimise};
use objective::Objective;
use observer::rms_about_mean;

pub use data::Data;
pub use initial::INITIAL_SHARE;
pub use noise::NoiseModel;

/// How far a calibration searches.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Effort {
    /// From several starts, with the homotopy.
    Global,
    /// From the given start only, in free run.
    Local,
}

/// Settings of a calibration; the default suits most records.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// How far to search.
    pub effort: Effort,
    /// Where the seeded design starts.
    pub seed: u64,
    /// Steps in each sampling period; none lets the step-halving check decide.
    pub substeps: Option<usize>,
    /// Relative change by which the step-halving check judges.
    pub step_tolerance: f64,
    /// Parameters to estimate by number; none means all that are not fixed.
    pub estimated: Option<Vec<usize>>,
    /// Parameters to start from; none means the document's.
    pub theta: Option<Vec<f64>>,
    /// Free initial states to start from, for each stretch; none lets the measurement decide.
    pub initial: Option<Vec<Vec<f64>>>,
    /// Highest order of the noise model; 0 is white noise.
    pub noise_order: usize,
    /// Rounds of generalised least squares; 0 leaves the plain sum of squares.
    pub gls_rounds: usize,
    /// Most evaluations in each local search.
    pub iterations: usize,
    /// Least relative decrease of the cost that counts.
    pub tolerance: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            effort: Effort::Global,
            seed: 1,
            substeps: None,
            step_tolerance: 1e-4,
            estimated: None,
            theta: None,
            initial: None,
            noise_order: 16,
            gls_rounds: 2,
            iterations: 60,
            tolerance: 1e-7,
        }
    }
}

impl Settings {
    /// A local search from these parameters.
    pub fn local(theta: Vec<f64>) -> Self {
        Self { effort: Effort::Local, theta: Some(theta), ..Self::default() }
    }
}

/// What is suspicious about an estimate: it may have absorbed physics that the simulation lacks.
#[derive(Debug, Clone, PartialEq)]
pub enum Flag {
    /// A parameter ended at its lower or upper bound.
    AtBound {
        /// Its number.
        parameter: usize,
        /// The bound.
        bound: f64,
    },
    /// A parameter moved by more than half of the user's value and more than 3 standard deviations.
    FarFromUser {
        /// Its number.
        parameter: usize,
        /// The user's value.
        user: f64,
    },
    /// The data say almost nothing about a parameter: its standard deviation exceeds its value and the user's.
    Undetermined {
        /// Its number.
        parameter: usize,
    },
}

/// A calibrated simulation.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// All parameters, in the document's order.
    pub theta: Vec<f64>,
    /// Numbers of the estimated parameters.
    pub estimated: Vec<usize>,
    /// Free initial states of each stretch, in the order of [`Data::free`].
    pub initial: Vec<Vec<f64>>,
    /// Covariance of the estimated parameters, by columns.
    pub covariance: Vec<f64>,
    /// Simulated outputs, `[stretch][output][sample]`.
    pub simulated: Vec<Vec<Vec<f64>>>,
    /// Measured minus simulated, `[stretch][output][sample]`; `NaN` where nothing was measured.
    pub residuals: Vec<Vec<Vec<f64>>>,
    /// Noise model of each output's residual.
    pub noise: Vec<NoiseModel>,
    /// Free-run rms error of each output, over all stretches.
    pub rmse: Vec<f64>,
    /// What is suspicious.
    pub flags: Vec<Flag>,
    /// Steps in each sampling period, and the change on twice as many.
    pub steps: crate::engine::StepCheck,
    /// Simulations run (up to 8 derivatives come with each).
    pub simulations: usize,
    /// Whether the last search ended at a minimum (and not at its limit of evaluations).
    pub converged: bool,
}

impl Calibration {
    /// Standard deviation of each estimated parameter, in the order of `estimated`.
    pub fn standard_deviations(&self) -> Vec<f64> {
        let n = self.estimated.len();
        (0..n).map(|i| self.covariance.get(i * n + i).copied().unwrap_or(f64::NAN).max(0.0).sqrt()).collect()
    }

    /// The 95 % interval of a parameter by number; none where it is not estimated.
    pub fn interval(&self, parameter: usize) -> Option<(f64, f64)> {
        let i = self.estimated.iter().position(|e| *e == parameter)?;
        let value = self.theta.get(parameter)?;
        let half = 1.96 * self.standard_deviations().get(i)?;
        Some((value - half, value + half))
    }
}

/// Why a calibration has no result.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrationError {
    /// There is nothing to calibrate on.
    #[error("there is no data to calibrate on")]
    NoData,
    /// More unknowns than samples.
    #[error("{samples} measured samples cannot settle {unknowns} parameters and initial states")]
    TooFewSamples {
        /// Measured samples over all outputs and stretches.
        samples: usize,
        /// Estimated parameters and free initial states.
        unknowns: usize,
    },
    /// An output that does not move.
    #[error("output `{0}` is constant in the data: nothing can be learnt from it")]
    ConstantOutput(String),
    /// The simulation is not finite for any start.
    #[error("the simulation is not finite within the first {samples} samples from any start; {what}")]
    Diverged {
        /// Samples that were tried.
        samples: usize,
        /// What the user can look at.
        what: String,
    },
}

/// Samples on which starts are compared.
const SHORT: usize = 3000;

impl Compiled {
    /// The parameters and free initial states for which the free run comes closest to the data.
    ///
    /// The plain sum of squares (each output by its noise) decides which minimum; rounds of generalised least squares then
    /// weight by the noise's colour, and are kept only where the free-run error stays within 5 % (coloured mismatch is no
    /// noise).
    ///
    /// # Errors
    /// No data, fewer samples than unknowns, a constant output, or a simulation that is finite from no start.
    pub fn calibrate(&self, data: &[Data], settings: &Settings) -> Result<Calibration, CalibrationError> {
        let outputs = self.simulation().outputs.len();
        let estimated = settings.estimated.clone().unwrap_or_else(|| self.estimated());
        self.check(data, &estimated)?;
        let scale: Vec<f64> = (0..outputs)
            .map(|j| data.iter().map(|d| rms_about_mean(&d.measured[j])).fold(0.0, f64::max).max(f64::MIN_POSITIVE))
            .collect();
        let white: Vec<NoiseModel> = scale.iter().map(|s| NoiseModel::white(*s)).collect();
        let user = settings.theta.clone().unwrap_or_else(|| self.theta());
        let longest = data.iter().max_by_key(|d| d.len()).ok_or(CalibrationError::NoData)?;
        let check = |theta: &[f64]| {
            let x = longest.start_states(self, theta, &self.guess_initial(longest, theta));
            self.check_steps(&longest.drive, theta, Start::States(&x), settings.step_tolerance)
        };
        let mut steps = match settings.substeps {
            Some(substeps) => crate::engine::StepCheck { substeps, error: f64::NAN },
            None => check(&user),
        };
        let mut simulations = 0;
        let (mut theta, mut initial) = (user.clone(), settings.initial.clone());
        if settings.effort == Effort::Global && !estimated.is_empty() {
            let found = self.search(data, &estimated, &white, &user, steps.substeps, settings);
            simulations += found.1;
            if let Some(best) = found.0 {
                theta = best;
                initial = None;
            }
        }
        let (lower, upper) = self.box_of(data, &estimated);
        let mut objective = Objective {
            compiled: self,
            data,
            estimated: &estimated,
            theta: theta.clone(),
            substeps: steps.substeps,
            noise: white,
            gains: None,
            simulations: 0,
        };
        let limits = Limits { iterations: settings.iterations, tolerance: settings.tolerance };
        let mut p = self.point(data, &estimated, &theta, initial.as_deref());
        let mut minimum: Minimum = loop {
            let best = minimise(&p, &lower, &upper, limits, |p| objective.normal(p));
            let Some(best) = best else { return Err(self.diverged(longest.len())) };
            p.clone_from(&best.p);
            if settings.substeps.is_some() {
                break best;
            }
            // The step that suited the user's parameters may not suit these.
            let now = check(&objective.theta(&p));
            let finer = now.substeps > steps.substeps;
            steps = if finer { now } else { crate::engine::StepCheck { substeps: steps.substeps, ..now } };
            if !finer {
                break best;
            }
            objective.substeps = steps.substeps;
        };
        let plain = self.rmse(data, &objective.simulate(&p));
        for _ in 0..settings.gls_rounds {
            let models = self.noise_models(data, &objective.simulate(&p), settings.noise_order);
            let before = std::mem::replace(&mut objective.noise, models);
            let Some(next) = minimise(&p, &lower, &upper, limits, |p| objective.normal(p)) else { break };
            let error = self.rmse(data, &objective.simulate(&next.p));
            if error.iter().zip(&plain).any(|(e, plain)| !(*e <= 1.05 * plain)) {
                objective.noise = before;
                break;
            }
            p.clone_from(&next.p);
            minimum = next;
        }
        let responses = objective.simulate(&p);
        let noise = self.noise_models(data, &responses, settings.noise_order);
        objective.noise.clone_from(&noise);
        let normal = objective.normal(&p).unwrap_or_else(|| minimum.normal.clone());
        simulations += objective.simulations;
        let theta = objective.theta(&p);
        let covariance = covariance(&normal.hessian, p.len(), estimated.len(), &lower, &upper, &p);
        let residuals = residuals(data, &responses);
        let mut result = Calibration {
            initial: objective.initial(&p),
            rmse: self.rmse(data, &responses),
            simulated: responses.into_iter().map(|r| r.outputs).collect(),
            theta,
            covariance,
            residuals,
            noise,
            flags: Vec::new(),
            steps,
            simulations,
            converged: minimum.converged,
            estimated,
        };
        result.flags = self.flags(&result);
        Ok(result)
    }

    fn check(&self, data: &[Data], estimated: &[usize]) -> Result<(), CalibrationError> {
        if data.is_empty() {
            return Err(CalibrationError::NoData);
        }
        let mut samples = 0;
        for (j, output) in self.simulation().outputs.iter().enumerate() {
            let mut values = data.iter().flat_map(|d| d.measured[j].iter()).filter(|y| y.is_finite());
            let first = values.next().ok_or(CalibrationError::NoData)?;
            let mut constant = true;
            samples += 1;
            for y in values {
                constant &= y == first;
                samples += 1;
            }
            if constant {
                return Err(CalibrationError::ConstantOutput(output.column.clone()));
            }
        }
        let unknowns = estimated.len() + data.iter().map(|d| d.free.len()).sum::<usize>();
        if samples <= unknowns {
            return Err(CalibrationError::TooFewSamples { samples, unknowns });
        }
        Ok(())
    }

    fn diverged(&self, samples: usize) -> CalibrationError {
        let what = "look at the initial values, at divisions and roots at the start, and at the bounds".to_owned();
        CalibrationError::Diverged { samples, what }
    }

    /// Bounds of all variables: the parameters', none for initial states.
    fn box_of(&self, data: &[Data], estimated: &[usize]) -> (Vec<f64>, Vec<f64>) {
        let free: usize = data.iter().map(|d| d.free.len()).sum();
        let parameters = self.parameters();
        let bound = |value: fn(&crate::document::Parameter) -> f64, open: f64| {
            let mut all: Vec<f64> = estimated.iter().filter_map(|&i| parameters.get(i)).map(value).collect();
            all.extend(std::iter::repeat_n(open, free));
            all
        };
        (bound(|p| p.lower(), f64::NEG_INFINITY), bound(|p| p.upper(), f64::INFINITY))
    }

    /// The variables: estimated parameters, then initial states, guessed from the measurement where not given.
    fn point(&self, data: &[Data], estimated: &[usize], theta: &[f64], initial: Option<&[Vec<f64>]>) -> Vec<f64> {
        let mut p: Vec<f64> = estimated.iter().filter_map(|&i| theta.get(i).copied()).collect();
        for (i, data) in data.iter().enumerate() {
            match initial.and_then(|all| all.get(i)).filter(|x| x.len() == data.free.len()) {
                Some(x) => p.extend(x),
                None => p.extend(self.guess_initial(data, theta)),
            }
        }
        p
    }

    /// The smallest free initial states that reproduce the first measured outputs, to first order.
    fn guess_initial(&self, data: &Data, theta: &[f64]) -> Vec<f64> {
        if data.free.is_empty() {
            return Vec::new();
        }
        let (_, n, outputs) = self.sizes();
        let x = self.start_states(theta);
        let u: Vec<f64> = data.drive.inputs().iter().map(|s| s.first().copied().unwrap_or(0.0)).collect();
        let linear = self.linearise(theta, &x, &u);
        let c = DMatrix::from_fn(outputs, data.free.len(), |j, k| linear.c[j * n + data.free[k]]);
        let e = DMatrix::from_fn(outputs, 1, |j, _| {
            let first = data.measured[j].first().copied().filter(|y| y.is_finite());
            first.map_or(0.0, |y| y - linear.outputs[j])
        });
        let zero = vec![0.0; data.free.len()];
        if c.iter().chain(e.iter()).any(|x| !x.is_finite()) {
            return zero;
        }
        match c.clone().pseudo_inverse(1e-12 * c.norm()) {
            Ok(inverse) => (inverse * e).as_slice().to_vec(),
            Err(_) => zero,
        }
    }

    /// The parameters of the best start after a short search on part of the data, and the simulations that took.
    fn search(
        &self,
        data: &[Data],
        estimated: &[usize],
        white: &[NoiseModel],
        user: &[f64],
        substeps: usize,
        settings: &Settings,
    ) -> (Option<Vec<f64>>, usize) {
        let short: Vec<Data> = self.excerpts(data);
        let Some(longest) = short.iter().max_by_key(|d| d.len()) else { return (None, 0) };
        let designed = starts::design(self, estimated, 64, settings.seed);
        let mut all = vec![user.to_vec()];
        all.extend(starts::from_response(self, longest, estimated, &designed, 2, substeps));
        all.extend(designed.iter().step_by(11).cloned());
        let (lower, upper) = self.box_of(&short, estimated);
        let mut simulations = 0;
        let mut found: Vec<(f64, Vec<f64>)> = Vec::new();
        let samples: usize = short.iter().map(Data::len).sum::<usize>() * white.len();
        let strengths: &[f64] = if self.simulation().is_static() { &[0.0] } else { &[1.0, 0.1, 0.01, 0.0] };
        for theta in all {
            let mut objective = Objective {
                compiled: self,
                data: &short,
                estimated,
                theta: theta.clone(),
                substeps,
                noise: white.to_vec(),
                gains: None,
                simulations: 0,
            };
            let mut p = self.point(&short, estimated, &theta, None);
            let mut best = f64::INFINITY;
            for &strength in strengths {
                let now = objective.theta(&p);
                let initial = objective.initial(&p);
                objective.gains = (strength > 0.0).then(|| {
                    let pairs = short.iter().zip(&initial);
                    let gain = |(d, x): (&Data, &Vec<f64>)| {
                        self.observer_gain(d, &now, &d.start_states(self, &now, x), strength)
                    };
                    pairs.map(gain).collect()
                });
                let last = strength == 0.0;
                let limits =
                    Limits { iterations: if last { 12 } else { 5 }, tolerance: if last { 1e-4 } else { 1e-2 } };
                if let Some(minimum) = minimise(&p, &lower, &upper, limits, |p| objective.normal(p)) {
                    p = minimum.p;
                    if last {
                        best = minimum.normal.cost;
                    }
                }
            }
            simulations += objective.simulations;
            if best.is_finite() {
                let theta = objective.theta(&p);
                // Two starts that agree on the best so far, or an error far below the signal, end the search.
                let agreed =
                    found.iter().any(|(cost, known)| (best - cost).abs() <= 0.01 * cost && starts::same(known, &theta));
                let least = found.iter().map(|(c, _)| *c).fold(best, f64::min);
                found.push((best, theta));
                let relative = (2.0 * least / samples as f64).sqrt();
                if best <= 1.01 * least && (relative < 0.03 || (agreed && found.len() >= 2)) {
                    break;
                }
            }
        }
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        (found.into_iter().next().map(|(_, theta)| theta), simulations)
    }

    /// The stretches, or the liveliest windows of the longest two where they are long.
    fn excerpts(&self, data: &[Data]) -> Vec<Data> {
        if data.iter().map(Data::len).sum::<usize>() <= 2 * SHORT {
            return data.to_vec();
        }
        let mut order: Vec<&Data> = data.iter().collect();
        order.sort_by_key(|d| std::cmp::Reverse(d.len()));
        let window = |d: &&Data| {
            if d.len() <= SHORT {
                return Some((*d).clone());
            }
            let power = |start: usize| -> f64 {
                let parts = d.measured.iter().filter_map(|s| s.get(start..start + SHORT));
                parts.map(rms_about_mean).sum()
            };
            let starts: Vec<usize> = (0..4).map(|k| k * (d.len() - SHORT) / 3).collect();
            let first = power(0);
            let best = starts.into_iter().max_by(|a, b| power(*a).total_cmp(&power(*b)))?;
            // The start is better known than a window in the middle.
            if first >= 0.5 * power(best) { Some(d.shortened(SHORT)) } else { d.part(self, best..best + SHORT) }
        };
        order.iter().take(2).filter_map(window).collect()
    }

    fn noise_models(&self, data: &[Data], responses: &[crate::engine::Response], order: usize) -> Vec<NoiseModel> {
        let residuals = residuals(data, responses);
        (0..self.simulation().outputs.len())
            .map(|j| {
                let series: Vec<&[f64]> = residuals.iter().map(|r| r[j].as_slice()).collect();
                NoiseModel::fit(&series, order)
            })
            .collect()
    }

    fn rmse(&self, data: &[Data], responses: &[crate::engine::Response]) -> Vec<f64> {
        let residuals = residuals(data, responses);
        (0..self.simulation().outputs.len())
            .map(|j| {
                if responses.iter().any(|r| r.diverged.is_some()) {
                    return f64::INFINITY;
                }
                let errors = residuals.iter().flat_map(|r| r[j].iter()).filter(|e| e.is_finite());
                let (n, sum) = errors.fold((0.0, 0.0), |(n, sum), e| (n + 1.0, sum + e * e));
                (sum / f64::max(n, 1.0)).sqrt()
            })
            .collect()
    }

    fn flags(&self, result: &Calibration) -> Vec<Flag> {
        let mut flags = Vec::new();
        for (&i, deviation) in result.estimated.iter().zip(result.standard_deviations()) {
            let (Some(p), Some(&value)) = (self.parameters().get(i), result.theta.get(i)) else { continue };
            let near = 1e-6 * (p.upper() - p.lower()).min(1e300);
            for bound in [p.lower(), p.upper()] {
                if bound.is_finite() && (value - bound).abs() <= near {
                    flags.push(Flag::AtBound { parameter: i, bound });
                }
            }
            let moved = (value - p.value).abs();
            if moved > 0.5 * p.value.abs() && moved > 3.0 * deviation && p.value != 0.0 {
                flags.push(Flag::FarFromUser { parameter: i, user: p.value });
            }
            if deviation > value.abs() && deviation > p.value.abs() && p.value != 0.0 {
                flags.push(Flag::Undetermined { parameter: i });
            }
        }
        flags
    }
}

fn residuals(data: &[Data], responses: &[crate::engine::Response]) -> Vec<Vec<Vec<f64>>> {
    let difference = |(m, s): (&Vec<f64>, &Vec<f64>)| m.iter().zip(s).map(|(m, s)| m - s).collect();
    let pairs = data.iter().zip(responses);
    pairs.map(|(d, r)| d.measured.iter().zip(&r.outputs).map(difference).collect()).collect()
}

/// The parameters' block of the inverse Hessian (noise of unit variance); variables at a bound do not vary.
fn covariance(hessian: &[f64], n: usize, parameters: usize, lower: &[f64], upper: &[f64], p: &[f64]) -> Vec<f64> {
    let free: Vec<usize> = (0..n).filter(|&i| p[i] > lower[i] && p[i] < upper[i]).collect();
    let scale: Vec<f64> = free.iter().map(|&i| hessian[i * n + i].max(f64::MIN_POSITIVE).sqrt()).collect();
    let matrix = DMatrix::from_fn(free.len(), free.len(), |a, b| {
        hessian[free[a] + free[b] * n] / (scale[a] * scale[b]) + if a == b { 1e-13 } else { 0.0 }
    });
    let mut out = vec![0.0; parameters * parameters];
    let Some(inverse) = matrix.cholesky().map(|c| c.inverse()) else {
        out.iter_mut().for_each(|x| *x = f64::INFINITY);
        return out;
    };
    for (a, &i) in free.iter().enumerate() {
        for (b, &j) in free.iter().enumerate() {
            if i < parameters && j < parameters {
                out[i + j * parameters] = inverse[(a, b)] / (scale[a] * scale[b]);
            }
        }
    }
    out
}
