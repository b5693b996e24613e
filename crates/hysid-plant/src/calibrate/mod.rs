//! Calibration: the parameters and initial states that make a simulation reproduce recordings, found globally in their bounds.
//!
//! A bad parameter must never pass for missing physics, so one local search is not enough: starts are the linear core fitted to
//! transfer functions that are identified from the record (refined instrumental variables), the user's values, the linear core
//! fitted to the measured frequency response, and a seeded design. The first are searched in free run; from each other one, a
//! homotopy leads from prediction (an observer holds the simulation near the measurement, which makes the landscape nearly
//! convex) to the free run. An error far below the signal after three starts, or two starts that agree on the best, end the
//! search. The best is polished on all data. Coloured noise is weighted by an autoregression, in rounds of generalised least squares.
//!
//! A stretch that diverges has infinite cost. Nothing here draws a conclusion from what remains: it returns the residuals.

mod data;
mod frequency;
mod initial;
mod least_squares;
mod objective;
mod observer;
mod refined;
mod search;
mod settings;
mod starts;
#[cfg(test)]
mod tests;

use hysid_signal::Autoregression;
use nalgebra::DMatrix;

use crate::engine::{Compiled, Start};
use least_squares::{Limits, Minimum, minimise};
use objective::Objective;
use observer::rms_about_mean;

pub use data::Data;
pub use initial::INITIAL_SHARE;
pub use settings::{Calibration, CalibrationError, Effort, Flag, Settings};

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
        let white: Vec<Autoregression> = scale.iter().map(|s| Autoregression::white(*s)).collect();
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
            let substeps = if finer {
                now.substeps
            } else if objective.cramped(&p, &lower, &upper) {
                2 * steps.substeps
            } else {
                steps.substeps
            };
            let ended = substeps == steps.substeps;
            steps = crate::engine::StepCheck { substeps, ..now };
            if ended {
                break best;
            }
            objective.substeps = substeps;
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

    fn noise_models(&self, data: &[Data], responses: &[crate::engine::Response], order: usize) -> Vec<Autoregression> {
        let residuals = residuals(data, responses);
        (0..self.simulation().outputs.len())
            .map(|j| {
                let stretches = residuals.iter().flat_map(|r| r[j].split(|e| !e.is_finite()));
                Autoregression::fit(&stretches.filter(|s| !s.is_empty()).collect::<Vec<_>>(), order)
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
            let span = p.upper() - p.lower();
            let near = 1e-6 * if span.is_finite() { span } else { value.abs() };
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
