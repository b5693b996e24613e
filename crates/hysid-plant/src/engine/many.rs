//! Many runs of one model at once.

use super::Compiled;
use super::run::{Response, Run};

impl Compiled {
    /// The responses of many runs, in their order; each is bit for bit what [`Compiled::simulate`] gives for it alone.
    pub fn simulate_many(&self, runs: &[Run<'_>]) -> Vec<Response> {
        runs.iter().map(|run| self.simulate(run)).collect()
    }
}
