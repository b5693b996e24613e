//! The free initial state of one recording from its first samples, and what to say where a simulation is not finite.

use hysid_signal::tell::digits;

use super::{Data, Settings};
use crate::engine::{Compiled, Response};

/// The share of a recording that may settle its initial state.
pub const INITIAL_SHARE: f64 = 0.05;

impl Compiled {
    /// The free initial states of a stretch, in the order of [`Data::free`], and the number of samples that settled them (at
    /// most [`INITIAL_SHARE`] of the stretch). The parameters stay as they are.
    pub fn estimate_initial(&self, data: &Data, theta: &[f64], substeps: usize) -> (Vec<f64>, usize) {
        if data.free.is_empty() {
            return (Vec::new(), 0);
        }
        let most = (data.len() as f64 * INITIAL_SHARE).floor() as usize;
        let guess = self.guess_initial(data, theta);
        let short = data.shortened(most);
        let settings = Settings {
            estimated: Some(Vec::new()),
            substeps: Some(substeps),
            initial: Some(vec![guess.clone()]),
            gls_rounds: 0,
            noise_order: 0,
            ..Settings::local(theta.to_vec())
        };
        match self.calibrate(std::slice::from_ref(&short), &settings) {
            Ok(result) => (result.initial.into_iter().next().unwrap_or(guess), most),
            // Too few samples, or a constant start: the first sample has to do.
            Err(_) => (guess, usize::from(most > 0)),
        }
    }

    /// The key at fault and a sentence on why a run that started at states `x` with inputs `u` diverged at sample `at`.
    pub fn explain_divergence(&self, theta: &[f64], x: &[f64], u: &[f64], response: &Response) -> String {
        let Some(at) = response.diverged else { return String::new() };
        let point = self.linearise(theta, x, u);
        let simulation = self.simulation();
        if let Some((state, value)) = simulation.states.iter().zip(&point.flow).find(|(_, f)| !f.is_finite()) {
            return format!(
                "`states.{0}.derivative`: the derivative of state `{0}` is {value} at the first sample",
                state.name
            );
        }
        if let Some((output, value)) = simulation.outputs.iter().zip(&point.outputs).find(|(_, y)| !y.is_finite()) {
            return format!("`outputs.{0}`: output `{0}` is {value} at the first sample", output.column);
        }
        if let Some(output) = response.diverged_output.and_then(|j| simulation.outputs.get(j)) {
            return format!(
                "`outputs.{0}`: output `{0}` is not finite at sample {at}, though all states are",
                output.column
            );
        }
        let last = at.saturating_sub(1);
        let size = |i: usize| response.states.get(i).and_then(|s| s.get(last)).map_or(0.0, |x| x.abs());
        let largest = (0..simulation.states.len()).max_by(|a, b| size(*a).total_cmp(&size(*b)));
        match largest.and_then(|i| simulation.states.get(i).map(|s| (i, s))) {
            Some((i, state)) => {
                format!(
                    "`states.{0}.derivative`: state `{0}` explodes: it is {1} at sample {last} and not finite at sample {at}",
                    state.name,
                    digits(size(i), 4)
                )
            }
            None => format!("an output is not finite at sample {at}"),
        }
    }
}
