//! Six excitations, each of unit rms.

use std::f64::consts::TAU;

use crate::input::Motion;
use crate::seed::Random;

/// The kinds of excitation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Excitation {
    /// Random-phase multisine whose level changes along the record.
    SteppedMultisine,
    /// Random-phase multisine of constant level.
    Multisine,
    /// Logarithmic sine sweep, up and down.
    Chirp,
    /// Steps of random height and length.
    Steps,
    /// Filtered noise with pauses, as in operation.
    Operational,
    /// One sine whose level changes in four stages.
    Sine,
}

impl Excitation {
    /// Every kind with its share of the bank.
    pub const SHARES: [(Excitation, f64); 6] = [
        (Excitation::SteppedMultisine, 0.35),
        (Excitation::Multisine, 0.15),
        (Excitation::Chirp, 0.15),
        (Excitation::Steps, 0.12),
        (Excitation::Operational, 0.15),
        (Excitation::Sine, 0.08),
    ];

    /// `n` samples with content between `low` and `high` Hz and rms 1.
    pub fn samples(self, random: &mut Random, n: usize, period: f64, low: f64, high: f64) -> Vec<f64> {
        let length = n as f64 * period;
        let mut u: Vec<f64> = match self {
            Excitation::SteppedMultisine | Excitation::Multisine => {
                let lines = multisine(random, low, high, length);
                let stages = stages(random, self == Excitation::SteppedMultisine);
                (0..n)
                    .map(|k| {
                        let t = k as f64 * period;
                        stage(&stages, t / length) * lines.iter().map(|(a, w, p)| a * (w * t + p).sin()).sum::<f64>()
                    })
                    .collect()
            }
            Excitation::Chirp => {
                let mut phase = random.uniform(0.0, TAU);
                (0..n)
                    .map(|k| {
                        let s = k as f64 / n as f64;
                        let up = 1.0 - (2.0 * s - 1.0).abs();
                        phase += TAU * period * low * (high / low).powf(up);
                        (0.6 + 0.8 * s) * phase.sin()
                    })
                    .collect()
            }
            Excitation::Steps => {
                let (mut value, mut until) = (0.0, 0.0);
                let mut smooth = 0.0;
                (0..n)
                    .map(|k| {
                        let t = k as f64 * period;
                        if t >= until {
                            value = random.uniform(-1.0, 1.0);
                            until = t + random.uniform(0.5, 2.5) / (low * high).sqrt();
                        }
                        // A real amplifier rounds its steps a little.
                        smooth += (value - smooth) * (1.0 - (-TAU * high * period).exp());
                        smooth
                    })
                    .collect()
            }
            Excitation::Operational => {
                let pause = (random.uniform(0.3, 0.5), random.uniform(0.08, 0.15));
                let (mut a, mut b) = (0.0, 0.0);
                let pole = (-TAU * high * 0.5 * period).exp();
                let slow = (-TAU * low * 0.5 * period).exp();
                let mut mean = 0.0;
                (0..n)
                    .map(|k| {
                        a = pole * a + (1.0 - pole) * random.normal();
                        b = pole * b + (1.0 - pole) * a;
                        mean = slow * mean + (1.0 - slow) * b;
                        let s = k as f64 / n as f64;
                        let quiet = s > pause.0 && s < pause.0 + pause.1;
                        if quiet { 0.0 } else { (b - mean) * (0.6 + 0.9 * (3.0 * s).sin().abs()) }
                    })
                    .collect()
            }
            Excitation::Sine => {
                let w = TAU * random.log_uniform(low.mul_add(2.0, 0.0).min(high), high);
                let stages = stages(random, true);
                (0..n)
                    .map(|k| {
                        let t = k as f64 * period;
                        stage(&stages, t / length) * (w * t).sin()
                    })
                    .collect()
            }
        };
        // From rest, softly.
        let ramp = (n / 100).max(1);
        for (k, v) in u.iter_mut().enumerate().take(ramp) {
            *v *= k as f64 / ramp as f64;
        }
        let rms = (u.iter().map(|v| v * v).sum::<f64>() / n as f64).sqrt().max(f64::MIN_POSITIVE);
        u.iter_mut().for_each(|v| *v /= rms);
        u
    }
}

/// A motion of unit rms with content between `low` and `high` Hz: quasi-static ramps up and down when `lines` is 1.
pub fn motion(random: &mut Random, length: f64, low: f64, high: f64, lines: usize) -> Motion {
    let mut list = Vec::new();
    let mut power = 0.0;
    for i in 0..lines {
        let f = if lines == 1 {
            random.log_uniform(low, high)
        } else {
            low * (high / low).powf((i as f64 + random.uniform(0.2, 0.8)) / lines as f64)
        };
        let a = (low / f).powf(0.5);
        power += a * a / 2.0;
        list.push((a, TAU * f, random.uniform(0.0, TAU)));
    }
    let norm = power.sqrt();
    list.iter_mut().for_each(|l| l.0 /= norm);
    Motion { mean: 0.0, lines: list, growth: random.uniform(0.0, 1.0), length }
}

/// About 30 sines on the grid of the record.
fn multisine(random: &mut Random, low: f64, high: f64, length: f64) -> Vec<(f64, f64, f64)> {
    let first = (low * length).ceil().max(1.0) as usize;
    let last = ((high * length) as usize).max(first + 3);
    let stride = ((last - first) / 30).max(1);
    (first..=last).step_by(stride).map(|i| (1.0, TAU * i as f64 / length, random.uniform(0.0, TAU))).collect()
}

fn stages(random: &mut Random, varied: bool) -> Vec<f64> {
    if !varied {
        return vec![1.0];
    }
    let mut list = vec![0.35, 0.6, 0.85, 1.1];
    random.shuffle(&mut list);
    list
}

fn stage(stages: &[f64], share: f64) -> f64 {
    let at = (share * stages.len() as f64) as usize;
    stages[at.min(stages.len() - 1)]
}
