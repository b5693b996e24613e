//! The search for the best start: from each of several, a homotopy from prediction to the free run on part of the data.

use std::cell::LazyCell;

use hysid_signal::Autoregression;

use super::Data;
use super::least_squares::{Limits, minimise};
use super::objective::Objective;
use super::observer::rms_about_mean;
use super::refined::Attained;
use super::settings::Settings;
use super::starts;
use crate::engine::Compiled;

/// Samples on which starts are compared.
const SHORT: usize = 3000;
/// Error over the signal from which on it is far below that, and the starts after which that ends the search: a closed loop that sticks has local minima
/// with little error.
const SMALL: (f64, usize) = (0.03, 3);
/// Strengths of the observer on the way to the free run, and the free run alone.
pub(super) const HOMOTOPY: &[f64] = &[1.0, 0.1, 0.01, 0.0];
const FREE_RUN: &[f64] = &[0.0];

/// Where a search begins, and how it goes on.
pub(super) struct Start {
    pub theta: Vec<f64>,
    /// Strengths of the observer on the way to the free run.
    pub strengths: &'static [f64],
    /// Whether it comes from the identification.
    pub identified: bool,
    /// What a linear model with free coefficients attains on the outputs, where that is known.
    pub linear: Option<Vec<Attained>>,
}

impl Start {
    pub fn new(theta: Vec<f64>, strengths: &'static [f64]) -> Self {
        Self { theta, strengths, identified: false, linear: None }
    }

    /// Whether a cost is that of the linear model: the core is linear then, and no other parameters can do better. `None` of
    /// several stretches, of which only one was identified.
    fn is_explained(&self, cost: f64, data: &[Data], noise: &[Autoregression]) -> bool {
        let (Some(linear), [data]) = (&self.linear, data) else { return false };
        let samples = data.len() as f64;
        let sum = |f: &dyn Fn(&Attained) -> f64| -> f64 {
            linear.iter().zip(noise).map(|(a, n)| 0.5 * samples * f(a) / n.innovation().powi(2)).sum()
        };
        let by_chance = |a: &Attained| a.mean_square * (1.0 + 2.0 * a.unknowns as f64 / samples);
        cost >= 0.95 * sum(&|a| a.mean_square) && cost <= sum(&by_chance)
    }
}

impl Compiled {
    /// The parameters of the best start after a short search on part of the data, and the simulations that took.
    pub(super) fn search(
        &self,
        data: &[Data],
        estimated: &[usize],
        white: &[Autoregression],
        user: &[f64],
        substeps: usize,
        settings: &Settings,
    ) -> (Option<Vec<f64>>, usize) {
        let short: Vec<Data> = self.excerpts(data);
        let Some(longest) = short.iter().max_by_key(|d| d.len()) else { return (None, 0) };
        let designed = starts::design(self, estimated, 64, settings.seed);
        // Each is made only when those before it have not ended the search.
        let core = LazyCell::new(|| starts::Core::new(self, longest, estimated, user, &designed, substeps));
        let homotopy = if self.simulation().is_static() { FREE_RUN } else { HOMOTOPY };
        // What the record itself says is near the minimum, if it is right, and needs no homotopy: 4 simulations where the user's
        // values take 20.
        let identified = |core: &starts::Core<'_>| {
            let (found, linear) = core.by_identification(2);
            found.into_iter().map(move |theta| Start {
                theta,
                strengths: FREE_RUN,
                identified: true,
                linear: linear.clone(),
            })
        };
        let measured = |core: &starts::Core<'_>| core.by_measured_response(2);
        let lazily = || std::iter::once_with(|| core.as_ref()).flatten();
        let all = lazily()
            .flat_map(identified)
            .chain(std::iter::once_with(|| Start::new(user.to_vec(), homotopy)))
            .chain(lazily().flat_map(measured).map(|theta| Start::new(theta, homotopy)))
            .chain(designed.iter().step_by(11).map(|theta| Start::new(theta.clone(), homotopy)));
        self.search_from(all, &short, estimated, white, substeps)
    }

    /// The best of short searches from these starts, and the simulations that took.
    pub(super) fn search_from(
        &self,
        all: impl Iterator<Item = Start>,
        short: &[Data],
        estimated: &[usize],
        white: &[Autoregression],
        substeps: usize,
    ) -> (Option<Vec<f64>>, usize) {
        let (lower, upper) = self.box_of(short, estimated);
        let mut simulations = 0;
        let mut found: Vec<(f64, Vec<f64>)> = Vec::new();
        // Starts from one identification are no witnesses for each other.
        let mut witnesses = 0;
        let samples: usize = short.iter().map(Data::len).sum::<usize>() * white.len();
        for start in all {
            let mut objective = Objective {
                compiled: self,
                data: short,
                estimated,
                theta: start.theta.clone(),
                substeps,
                noise: white.to_vec(),
                gains: None,
                simulations: 0,
            };
            let mut p = self.point(short, estimated, &start.theta, None);
            let mut best = f64::INFINITY;
            for &strength in start.strengths {
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
                // Two starts that agree on the best so far, an error far below the signal after some starts, or as little as a linear model with
                // free coefficients leaves, end the search.
                let agreed =
                    found.iter().any(|(cost, known)| (best - cost).abs() <= 0.01 * cost && starts::same(known, &theta));
                let least = found.iter().map(|(c, _)| *c).fold(best, f64::min);
                found.push((best, theta));
                witnesses += usize::from(!start.identified);
                let relative = (2.0 * least / samples as f64).sqrt();
                let explained = start.is_explained(best, short, white);
                let small = relative < SMALL.0 && found.len() >= SMALL.1;
                if best <= 1.01 * least && (small || explained || (agreed && witnesses > 0)) {
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
}
