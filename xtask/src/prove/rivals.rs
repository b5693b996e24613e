//! What the same recordings give without a diagnosis (recalibration), with the truth known beforehand (the oracle), and by
//! models that know nothing of the catalogue (the competitors).
//!
//! Errors are against the outputs without noise, in units of the noise, free run over the hold-out.

use std::time::Duration;

use hysid_concealed::case::{Case, Group, Record};
use hysid_concealed::design::{Source, suits};
use hysid_concealed::law::Law;
use hysid_concealed::machine::Machine;
use hysid_concealed::oracle::oracle;
use hysid_concealed::refit::{Scope, Target, refit};
use hysid_concealed::seed::{Random, Stream};

use super::black::Errors;
use super::free_run::{distance, error};
use super::linear;
use super::sindy;
use super::trial::Bench;
use super::visible::visible;

/// Errors of the competitors on one case.
#[derive(Debug, Clone)]
pub struct Rivals {
    /// Baseline, recalibrated.
    pub before: f64,
    /// The true structure, estimated from the same recording.
    pub oracle: f64,
    /// The search for that estimate came to its end within [`PATIENCE`].
    pub oracle_complete: bool,
    /// Log likelihood ratio of the truth over the best baseline, in nats ([`visible`]).
    pub visible: f64,
    /// For a law outside the catalogue: squared distance in units of the noise to the best law inside, after its refit.
    pub separation: Option<f64>,
    /// The competitors, where they are run.
    pub competitors: Option<Competitors>,
}

impl Rivals {
    /// An error of a competitor; not a number where none was run.
    pub fn competitor(&self, error: impl Fn(&Competitors) -> f64) -> f64 {
        self.competitors.as_ref().map_or(f64::NAN, error)
    }
}

/// Errors of models that know nothing of the catalogue.
#[derive(Debug, Clone)]
pub struct Competitors {
    /// Linear black box (output-error model).
    pub linear: f64,
    /// The same at 1.5 times the amplitude.
    pub linear_louder: Option<f64>,
    /// Sparse regression of the missing force, for plants with one mass.
    pub sindy: Option<f64>,
    /// NARX by `hysid fit`, first output only: hold-out, and 1.5 times the amplitude.
    pub narx: Errors,
    /// NARX on what the recalibrated baseline leaves.
    pub narx_on_residual: Errors,
}

impl Competitors {
    /// Smallest error of a black box at 1.5 times the amplitude.
    pub fn best_black_box_louder(&self) -> Option<f64> {
        [self.linear_louder, self.narx.1, self.narx_on_residual.1].into_iter().flatten().reduce(f64::min)
    }
}

/// Longest record that the NARX competitors are given, so that they do not take more time than the diagnosis.
const LONGEST: usize = 4000;
/// Samples that the search for the best rival law looks at.
const LOOK: usize = 2000;
/// Time that the oracle of one case may take.
pub const PATIENCE: Duration = Duration::from_secs(240);

/// Recalibrates the baseline, refits the truth, and runs the competitors where they are wanted.
pub fn rivals(bench: &Bench, case: &Case, with_competitors: bool) -> Rivals {
    let baseline = case.design.baseline(&case.machine.effects);
    let recorded = Target { input: &case.est.input, y: &case.est.y };
    let sigma = &case.label.sigma;
    let calibrated =
        refit(&baseline, recorded, sigma, Scope::Plant, case.free_initial, 12).map_or(baseline, |r| r.machine);
    let (truth, oracle_complete) = oracle(&case.machine, recorded, sigma, case.free_initial, PATIENCE)
        .map_or_else(|| (case.machine.clone(), false), |e| (e.refit.machine, e.complete));
    Rivals {
        before: error(case, &calibrated, &case.val),
        oracle: error(case, &truth, &case.val),
        oracle_complete,
        visible: visible(case),
        separation: (case.label.group == Group::Outside).then(|| separation(case, &calibrated)),
        competitors: with_competitors.then(|| competitors(bench, case, &calibrated)),
    }
}

/// Fits and runs the competitors.
fn competitors(bench: &Bench, case: &Case, calibrated: &Machine) -> Competitors {
    let black = linear::fit(&case.est);
    let linear = |record: &Record| {
        black.as_ref().map_or(f64::INFINITY, |b| distance(&b.run(&record.input), &record.clean, &case.label.sigma))
    };
    let (short, unknown) = (case.label.samples <= LONGEST, (f64::NAN, None));
    Competitors {
        linear: linear(&case.val),
        linear_louder: case.louder.as_ref().map(linear),
        sindy: sindy::discrepancy(case, calibrated).map(|m| error(case, &m, &case.val)),
        narx: if short { bench.narx(case) } else { unknown },
        narx_on_residual: if short { bench.narx_on_residual(case, calibrated) } else { unknown },
    }
}

/// Squared distance from the outputs without noise to the best law of the catalogue.
fn separation(case: &Case, calibrated: &Machine) -> f64 {
    let n = case.est.input.len();
    let clean = Target { input: &case.est.input, y: &case.est.clean };
    let sigma = &case.label.sigma;
    let all = |rms: f64| (n * case.est.clean.len()) as f64 * rms * rms;
    let Some(plain) = refit(calibrated, clean, sigma, Scope::Plant, false, 8) else { return f64::NAN };
    let mut best = all(plain.rms);
    // The whole record decides only for short ones; the search over laws costs one refit each.
    let rounds = if n > LOOK { 4 } else { 6 };
    for law in Law::ALL.iter().filter(|l| !l.outside() && l.sociable() && suits(case.design.kind, **l)) {
        if best < 25.0 || n > 4000 {
            break;
        }
        let mut random = Random::for_case(Stream::Development, 0, 0);
        let source = Source::Open(case.est.input.clone());
        let Some(unit) = case.design.effect(*law, &source, &mut random) else { continue };
        let signs: &[f64] = if either_sign(*law) { &[1.0, -1.0] } else { &[1.0] };
        for sign in signs {
            let mut machine = plain.machine.clone();
            machine.effects = vec![unit.at(0.02 * sign)];
            if let Some(r) = refit(&machine, clean, sigma, Scope::Effects, false, rounds) {
                best = best.min(all(r.rms));
            }
        }
    }
    best
}

/// Laws whose strength may be negative.
fn either_sign(law: Law) -> bool {
    matches!(
        law,
        Law::Cubic
            | Law::Quintic
            | Law::QuadraticStiffness
            | Law::Bilinear
            | Law::InputPolynomial
            | Law::InputOffset
            | Law::OutputOffset
            | Law::Drift
            | Law::AbruptChange
            | Law::SensorDrift
    )
}
