//! What an operator is: an immutable model whose memory is a separate state.

use std::fmt::Debug;

/// A hysteresis operator: `y[n]` from `u[n]` and what the state remembers of `u[0..n]`.
///
/// The model is immutable, so one model serves many runs on any thread; each run has its own state. Inputs are finite: cut a
/// recording at its gaps first. A non-finite input does not panic, but what follows from it is not specified.
pub trait Operator: Send + Sync {
    /// What the operator remembers. Cloning it forks a run.
    type State: Clone + Debug + Send + Sync;

    /// The state before the first sample.
    fn init(&self) -> Self::State;

    /// The output for the next input sample.
    fn step(&self, state: &mut Self::State, u: f64) -> f64;

    /// Continues from `state` over the samples `u`; writes as many outputs as the shorter of the two slices holds.
    fn run_from(&self, state: &mut Self::State, u: &[f64], y: &mut [f64]) {
        for (y, &u) in y.iter_mut().zip(u) {
            *y = self.step(state, u);
        }
    }

    /// The outputs for the samples `u` from the initial state: one for each input.
    fn run(&self, u: &[f64]) -> Vec<f64> {
        let mut y = vec![0.0; u.len()];
        self.run_from(&mut self.init(), u, &mut y);
        y
    }
}

/// An [`Operator`] whose type is not known when compiling: every operator is one.
///
/// It is what a term of a dictionary or a command line holds (`Box<dyn DynOperator>`).
pub trait DynOperator: Send + Sync {
    /// A run from the initial state, one sample at a time.
    fn start(&self) -> Box<dyn Running + '_>;

    /// The outputs for the samples `u` from the initial state: one for each input.
    fn respond(&self, u: &[f64]) -> Vec<f64>;
}

/// A run of an operator under way: the model together with its state.
pub trait Running: Send + Sync {
    /// The output for the next input sample.
    fn step(&mut self, u: f64) -> f64;

    /// A second run that remembers the same and goes its own way from here.
    fn fork<'a>(&self) -> Box<dyn Running + 'a>
    where
        Self: 'a;
}

/// The model by reference, the state by value.
struct Started<'m, O: Operator> {
    model: &'m O,
    state: O::State,
}

impl<O: Operator> Running for Started<'_, O> {
    fn step(&mut self, u: f64) -> f64 {
        self.model.step(&mut self.state, u)
    }

    fn fork<'a>(&self) -> Box<dyn Running + 'a>
    where
        Self: 'a,
    {
        Box::new(Started { model: self.model, state: self.state.clone() })
    }
}

impl<O: Operator> DynOperator for O {
    fn start(&self) -> Box<dyn Running + '_> {
        Box::new(Started { model: self, state: self.init() })
    }

    fn respond(&self, u: &[f64]) -> Vec<f64> {
        self.run(u)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Play;

    #[test]
    fn a_fork_goes_its_own_way() {
        let play = Play::new(0.25).unwrap();
        let model: &dyn DynOperator = &play;
        let mut a = model.start();
        a.step(1.0);
        let mut b = a.fork();
        assert_eq!(a.step(0.0), 0.25);
        assert_eq!(b.step(2.0), 1.75);
        assert_eq!(a.step(0.4), 0.25);
    }
}
