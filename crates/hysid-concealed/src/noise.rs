//! Six kinds of measurement noise, and the converter.

use serde::{Deserialize, Serialize};

use crate::seed::Random;

/// The kinds of noise.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, PartialOrd, Ord, Hash)]
#[serde(rename_all = "snake_case")]
pub enum Noise {
    /// White Gaussian.
    White,
    /// Autoregressive, of first or second order.
    Autoregressive,
    /// An unknown force on the plant, so that the noise has the plant's colour; half the power is white sensor noise.
    Process,
    /// Power falls as 1/f.
    OneOverF,
    /// White with 1 % of samples five times as large.
    Outliers,
    /// White, then rounded to steps as large as its standard deviation.
    Quantised,
}

impl Noise {
    /// Every kind.
    pub const ALL: [Noise; 6] =
        [Noise::White, Noise::Autoregressive, Noise::Process, Noise::OneOverF, Noise::Outliers, Noise::Quantised];

    /// The kind's name.
    pub fn name(self) -> &'static str {
        match self {
            Noise::White => "white",
            Noise::Autoregressive => "autoregressive",
            Noise::Process => "process",
            Noise::OneOverF => "one_over_f",
            Noise::Outliers => "outliers",
            Noise::Quantised => "quantised",
        }
    }

    /// `n` samples of unit variance (for [`Noise::Process`], its white part before scaling).
    pub fn samples(self, random: &mut Random, n: usize) -> Vec<f64> {
        let mut x: Vec<f64> = match self {
            Noise::White | Noise::Process | Noise::Quantised => (0..n).map(|_| random.normal()).collect(),
            Noise::Outliers => (0..n).map(|_| random.normal() * if random.chance(0.01) { 5.0 } else { 1.0 }).collect(),
            Noise::Autoregressive => {
                let (a, b) = if random.chance(0.5) {
                    (random.uniform(0.5, 0.92), 0.0)
                } else {
                    let (r, w) = (random.uniform(0.7, 0.93), random.uniform(0.2, 1.5));
                    (2.0 * r * w.cos(), -r * r)
                };
                let (mut y1, mut y2) = (0.0, 0.0);
                for _ in 0..300 {
                    (y1, y2) = (a * y1 + b * y2 + random.normal(), y1);
                }
                (0..n)
                    .map(|_| {
                        (y1, y2) = (a * y1 + b * y2 + random.normal(), y1);
                        y1
                    })
                    .collect()
            }
            Noise::OneOverF => one_over_f(random, n),
        };
        let power = x.iter().map(|v| v * v).sum::<f64>() / n.max(1) as f64;
        let rms = power.sqrt().max(f64::MIN_POSITIVE);
        x.iter_mut().for_each(|v| *v /= rms);
        x
    }
}

/// First-order filters with poles a factor of four apart approximate 1/f over four decades.
fn one_over_f(random: &mut Random, n: usize) -> Vec<f64> {
    let mut states = [0.0_f64; 7];
    let step = |states: &mut [f64; 7], random: &mut Random| {
        let mut sum = 0.0;
        for (i, s) in states.iter_mut().enumerate() {
            let pole = (-0.25_f64.powi(i as i32)).exp();
            *s = pole * *s + (1.0 - pole * pole).sqrt() * random.normal();
            sum += *s;
        }
        sum
    };
    for _ in 0..2000 {
        step(&mut states, random);
    }
    (0..n).map(|_| step(&mut states, random)).collect()
}

/// Rounds to the steps of a converter with `bits` bits over `-full..full`.
pub fn convert(y: &mut [f64], bits: u32, full: f64) {
    let lsb = 2.0 * full / f64::from(1u32 << bits);
    round_to(y, lsb);
}

/// Rounds to multiples of `lsb`.
pub fn round_to(y: &mut [f64], lsb: f64) {
    y.iter_mut().for_each(|v| *v = lsb * (*v / lsb).round());
}
