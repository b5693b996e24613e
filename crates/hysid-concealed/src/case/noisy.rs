//! Recordings of the true machine: a clean run, and the noise on it.

use super::Record;
use crate::design::{Design, Source};
use crate::input::Input;
use crate::machine::Machine;
use crate::noise::{Noise, round_to};
use crate::seed::Random;
use crate::strength::{Tuned, spread};

/// A run of the true machine on a fresh source.
pub(super) fn record(
    design: &Design,
    machine: &Machine,
    source: &Source,
    noise: &[f64],
    tuned: &Tuned,
) -> Option<Record> {
    let seen: Vec<f64> = noise.iter().map(|v| v * tuned.sigma[0]).collect();
    let (input, clean) = design.run(machine, source, &seen)?;
    clean.iter().flatten().all(|v| v.is_finite()).then(|| Record { input, y: clean.clone(), clean })
}

/// Adds noise of standard deviation `sigma`; what a controller has seen is what is recorded.
pub(super) fn add_noise(
    record: &mut Record,
    machine: &Machine,
    kind: Noise,
    sigma: &[f64],
    seen: Option<&Vec<f64>>,
    random: &mut Random,
) -> Option<()> {
    let n = record.input.len();
    let process = kind == Noise::Process && seen.is_none() && matches!(record.input, Input::Held { .. });
    if process {
        // The unknown force is scaled so that it makes half of the noise power on the first output.
        let force = Noise::Autoregressive.samples(random, n);
        let mut size = 0.01 * spread_of_input(&record.input);
        for _ in 0..4 {
            let scaled: Vec<f64> = force.iter().map(|f| f * size).collect();
            let y = machine.run(&record.input, Some(&scaled)).ok()?;
            let off: Vec<f64> = y[0].iter().zip(&record.clean[0]).map(|(a, b)| a - b).collect();
            let rms = (off.iter().map(|v| v * v).sum::<f64>() / n as f64).sqrt();
            record.y = y;
            let ratio = sigma[0] * 0.5_f64.sqrt() / rms.max(f64::MIN_POSITIVE);
            if (ratio - 1.0).abs() < 0.03 {
                break;
            }
            size *= ratio;
        }
    }
    let share = if process { 0.5_f64.sqrt() } else { 1.0 };
    for (channel, (column, s)) in record.y.iter_mut().zip(sigma).enumerate() {
        let fresh;
        let e = match (seen, channel) {
            (Some(seen), 0) => seen,
            _ => {
                fresh = kind.samples(random, n);
                &fresh
            }
        };
        for (v, e) in column.iter_mut().zip(e) {
            *v += share * s * e;
        }
        if kind == Noise::Quantised {
            round_to(column, *s);
        }
    }
    Some(())
}

fn spread_of_input(input: &Input) -> f64 {
    match input {
        Input::Held { values, .. } => spread(values),
        Input::Motion { .. } => 1.0,
    }
}
