//! Many runs of one model at once, with and without sensitivities.

use super::Compiled;
use super::lockstep::Lockstep;
use super::run::{Direction, Response, Run, Sensitivity};
use crate::document::Hold;

/// Runs that go together.
const LANES: usize = 8;

impl Compiled {
    /// The responses of many runs, in their order; each is bit for bit what [`Compiled::simulate`] gives for it alone.
    ///
    /// Runs that follow each other, have the same drive and steps and are plain (no observer, no injections) go together,
    /// eight at a time, which costs little more than one.
    pub fn simulate_many(&self, runs: &[Run<'_>]) -> Vec<Response> {
        let all = self.together(runs);
        let one = |run: &Run<'_>| self.simulate(run);
        all.flat_map(|runs| match self.in_lanes::<0>(runs, &[]) {
            Some(all) => all.into_iter().map(|s| s.response).collect(),
            None => runs.iter().map(one).collect::<Vec<_>>(),
        })
        .collect()
    }

    /// The responses of many runs with their derivatives by the same directions; each is bit for bit what
    /// [`Compiled::sensitivities`] gives for it alone.
    pub fn sensitivities_many(&self, runs: &[Run<'_>], directions: &[Direction<'_>]) -> Vec<Sensitivity> {
        let one = |run: &Run<'_>| self.sensitivities(run, directions);
        self.together(runs)
            .flat_map(|runs| {
                let all = match directions.len() {
                    0 => self.in_lanes::<0>(runs, directions),
                    1 => self.in_lanes::<1>(runs, directions),
                    2 => self.in_lanes::<2>(runs, directions),
                    _ => None,
                };
                all.unwrap_or_else(|| runs.iter().map(one).collect())
            })
            .collect()
    }

    /// The runs in stretches that can share lanes.
    fn together<'r, 'a>(&self, runs: &'r [Run<'a>]) -> impl Iterator<Item = &'r [Run<'a>]> {
        let jumps = self.hold() == Hold::Zero && self.surfaces.iter().any(|s| !s.by_input.is_empty());
        let possible = !self.has_delay && !jumps;
        let plain = move |run: &Run<'_>| possible && run.observer.is_none() && run.injections.is_empty();
        let alike = move |a: &Run<'_>, b: &Run<'_>| {
            std::ptr::eq(a.drive, b.drive) && a.substeps == b.substeps && plain(a) && plain(b)
        };
        runs.chunk_by(alike).flat_map(|alike| alike.chunks(LANES))
    }

    /// The runs of one stretch in lanes; none where lanes do not pay.
    fn in_lanes<const T: usize>(&self, runs: &[Run<'_>], directions: &[Direction<'_>]) -> Option<Vec<Sensitivity>> {
        if runs.len() < 2 {
            return None;
        }
        let all = Lockstep::<LANES, T>::new(self, runs, directions)?.run();
        let all = all.into_iter().take(runs.len());
        Some(all.map(|(response, tangents)| Sensitivity { response, tangents }).collect())
    }
}
