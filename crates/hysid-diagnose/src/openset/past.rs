//! What was before: what lags leave of a coordinate, and the coordinate as it was some time ago.

use super::shapes::{Kind, Shape, free, in_turn, sorted};
use crate::data::{DataSet, Stretch};

/// Time constants of lags, as parts of the longest stretch.
const LAGS: [f64; 3] = [300.0, 60.0, 12.0];

/// What first-order lags of a coordinate leave of it: time constants of the length of the recording.
pub fn lags(name: &str, x: &[Vec<f64>], data: &DataSet) -> Vec<Shape> {
    let longest = data.stretches.iter().map(|s| s.len() as f64 * s.drive.period_s()).fold(0.0, f64::max);
    LAGS.map(|part| {
        let tau = longest / part;
        // Exact where the coordinate is linear between samples.
        let behind = |(samples, stretch): (&Vec<f64>, &Stretch)| {
            let period_s = stretch.drive.period_s();
            let (a, ratio) = ((-period_s / tau).exp(), tau / period_s);
            let next = |(before, behind): &mut (f64, f64), v: f64| {
                let settled = (v - *before) * ratio;
                *behind = settled + a * (*behind - settled);
                *before = v;
                *behind
            };
            in_turn(std::slice::from_ref(samples), |first| (first, 0.0), next).concat()
        };
        let left = x.iter().zip(&data.stretches).map(behind).collect();
        Shape::new(format!("{name} - lag({name}, {})", free(tau)), Kind::Lag, left)
    })
    .into()
}

/// Delays of a coordinate over the mean period of its motion: as finely as it tells them apart, and over a few periods.
const ECHOES: (usize, f64) = (16, 1.0 / 6.0);

/// A coordinate as it was some time ago, as a tool feels the cut of the turn before and a controller what came late over a network.
pub fn echoes(name: &str, x: &[Vec<f64>], data: &DataSet) -> Vec<Shape> {
    let samples = x.iter().map(Vec::len).sum::<usize>();
    let middle = sorted(x, |v| v).get(samples / 2).copied().unwrap_or(0.0);
    let crosses = |s: &Vec<f64>| s.windows(2).filter(|w| (w[0] > middle) != (w[1] > middle)).count();
    let crossings: usize = x.iter().map(crosses).sum();
    let step = ECHOES.1 * 2.0 * samples as f64 / crossings.max(1) as f64;
    let mut delays: Vec<usize> = (1..=ECHOES.0).map(|i| (step * i as f64).round() as usize).collect();
    delays.retain(|d| *d > 0 && 4 * d < samples);
    delays.dedup();
    let Some(period_s) = data.stretches.first().map(|s| s.drive.period_s()) else { return Vec::new() };
    let late = |d: usize| {
        let of = |s: &Vec<f64>| (0..s.len()).map(|n| s[n.saturating_sub(d)]).collect();
        Shape::new(format!("delay({name}, {})", free(d as f64 * period_s)), Kind::Lag, x.iter().map(of).collect())
    };
    delays.into_iter().map(late).collect()
}
