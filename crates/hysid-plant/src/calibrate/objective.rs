//! The sum of squares that is minimised: whitened output errors over all stretches, with their derivatives.

use hysid_signal::Autoregression;

use super::Data;
use super::least_squares::Normal;
use crate::engine::{Compiled, Direction, MOST_STEPS, Observer, Run, Start};

/// How far around a point the border of stability is looked for, parameter by parameter.
const NEAR: [f64; 2] = [0.8, 1.25];

/// What the variables of a minimisation are: estimated parameters, then each stretch's free initial states.
pub(crate) struct Objective<'a> {
    pub compiled: &'a Compiled,
    pub data: &'a [Data],
    /// Numbers of the estimated parameters.
    pub estimated: &'a [usize],
    /// All parameters; the estimated ones are replaced.
    pub theta: Vec<f64>,
    pub substeps: usize,
    /// One noise model for each output.
    pub noise: Vec<Autoregression>,
    /// Observer gain for each stretch, if the run is corrected.
    pub gains: Option<Vec<Vec<f64>>>,
    /// Simulations run so far, a chunk of derivatives counting as one.
    pub simulations: usize,
}

impl Objective<'_> {
    /// All parameters at a point.
    pub fn theta(&self, p: &[f64]) -> Vec<f64> {
        let mut theta = self.theta.clone();
        for (&i, value) in self.estimated.iter().zip(p) {
            if let Some(slot) = theta.get_mut(i) {
                *slot = *value;
            }
        }
        theta
    }

    /// The free initial states of each stretch at a point.
    pub fn initial(&self, p: &[f64]) -> Vec<Vec<f64>> {
        let mut at = self.estimated.len();
        let mut next = |count: usize| {
            let values = p.get(at..at + count).unwrap_or_default().to_vec();
            at += count;
            values
        };
        self.data.iter().map(|d| next(d.free.len())).collect()
    }

    /// Half the sum of squares with its derivatives; `None` where a simulation diverged.
    pub fn normal(&mut self, p: &[f64]) -> Option<Normal> {
        let theta = self.theta(p);
        let mut total = Normal::zero(p.len());
        let initial = self.initial(p);
        let mut first = self.estimated.len();
        for (i, (data, initial)) in self.data.iter().zip(&initial).enumerate() {
            let x = data.start_states(self.compiled, &theta, initial);
            // A state that starts at an expression of parameters moves with them, unless it is free.
            let document = data.free == self.compiled.free_states();
            let start = if document { Start::Document(initial) } else { Start::States(&x) };
            let mut run = Run::new(&data.drive, &theta).from(start).with_substeps(self.substeps);
            if let Some(gain) = self.gains.as_ref().and_then(|g| g.get(i)) {
                run = run.observing(Observer { gain, measured: &data.measured });
            }
            let mut directions: Vec<Direction<'_>> = self.estimated.iter().map(|&i| Direction::Parameter(i)).collect();
            directions.extend(data.free.iter().map(|&i| Direction::Initial(i)));
            let mut index: Vec<usize> = (0..self.estimated.len()).collect();
            index.extend((0..data.free.len()).map(|k| first + k));
            first += data.free.len();
            let result = self.compiled.sensitivities(&run, &directions);
            self.simulations += directions.len().div_ceil(8).max(1);
            if result.response.diverged.is_some() {
                return None;
            }
            for (j, noise) in self.noise.iter().enumerate() {
                let (measured, simulated) = (&data.measured[j], &result.response.outputs[j]);
                let present: Vec<bool> = measured.iter().map(|y| y.is_finite()).collect();
                let mut e: Vec<f64> = simulated.iter().zip(measured).map(|(s, m)| s - m).collect();
                noise.whiten_present(&mut e, &present);
                let mut columns: Vec<Vec<f64>> = result.tangents.iter().map(|t| t[j].clone()).collect();
                columns.iter_mut().for_each(|c| noise.whiten_present(c, &present));
                let columns: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
                total.add(&e, &columns, &index);
            }
        }
        let finite = total.cost.is_finite() && total.gradient.iter().chain(&total.hessian).all(|x| x.is_finite());
        finite.then_some(total)
    }

    /// Whether a descent may have come to the border beyond which a stiff simulation explodes for want of steps: near the point it does, and with twice as
    /// many steps it does not.
    pub fn cramped(&mut self, p: &[f64], lower: &[f64], upper: &[f64]) -> bool {
        if 2 * self.substeps > MOST_STEPS {
            return false;
        }
        let explodes = |o: &Self, q: &[f64]| o.simulate(q).iter().any(|r| r.diverged.is_some());
        let points = (0..self.estimated.len()).flat_map(|i| NEAR.map(|factor| (i, factor)));
        for (i, factor) in points {
            let mut q = p.to_vec();
            q[i] = (factor * q[i]).clamp(lower[i], upper[i]);
            self.simulations += 1;
            if explodes(self, &q) {
                self.substeps *= 2;
                let cured = !explodes(self, &q);
                self.substeps /= 2;
                if cured {
                    return true;
                }
            }
        }
        false
    }

    /// Simulated outputs of every stretch at a point (`[stretch][output][sample]`), without correction.
    pub fn simulate(&self, p: &[f64]) -> Vec<crate::engine::Response> {
        let theta = self.theta(p);
        let initial = self.initial(p);
        let pairs = self.data.iter().zip(&initial);
        pairs
            .map(|(data, initial)| {
                let x = data.start_states(self.compiled, &theta, initial);
                let run = Run::new(&data.drive, &theta).from(Start::States(&x)).with_substeps(self.substeps);
                self.compiled.simulate(&run)
            })
            .collect()
    }
}
