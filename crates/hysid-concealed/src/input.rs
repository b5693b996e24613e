//! What drives a machine: a held command, or a prescribed motion known at every instant.

use crate::law::{Effect, Law};

/// How a command runs between its samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Hold {
    /// Constant until the next sample.
    Zero,
    /// Straight line to the next sample.
    Linear,
}

/// A motion as a sum of sines: position and velocity are exact at every instant.
#[derive(Debug, Clone, Default)]
pub struct Motion {
    /// Mean position.
    pub mean: f64,
    /// Amplitude, angular frequency in rad/s and phase of each sine.
    pub lines: Vec<(f64, f64, f64)>,
    /// Relative rise of the amplitude over the record: `1 + growth t / T`.
    pub growth: f64,
    /// Length of the record in seconds.
    pub length: f64,
}

impl Motion {
    /// Position and velocity at time `t`.
    pub fn at(&self, t: f64) -> (f64, f64) {
        let (mut q, mut v) = (0.0, 0.0);
        for &(a, w, phase) in &self.lines {
            let (s, c) = (w * t + phase).sin_cos();
            q += a * s;
            v += a * w * c;
        }
        let rate = self.growth / self.length.max(f64::MIN_POSITIVE);
        let level = 1.0 + rate * t;
        (self.mean + level * q, level * v + rate * q)
    }
}

/// The command as recorded, or the prescribed motion.
#[derive(Debug, Clone)]
pub enum Input {
    /// Samples of a command at multiples of `period`.
    Held {
        /// Samples.
        values: Vec<f64>,
        /// Sampling period in seconds.
        period: f64,
        /// Course between samples.
        hold: Hold,
    },
    /// A motion imposed on the specimen, recorded at multiples of `period`.
    Motion {
        /// The motion.
        motion: Motion,
        /// Sampling period in seconds.
        period: f64,
        /// Number of samples.
        samples: usize,
    },
}

impl Input {
    /// Sampling period in seconds.
    pub fn period(&self) -> f64 {
        match self {
            Input::Held { period, .. } | Input::Motion { period, .. } => *period,
        }
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        match self {
            Input::Held { values, .. } => values.len(),
            Input::Motion { samples, .. } => *samples,
        }
    }

    /// Whether there is no sample.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The same input with every amplitude times `factor`.
    pub fn louder(&self, factor: f64) -> Self {
        let mut out = self.clone();
        match &mut out {
            Input::Held { values, .. } => values.iter_mut().for_each(|v| *v *= factor),
            Input::Motion { motion, .. } => motion.lines.iter_mut().for_each(|l| l.0 *= factor),
        }
        out
    }
}

/// The command after effects with memory that are evaluated at the samples (Preisach and its kin); the others are evaluated
/// exactly at every instant by [`Path`].
pub fn through_hysteresis(values: &[f64], effects: &[Effect], period: f64) -> Vec<f64> {
    let mut out = values.to_vec();
    for e in effects {
        match e.law {
            Law::Preisach => out = preisach(&out, &e.p, 0.0),
            Law::AsymmetricHysteresis => out = preisach(&out, &e.p, e.p[3]),
            Law::RateDependent => out = rate_dependent(&out, &e.p, period),
            _ => {}
        }
    }
    out
}

/// Preisach's model: relays everywhere on the triangle `beta <= alpha` of thresholds within `u_max`, weight Gaussian about the diagonal with a skew
/// `bend` along it; `share` of the output is theirs. A relay of half-width `r` and centre `c` is up where the play of that half-width is above `c`
/// (Brokate and Sprekels 1996, sec. 2.4), so the centres are integrated in closed form and the half-widths are summed. A grid of relays
/// would be a staircase, which is another effect and no label would tell it.
fn preisach(u: &[f64], p: &[f64], bend: f64) -> Vec<f64> {
    const WIDTHS: usize = 80;
    let (share, u_max, spread) = (p[0], p[1], p[2]);
    // The integral of the skew from 0 to a centre.
    let up_to = |c: f64| if bend == 0.0 { c } else { (bend * c).exp_m1() / bend };
    let mut plays: Vec<(f64, f64, f64)> = (0..WIDTHS)
        .map(|i| {
            let r = (i as f64 + 0.5) / WIDTHS as f64;
            (r, (-(2.0 * r / spread).powi(2)).exp(), 0.0)
        })
        .collect();
    let total: f64 = plays.iter().map(|(r, weight, _)| weight * (up_to(1.0 - r) - up_to(r - 1.0))).sum();
    // An actuator's zero is where it rests: uneven relays that no swing reaches would be an offset and nothing else.
    u.iter()
        .map(|&value| {
            let w = value / u_max;
            let mut sum = 0.0;
            for (r, weight, play) in &mut plays {
                *play = play.min(w + *r).max(w - *r);
                sum += 2.0 * *weight * up_to(play.clamp(*r - 1.0, 1.0 - *r));
            }
            (1.0 - share) * value + share * u_max * sum / total
        })
        .collect()
}

/// Five plays whose half-width grows with the rate: `r (1 + lambda |du/dt| / rms)`.
fn rate_dependent(u: &[f64], p: &[f64], period: f64) -> Vec<f64> {
    let (share, u_max, lambda) = (p[0], p[1], p[2]);
    let rate = |k: usize| if k == 0 { 0.0 } else { (u[k] - u[k - 1]) / period };
    let rms = (u.iter().enumerate().map(|(k, _)| rate(k).powi(2)).sum::<f64>() / u.len().max(1) as f64).sqrt();
    let mut w = [0.0_f64; 5];
    (0..u.len())
        .map(|k| {
            let wider = 1.0 + lambda * rate(k).abs() / rms.max(f64::MIN_POSITIVE);
            let mut sum = 0.0;
            for (i, w) in w.iter_mut().enumerate() {
                let r = 0.12 * (i + 1) as f64 * u_max * wider;
                *w = w.min(u[k] + r).max(u[k] - r);
                sum += *w / 5.0;
            }
            (1.0 - share) * u[k] + share * sum
        })
        .collect()
}

/// The way from the command to the plant: effects without state, plays and delay, exact between samples.
#[derive(Debug, Clone)]
pub struct Path<'a> {
    effects: &'a [Effect],
    /// Play memories at the last knot, in the order of the effects.
    memory: Vec<f64>,
    /// Value and slope from the last knot on.
    value: f64,
    slope: f64,
    knot: f64,
}

impl<'a> Path<'a> {
    /// A path at rest.
    pub fn new(effects: &'a [Effect]) -> Self {
        let plays = effects.iter().map(plays).sum();
        Self { effects, memory: vec![0.0; plays], value: 0.0, slope: 0.0, knot: 0.0 }
    }

    /// Enters the interval that begins at time `t` with command `value` and slope `slope`.
    pub fn enter(&mut self, t: f64, value: f64, slope: f64) {
        (self.knot, self.value, self.slope) = (t, value, slope);
        let mut at = 0;
        for e in self.effects {
            for i in 0..plays(e) {
                let r = play(e, i).0;
                self.memory[at] = self.memory[at].min(value + r).max(value - r);
                at += 1;
            }
        }
    }

    /// What reaches the actuator at time `t` of the interval.
    pub fn at(&self, t: f64) -> f64 {
        let raw = self.value + self.slope * (t - self.knot);
        let mut u = raw;
        let mut at = 0;
        for e in self.effects {
            match e.law {
                Law::InputOffset => u += e.p[0],
                Law::DeadZone => u -= u.clamp(-e.p[0], e.p[0]),
                Law::InputSaturation => u = u.clamp(-e.p[0], e.p[0]),
                Law::InputPolynomial => u += e.p[0] * u * u + e.p[1] * u * u * u,
                Law::InputBacklash | Law::PrandtlIshlinskii => {
                    let mut sum = 0.0;
                    for i in 0..plays(e) {
                        let (r, weight) = play(e, i);
                        sum += weight * self.memory[at].min(raw + r).max(raw - r);
                        at += 1;
                    }
                    u = if e.law == Law::InputBacklash { sum } else { (1.0 - e.p[0]) * u + e.p[0] * sum };
                }
                _ => {}
            }
        }
        u
    }
}

/// Number of plays in an effect.
fn plays(e: &Effect) -> usize {
    match e.law {
        Law::InputBacklash => 1,
        Law::PrandtlIshlinskii => 5,
        _ => 0,
    }
}

/// Half-width and weight of play `i` of an effect.
fn play(e: &Effect, i: usize) -> (f64, f64) {
    match e.law {
        Law::PrandtlIshlinskii => (e.p[1 + i], e.p[6 + i]),
        _ => (e.p[0], 1.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Relays one by one, on a grid of thresholds; they begin as they are at rest, whose output is zero.
    fn relays(u: &[f64], p: &[f64], bend: f64, levels: usize) -> Vec<f64> {
        let level = |k: usize| -1.0 + 2.0 * (k as f64 + 0.5) / levels as f64;
        let mut relays = Vec::new();
        for (alpha, beta) in (0..levels).flat_map(|i| (0..=i).map(move |j| (level(i), level(j)))) {
            let centre = 0.5 * (alpha + beta);
            let weight = (-((alpha - beta) / p[2]).powi(2)).exp() * (bend * centre).exp();
            relays.push((alpha, beta, weight, if centre > 0.0 { -1.0 } else { 1.0 }));
        }
        let total: f64 = relays.iter().map(|r| r.2).sum();
        let rest: f64 = relays.iter().map(|r| r.2 * r.3).sum();
        u.iter()
            .map(|&value| {
                let w = value / p[1];
                let up = |r: &mut (f64, f64, f64, f64)| {
                    r.3 = if w >= r.0 {
                        1.0
                    } else if w <= r.1 {
                        -1.0
                    } else {
                        r.3
                    };
                    r.2 * r.3
                };
                let sum: f64 = relays.iter_mut().map(up).sum();
                (1.0 - p[0]) * value + p[0] * p[1] * (sum - rest) / total
            })
            .collect()
    }

    #[test]
    fn the_integral_is_what_relays_on_a_fine_grid_come_to() {
        let u: Vec<f64> = (0..240).map(|n| f64::from(n) / 20.0).map(|t| (2.1 * t).sin() * (0.2 + 0.11 * t)).collect();
        for (spread, bend) in [(0.6, 0.0), (0.5, 1.4), (0.8, -2.0)] {
            let p = [0.7, 1.6, spread];
            let exact = preisach(&u, &p, bend);
            let off = |levels: usize| {
                let grid = relays(&u, &p, bend, levels);
                exact.iter().zip(&grid).fold(0.0, |most: f64, (a, b)| most.max((a - b).abs()))
            };
            let (coarse, fine) = (off(50), off(200));
            assert!(fine < 0.02 && fine < 0.4 * coarse, "{spread} {bend}: {coarse}, {fine}");
        }
    }
}
