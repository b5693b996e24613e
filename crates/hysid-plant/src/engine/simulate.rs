//! A run by itself, with and without sensitivities.

use super::Compiled;
use super::drive::Drive;
use super::machine::Machine;
use super::run::{Direction, Response, Run, Sensitivity, Tangents};
use super::trajectory::empty;
use crate::number::{Lanes, Single};

impl Compiled {
    /// The outputs and states of a run.
    pub fn simulate(&self, run: &Run<'_>) -> Response {
        self.machine::<Lanes<1, 0>>(run, &[]).0
    }

    /// The outputs of a run with their derivatives, by forward differentiation through every step and every event.
    pub fn sensitivities(&self, run: &Run<'_>, directions: &[Direction<'_>]) -> Sensitivity {
        let mut response = None;
        let mut tangents = Vec::with_capacity(directions.len());
        let mut rest = directions;
        while !rest.is_empty() {
            let (chunk, next) = rest.split_at(rest.len().min(12));
            let (r, t) = match chunk.len() {
                // One tangent by itself is slower than two: the compiler pairs it with the value.
                1..=2 => self.machine::<Lanes<1, 2>>(run, chunk),
                3..=4 => self.machine::<Lanes<1, 4>>(run, chunk),
                5..=8 => self.machine::<Lanes<1, 8>>(run, chunk),
                _ => self.machine::<Lanes<1, 12>>(run, chunk),
            };
            tangents.extend(t);
            response = Some(r);
            rest = next;
        }
        Sensitivity { response: response.unwrap_or_else(|| self.simulate(run)), tangents }
    }

    /// The states at the first sample for these parameters; free ones are 0.
    pub(crate) fn first_states(&self, drive: &Drive, theta: &[f64]) -> Vec<f64> {
        let one = drive.shortened(1);
        let response = self.simulate(&Run::new(&one, theta));
        response.states.iter().map(|s| s.first().copied().unwrap_or(f64::NAN)).collect()
    }

    fn machine<N: Single>(&self, run: &Run<'_>, directions: &[Direction<'_>]) -> (Response, Tangents) {
        match Machine::<N>::new(self, std::slice::from_ref(run), directions) {
            Some(machine) => machine.run(),
            // Not reached: there is one run.
            None => (empty(0, 0, 0), Vec::new()),
        }
    }
}
