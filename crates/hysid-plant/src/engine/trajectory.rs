//! A single run over all samples: outputs, states, tangents.

use super::machine::Machine;
use super::memory::Phase;
use super::run::{Response, Tangents};
use crate::document::Hold;
use crate::number::{Number, Single};

/// Beyond this size a state or output counts as diverged.
const HUGE: f64 = 1e100;

impl Response {
    /// Ends the response at sample `n` if an output or a state there is not finite or beyond [`HUGE`]; returns whether it is.
    pub(super) fn ends_at(
        &mut self,
        n: usize,
        mut y: impl Iterator<Item = f64>,
        mut x: impl Iterator<Item = f64>,
    ) -> bool {
        let bad = |v: f64| !(v.abs() < HUGE);
        let output = y.position(bad);
        let state = x.any(bad);
        if output.is_some() || state {
            self.diverged = Some(n);
            self.diverged_output = output.filter(|_| !state);
        }
        self.diverged.is_some()
    }
}

impl<N: Number> Machine<'_, N> {
    /// Whether the arguments of surfaces jump at samples.
    pub fn jumps(&self) -> bool {
        self.run.observer.is_some()
            || (self.hold == Hold::Zero && self.model.surfaces.iter().any(|s| !s.by_input.is_empty()))
    }

    /// Steps in each sampling period.
    pub fn substeps(&self) -> usize {
        if self.x.is_empty() { 1 } else { self.run.substeps.max(1) }
    }
}

/// A response of this size, `NaN` throughout.
pub(super) fn empty(outputs: usize, states: usize, len: usize) -> Response {
    Response {
        outputs: vec![vec![f64::NAN; len]; outputs],
        states: vec![vec![f64::NAN; len]; states],
        diverged: None,
        diverged_output: None,
    }
}

impl<N: Single> Machine<'_, N> {
    /// State derivatives and outputs at the start, each with its tangents.
    pub fn beside(mut self) -> (Vec<(f64, Vec<f64>)>, Vec<(f64, Vec<f64>)>) {
        let zero = N::lift(0.0);
        let x = self.x.clone();
        let mut flow = vec![zero; x.len()];
        let mut outputs = vec![zero; self.model.outputs.len()];
        let moment = self.moment(0.0, 0.0, 0.0, Phase::Start);
        self.moded_flow(&x, &moment, &mut flow);
        self.measure(&mut outputs);
        let directions = self.directions;
        let split =
            |y: Vec<N>| y.iter().map(|y| (y.value(), (0..directions).map(|k| y.tangent(k)).collect())).collect();
        (split(flow), split(outputs))
    }

    /// Runs over all samples.
    pub fn run(mut self) -> (Response, Tangents) {
        let (len, outputs) = (self.run.drive.len, self.model.outputs.len());
        let mut response = empty(outputs, self.x.len(), len);
        let mut tangents = vec![vec![vec![f64::NAN; len]; outputs]; self.directions];
        let substeps = self.substeps();
        let step = self.run.drive.period_s / substeps as f64;
        let jumps = self.jumps();
        let mut y = vec![N::lift(0.0); outputs];
        for n in 0..len {
            self.go_to(n);
            if !self.modes.is_empty() && (n == 0 || jumps) {
                self.refresh();
            }
            self.measure(&mut y);
            if response.ends_at(n, y.iter().map(|v| v.value()), self.x.iter().map(|v| v.value())) {
                break;
            }
            for (j, y) in y.iter().enumerate() {
                response.outputs[j][n] = y.value();
                for (k, t) in tangents.iter_mut().enumerate() {
                    t[j][n] = y.tangent(k);
                }
            }
            for (to, x) in response.states.iter_mut().zip(&self.x) {
                to[n] = x.value();
            }
            if n + 1 == len {
                break;
            }
            if let Some(observer) = self.run.observer {
                self.correct(&y, observer.gain, observer.measured);
            }
            for s in 0..substeps {
                self.advance(step * s as f64, step);
            }
        }
        (response, tangents)
    }

    /// Outputs at the present sample.
    pub fn measure(&mut self, y: &mut [N]) {
        if self.any_stuck {
            let moment = self.moment(0.0, 0.0, 0.0, Phase::Start);
            let x = std::mem::take(&mut self.x);
            let mut k = std::mem::take(&mut self.spare);
            self.moded_flow(&x, &moment, &mut k);
            self.spare = k;
            self.x = x;
            self.measure_here(&moment, y);
        } else {
            self.measure_freely(y);
        }
    }

    /// The observer's correction of the states.
    fn correct(&mut self, y: &[N], gain: &[f64], measured: &[Vec<f64>]) {
        let outputs = self.model.outputs.len();
        for (j, y) in y.iter().enumerate() {
            let Some(target) = measured.get(j).and_then(|m| m.get(self.n)).filter(|m| m.is_finite()) else {
                continue;
            };
            let error = N::lift(*target).sub(*y);
            for (i, x) in self.x.iter_mut().enumerate() {
                *x = x.add(error.scale(gain.get(i * outputs + j).copied().unwrap_or(0.0)));
            }
        }
        if !self.modes.is_empty() {
            self.refresh();
        }
    }
}
