//! What a diagnosis is asked: the simulation, the recordings, the sets to weigh besides, and how its caller follows the work.

use hysid_plant::Simulation;
use hysid_signal::Recording;

/// Options of a diagnosis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Level of the mismatch test.
    pub alpha: f64,
    /// Seed of everything random.
    pub seed: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self { alpha: 0.01, seed: 1 }
    }
}

/// A set of effects that the caller wants to have weighed: (mechanism, slot), such as `("coulomb_friction", "state:v")`.
pub type Question = Vec<(String, String)>;

/// What a diagnosis is asked.
#[derive(Debug)]
pub struct Request<'a> {
    /// The user's simulation.
    pub simulation: &'a Simulation,
    /// Its file, for messages.
    pub file: &'a str,
    /// Recordings to estimate from.
    pub estimation: &'a [Recording],
    /// Recordings that only score; none: blocks of the estimation recordings are held out.
    pub holdout: &'a [Recording],
    /// Sets of effects to weigh besides those that the search finds.
    pub questions: &'a [Question],
    /// Options.
    pub options: Options,
}

/// How the caller follows and limits the work.
pub struct Hooks<'a> {
    /// Told at the start of each step.
    pub progress: &'a (dyn Fn(&str) + Sync),
    /// Whether this share of the time is up: optional steps are then left out.
    pub expired: &'a (dyn Fn(f64) -> bool + Sync),
    /// Told once, when the input is known to be good: work of the caller's own can go on beside the search from here.
    pub accepted: &'a (dyn Fn() + Sync),
}

impl Hooks<'static> {
    /// Nobody follows, and there is time for everything.
    pub const SILENT: Self = Self { progress: &|_| {}, expired: &|_| false, accepted: &|| {} };
}

/// A question as it was typed.
pub fn words(question: &Question) -> String {
    question.iter().map(|(m, s)| format!("{m}@{s}")).collect::<Vec<_>>().join("+")
}
