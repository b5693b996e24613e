//! What would separate two explanations: how far apart they are on this recording, and on which input they would part.
//!
//! The distance is what remains after the rival's own refit, `min over theta_B of |y_A - y_B(theta_B)|^2 / sigma^2`: below 9 the recording
//! cannot tell them apart, 25 settles it. Inputs come from a library of shapes, bands and levels; for a simulation with several inputs the
//! recorded ones are scaled instead, since prescribed motions hang together. An input louder than the recording is proposed only where no
//! other promises ample separation: a machine has stops, and what two laws say far outside of what was recorded tells nothing of which is true.
//!
//! Reference: W. G. Hunter and A. M. Reiner, Designs for discriminating between two rival models, Technometrics 7 (1965) 307-323.

pub mod astray;
pub mod fresh;
pub mod gamble;

use hysid_plant::{Drive, Simulation};
use hysid_signal::Excitation;
use rayon::prelude::*;

use crate::budget::Step;
use crate::data::DataSet;
use crate::evidence::{Whitener, norm2};
use crate::file::{AlternativeRecord, ExperimentRecord, finite};
use crate::mechanism::excited_band;
use crate::model::base::Base;
use crate::model::hypothesis::{Hypothesis, Setting};
use crate::model::{Model, Values};
use crate::refit::{LmOptions, levenberg_marquardt};
use crate::text::number;
use crate::verdict::weigh::{Contest, SETTLED, rivals_of, settled};
use fresh::{answered, started};

/// Below this two explanations cannot be told apart.
pub const SAME: f64 = 9.0;
/// More is not better: a rival's own noise model takes part of its misfit for noise, so that four times what settles it is looked for.
const AMPLE: f64 = 4.0 * SETTLED;
/// Multiples of the recorded peak, in the order in which they are tried: the second row where the first has nothing ample.
const LEVELS: [&[f64]; 2] = [&[1.0, 0.4], &[2.0]];
/// The same where the recorded inputs themselves are scaled: their own level has been recorded already.
const SCALES: [&[f64]; 2] = [&[0.6, 0.3], &[1.5, 2.0]];
/// Iterations of the rival's refit.
const ITERATIONS: usize = 5;
/// Most samples of a tried experiment.
const LONGEST: usize = 2000;

/// Squared distance of a rival's best imitation from `truth`, in units of the noise.
fn distance(document: &Simulation, values: &Values, data: &DataSet, substeps: usize, noise: &Whitener) -> Option<f64> {
    let model = Model::new(document, data, substeps).ok()?;
    let start = model.theta(values);
    let fit = levenberg_marquardt(
        &model,
        &start,
        &data.layout,
        noise,
        None,
        LmOptions { iterations: ITERATIONS, tolerance: 1e-5 },
    )?;
    Some(norm2(&noise.apply(&data.layout, &fit.residual)))
}

/// Squared distance of `rival` from `winner` on the estimation data.
fn present_separation(setting: &Setting<'_>, winner: &Hypothesis<'_>, rival: &Hypothesis<'_>) -> Option<f64> {
    let truth = winner.base.model.predict(&winner.base.fit.theta)?;
    let data = setting.data.with_outputs(truth);
    distance(rival.base.model.simulation(), &rival.base.values(), &data, setting.substeps, &winner.base.whitener)
}

/// The shape that stands for the recorded inputs themselves, scaled.
const RECORDED: &str = "the recorded inputs";

/// Steps of random height.
const STEPS: &str = "steps";

/// Steps as an amplifier makes them: within the band that the proposal states, and no sharper. Sharp ones would promise to part laws that
/// differ at frequencies which no command carries.
fn rounded(signal: &mut [f64], cycles_per_sample: f64) {
    let share = 1.0 - (-std::f64::consts::TAU * cycles_per_sample).exp();
    let mut value = 0.0;
    for x in signal {
        value += share * (*x - value);
        *x = value;
    }
}

/// An input of the library.
struct Trial {
    shape: &'static str,
    level: f64,
    band: [f64; 2],
    drive: Drive,
}

/// The inputs of the library at row `row` of the levels.
fn library(setting: &Setting<'_>, seed: u64, row: usize) -> Vec<Trial> {
    let Some(longest) = setting.data.longest() else { return Vec::new() };
    let stretch = &setting.data.stretches[longest];
    let n = stretch.len().min(LONGEST);
    let period = stretch.drive.period_s();
    let inputs = stretch.drive.inputs();
    let Some(u) = inputs.first() else { return Vec::new() };
    let mean = u.iter().sum::<f64>() / u.len() as f64;
    let peak = u.iter().map(|x| (x - mean).abs()).fold(0.0, f64::max);
    let band = excited_band(u, period);
    let mut out = Vec::new();
    let mut offer = |shape, level, band: (f64, f64), signals: Vec<Vec<f64>>| {
        if let Ok(drive) = Drive::new(stretch.start_s, period, n, signals) {
            out.push(Trial { shape, level, band: [band.0, band.1], drive });
        }
    };
    if inputs.len() > 1 || setting.original.is_static() {
        for &level in SCALES[row] {
            let scaled = inputs.iter().map(|c| c[..n].iter().map(|x| level * x).collect()).collect();
            offer(RECORDED, level, band, scaled);
        }
        return out;
    }
    // A one-sided input keeps its mean: a tank is not filled by a negative flow.
    let one_sided = u.iter().all(|x| *x >= 0.0) && mean > 0.3 * peak;
    let highest = if one_sided { mean / peak } else { f64::INFINITY };
    let nyquist = 0.5 / period;
    let (low, high) = (band.0.max(2.0 / (n as f64 * period)), band.1.min(0.4 * nyquist * 2.0));
    let middle = (low * high).sqrt();
    // Where lags and delays part; a sampled command carries no more.
    let fast = (4.0 * high).min(0.2 / period);
    let hold = ((1.0 / middle / period) as usize).clamp(2, (n / 8).max(2));
    let mut shapes: Vec<(&'static str, (f64, f64), Excitation)> = vec![
        ("multisine", (low, high), Excitation::Multisine { lowest_hz: low, highest_hz: high, period: 0 }),
        ("low multisine", (low, middle), Excitation::Multisine { lowest_hz: low, highest_hz: middle, period: 0 }),
        ("high multisine", (middle, high), Excitation::Multisine { lowest_hz: middle, highest_hz: high, period: 0 }),
        ("chirp", (low, high), Excitation::Chirp { from_hz: low, to_hz: high }),
        ("triangle", (low, low), Excitation::Triangle { frequency_hz: low.max(3.0 / (n as f64 * period)) }),
        (STEPS, (low, high), Excitation::Steps { hold }),
        ("growing sine", (low, high), Excitation::Sine { frequency_hz: middle }),
    ];
    if fast > high {
        let excitation = Excitation::Multisine { lowest_hz: high, highest_hz: fast, period: 0 };
        shapes.push(("fast multisine", (high, fast), excitation));
    }
    for (shape, range, excitation) in shapes {
        let Ok(mut signal) = excitation.signal(n, period, 1.0, seed) else { continue };
        if shape == "growing sine" {
            signal.iter_mut().enumerate().for_each(|(i, x)| *x *= i as f64 / n as f64);
        }
        if shape == STEPS {
            rounded(&mut signal, high * period);
        }
        // A level that would come down to one of the first row has been tried.
        for level in LEVELS[row].iter().filter(|_| row == 0 || highest > 1.0).map(|l| l.min(highest)) {
            offer(shape, level, range, vec![signal.iter().map(|x| mean + level * peak * x).collect()]);
        }
    }
    out
}

/// The separation of two explanations on one input: the smaller of both directions.
fn separation(setting: &Setting<'_>, a: &Base<'_>, b: &Base<'_>, trial: &Trial) -> Option<f64> {
    let (da, db) = (started(a), started(b));
    // Louder means faster, and a law that slides within a sample needs shorter steps for it.
    let substeps = if trial.level > 1.0 { 2 * setting.substeps } else { setting.substeps };
    let one = |truth: &Simulation, noise: &Whitener, rival: &Simulation, rival_values: &Values| -> Option<f64> {
        let data = answered(truth, &trial.drive, substeps)?;
        distance(rival, rival_values, &data, substeps, noise)
    };
    let forth = one(&da, &a.whitener.elsewhere(), &db, &b.values())?;
    let back = one(&db, &b.whitener.elsewhere(), &da, &a.values())?;
    Some(forth.min(back))
}

/// The shape as it stands in a sentence.
fn worded(shape: &str) -> String {
    if shape == RECORDED || shape == STEPS { shape.to_owned() } else { format!("a {shape}") }
}

/// The experiment that would separate the winner from what contradicts it; how far apart they are on this recording is told with the alternatives.
pub fn separating(
    setting: &Setting<'_>,
    contest: &Contest<'_, '_>,
    alternatives: &mut [AlternativeRecord],
    seed: u64,
    expired: &dyn Fn(f64) -> bool,
) -> Option<ExperimentRecord> {
    let Contest { pool, probability, winner, .. } = *contest;
    let mut found: Option<ExperimentRecord> = None;
    for rival in rivals_of(contest) {
        let present = present_separation(setting, &pool[winner], &pool[rival]);
        if let Some(d) = present {
            for e in &pool[rival].effects {
                let listed = alternatives.iter_mut().find(|a| a.mechanism == e.mechanism.id && a.slot == e.slot.label);
                if let Some(a) = listed {
                    a.separation = finite(d);
                }
            }
        }
        if settled(probability[winner], probability[rival], present) {
            continue;
        }
        let proposed = propose(setting, &pool[winner], &pool[rival], present, seed);
        let separable = proposed.as_ref().is_some_and(|p| p.separable);
        if separable || found.is_none() {
            found = proposed;
        }
        // Where the first cannot be told from the winner by any input, the second may be worth an experiment.
        if separable || expired(1.0) {
            break;
        }
    }
    found
}

/// The experiment that would best separate two explanations.
fn propose(
    setting: &Setting<'_>,
    a: &Hypothesis<'_>,
    b: &Hypothesis<'_>,
    present: Option<f64>,
    seed: u64,
) -> Option<ExperimentRecord> {
    let name = |h: &Hypothesis<'_>| h.effects.iter().map(|e| e.mechanism.id).collect::<Vec<_>>().join(" + ");
    let between = vec![name(a), name(b)];
    let tried = |t: &Trial| {
        let late = setting.budget.omits(Step::Experiment);
        (!late).then(|| separation(setting, &a.base, &b.base, t))
    };
    let mut best: Option<(Trial, f64)> = None;
    for row in 0..LEVELS.len() {
        let trials = library(setting, seed, row);
        // A part of the library cannot say which input is the best, nor that none would do.
        let found: Vec<Option<f64>> = trials.par_iter().map(tried).collect::<Option<_>>()?;
        for (trial, s) in trials.into_iter().zip(found) {
            if let Some(s) = s.filter(|s| s.is_finite() && best.as_ref().is_none_or(|b| *s > b.1)) {
                best = Some((trial, s));
            }
        }
        if best.as_ref().is_some_and(|b| b.1 >= AMPLE) {
            break;
        }
    }
    let (trial, expected) = best?;
    let separable = expected >= SAME;
    let duration_s = trial.drive.len() as f64 * trial.drive.period_s();
    let sensor = (!separable).then(|| match setting.original.inputs.first() {
        Some(u) => {
            format!("a second sensor: the signal between the input `{}` and the moving part, or a velocity", u.column)
        }
        None => "a second sensor".to_owned(),
    });
    let (one, other) = (between[0].replace('_', " "), between[1].replace('_', " "));
    let sentence = if separable {
        format!(
            "To tell {one} from {other}: {} at {} times the recorded peak, {} to {} Hz, {} s long; expected squared separation {} (25 settles it), {} on this recording.",
            worded(trial.shape),
            number(trial.level),
            number(trial.band[0]),
            number(trial.band[1]),
            number(duration_s),
            number(expected),
            present.map_or_else(|| "not known".to_owned(), number)
        )
    } else {
        format!(
            "No input of the library would tell {one} from {other} (expected squared separation at most {}); {}.",
            number(expected),
            sensor.as_deref().unwrap_or("a further sensor")
        )
    };
    Some(ExperimentRecord {
        sentence,
        separable,
        between,
        shape: separable.then(|| trial.shape.to_owned()),
        level: separable.then_some(trial.level),
        band_hz: separable.then_some(trial.band),
        duration_s: separable.then_some(duration_s),
        expected_separation: Some(expected),
        present_separation: present,
        sensor,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounded_steps_are_the_steps_through_a_first_order_lag() {
        let mut x = vec![1.0; 40];
        rounded(&mut x, 0.05);
        for (k, x) in x.iter().enumerate() {
            let left = (-std::f64::consts::TAU * 0.05 * (k + 1) as f64).exp();
            assert!((1.0 - x - left).abs() < 1e-12, "{k}: {x}");
        }
    }

    #[test]
    fn nothing_is_louder_than_the_recording_in_the_first_row() {
        assert!(LEVELS[0].iter().chain(SCALES[0]).all(|l| *l <= 1.0));
        assert!(LEVELS[1].iter().chain(SCALES[1]).all(|l| *l > 1.0));
    }
}
