//! Lines of the residual's spectrum: where a force that follows the clock is looked for.

use crate::data::DataSet;
use crate::mechanism::{Places, Rewritten, Shape};
use crate::model::base::Base;

/// Lines that are looked at.
const LINES: usize = 4;
/// Correlation of a recorded output with itself one cycle later from which the motion repeats itself.
const REPEATS: f64 = 0.98;
/// How near to a harmonic of the motion a line stands for the motion, as a share of the distance of two frequencies that the recording tells
/// apart.
const NEAR: f64 = 0.25;

/// Frequencies of the largest peaks of the residual's spectrum, in hertz.
///
/// Where the motion repeats itself, or an input does, its harmonics are left out: a force that returns with every cycle is a law of the motion, and nothing
/// in such a recording says that it follows the clock.
pub fn residual_peaks(base: &Base<'_>) -> Vec<f64> {
    let data = base.model.data();
    let Some(longest) = data.layout.series.iter().max_by_key(|s| s.rows.len()) else { return Vec::new() };
    let (rows, stretch) = (longest.rows.len(), longest.stretch);
    let white = base.whitener.apply(&data.layout, &base.fit.residual);
    // A force need not show in all outputs.
    let outputs = || data.layout.series.iter().filter(|s| s.stretch == stretch && s.rows.len() == rows);
    let mut power = vec![0.0; rows / 2 + 1];
    for series in outputs() {
        let lines = hysid_signal::fourier(&white[series.rows.clone()]);
        power.iter_mut().zip(&lines).for_each(|(p, (re, im))| *p += re * re + im * im);
    }
    // The frequency of a line's place, in periods within the recording.
    let inputs = data.stretches[stretch].drive.inputs();
    let of_inputs = inputs.iter().filter_map(|u| cycle(&data.rows_of(longest, u)));
    let of_outputs = outputs().filter_map(|s| cycle(&data.y[s.rows.clone()]));
    let cycles: Vec<f64> = of_outputs.chain(of_inputs).map(|one| rows as f64 / one).collect();
    let of_motion = |at: f64| cycles.iter().any(|n| (at - n * (at / n).round()).abs() < NEAR);
    let mut peaks: Vec<(usize, f64)> = (2..power.len().saturating_sub(1))
        .filter(|&k| power[k] > power[k - 1] && power[k] >= power[k + 1])
        .map(|k| (k, summit(&power, k)))
        .filter(|(_, at)| !of_motion(*at))
        .collect();
    peaks.sort_by(|a, b| power[b.0].total_cmp(&power[a.0]));
    peaks.truncate(LINES);
    let width = 1.0 / (data.row_period_s() * rows as f64);
    let mut out: Vec<f64> = peaks.into_iter().map(|(_, at)| at * width).collect();
    out.sort_by(f64::total_cmp);
    out
}

/// Where a line that peaks at this place truly is, by the parabola through the logarithms.
fn summit(power: &[f64], k: usize) -> f64 {
    let (a, b, c) = (power[k - 1].max(1e-300).ln(), power[k].max(1e-300).ln(), power[k + 1].max(1e-300).ln());
    let bend = a - 2.0 * b + c;
    let shift = if bend.abs() > 1e-12 { (0.5 * (a - c) / bend).clamp(-0.5, 0.5) } else { 0.0 };
    k as f64 + shift
}

/// After how many rows a signal repeats itself, where it does within half its length.
fn cycle(y: &[f64]) -> Option<f64> {
    let n = y.len();
    let mean = y.iter().sum::<f64>() / n.max(1) as f64;
    let y: Vec<f64> = y.iter().map(|v| v - mean).collect();
    let most = n / 2;
    let products = hysid_signal::correlation(&y, &y, most);
    let mut energy = vec![0.0];
    for v in &y {
        energy.push(energy[energy.len() - 1] + v * v);
    }
    let like = |lag: usize| {
        let (head, tail) = (energy[n - lag], energy[n] - energy[lag]);
        products[lag] / (head * tail).sqrt().max(f64::MIN_POSITIVE)
    };
    let r: Vec<f64> = (0..=most).map(like).collect();
    // Beyond the first time at which it is unlike itself.
    let unlike = r.iter().position(|r| *r < 0.0)?;
    let lag = (unlike..most).find(|&lag| r[lag] > REPEATS && r[lag] >= r[lag - 1] && r[lag] > r[lag + 1])?;
    let (a, b, c) = (r[lag - 1], r[lag], r[lag + 1]);
    Some(lag as f64 + 0.5 * (a - c) / (a - 2.0 * b + c))
}

/// Lines of a recording's spectrum among which the residual itself pointed to one, for each of an effect's shapes that is such a line.
pub fn lines_of(data: &DataSet, effect: &Rewritten) -> f64 {
    let lines = |shape: &Shape| match shape.places {
        Places::Lines => (0.5 * data.rows() as f64).max(1.0),
        // As many as the longest period of the grid holds of the shortest.
        Places::Turns => {
            shape.grid.first().zip(shape.grid.last()).map_or(1.0, |(low, high)| (2.0 * high / low).max(1.0))
        }
        Places::Any | Places::Moments => 1.0,
    };
    effect.shapes.iter().map(lines).product()
}

#[cfg(test)]
mod tests {
    use hysid_plant::Simulation;

    use super::*;
    use crate::budget::Budget;
    use crate::model::base::NoiseKind;
    use crate::model::hypothesis::{calibrated, recorded};
    use crate::oscillator::{BASELINE, PERIOD, REAL, drive, normal, respond, rms};

    /// Peaks of what an oscillator under this input leaves of a sensor that runs away, so that the output does not repeat itself, with a line at this
    /// frequency in hertz.
    fn peaks(input: impl Fn(f64) -> f64, line: f64) -> Vec<f64> {
        let mut random = normal(3);
        let times: Vec<f64> = (0..1200).map(|i| f64::from(i) * PERIOD).collect();
        let u: Vec<f64> = times.iter().map(|t| input(*t)).collect();
        let y = respond(&u, REAL, |_, _| 0.0);
        let size = rms(&y);
        let run_away = |t: f64| 0.3 * t + 0.2 * (std::f64::consts::TAU * line * t).sin();
        let y = times.iter().zip(y).map(|(t, y)| y + size * (run_away(*t) + 0.02 * random())).collect();
        let original = Simulation::parse(BASELINE, "test.sim.toml").unwrap();
        let data = recorded(&original, PERIOD, [("u_N", u), ("x_m", y)]);
        assert_eq!(cycle(&data.y), None);
        let budget = Budget::new(&|_| false);
        residual_peaks(&calibrated(original, &data, NoiseKind::White(1.0), &budget).1.base)
    }

    #[test]
    fn what_returns_with_every_cycle_of_an_input_does_not_follow_the_clock() {
        let has = |found: &[f64], f: f64| found.iter().any(|p| (p - f).abs() < 0.01);
        let sine = |t: f64| (std::f64::consts::TAU * 0.8 * t).sin();
        assert!(!has(&peaks(sine, 2.4), 2.4), "the third harmonic");
        assert!(has(&peaks(sine, 2.05), 2.05), "a line beside it");
        assert!(has(&peaks(|t| sine(t * (1.0 + 0.02 * t)), 2.4), 2.4), "an input that does not repeat itself");
    }

    #[test]
    fn a_line_is_seen_in_whichever_output_it_is() {
        let original = Simulation::parse(&(BASELINE.to_owned() + "double_m = \"2*x\"\n"), "test.sim.toml").unwrap();
        let u = drive(1200, &mut normal(3));
        let motion = respond(&u, REAL, |_, _| 0.0);
        for shown in 0..2 {
            let mut random = normal(4);
            let mut read = |output: usize| -> Vec<f64> {
                let (times, share) = ([1.0, 2.0][output], if output == shown { 0.01 } else { 0.0 });
                let line = |n: usize| share * (std::f64::consts::TAU * 2.05 * PERIOD * n as f64).sin();
                let size = rms(&motion);
                let of = |(n, x): (usize, &f64)| times * x + size * (line(n) + 0.02 * random());
                motion.iter().enumerate().map(of).collect()
            };
            let (x, double) = (read(0), read(1));
            let data = recorded(&original, PERIOD, [("u_N", u.clone()), ("x_m", x), ("double_m", double)]);
            let budget = Budget::new(&|_| false);
            let peaks = residual_peaks(&calibrated(original.clone(), &data, NoiseKind::White(1.0), &budget).1.base);
            assert!(peaks.iter().any(|p| (p - 2.05).abs() < 0.01), "{shown}: {peaks:?}");
        }
    }

    #[test]
    fn the_cycle_of_a_periodic_motion_is_found() {
        let motion = |t: f64| (0.113 * t).sin() + 0.4 * (0.339 * t + 1.0).cos();
        let y: Vec<f64> = (0..700).map(|i| 2.0 + motion(f64::from(i))).collect();
        let found = cycle(&y).unwrap();
        let expected = std::f64::consts::TAU / 0.113;
        assert!((found - expected).abs() < 0.05, "{found} for {expected}");
        // A sweep does not repeat itself, and one cycle tells nothing.
        let sweep: Vec<f64> = (0..700).map(|i| (0.0004 * f64::from(i * i)).sin()).collect();
        assert_eq!(cycle(&sweep), None);
        assert_eq!(cycle(&y[..80]), None);
        assert_eq!(cycle(&[]), None);
        assert_eq!(cycle(&[1.0; 50]), None);
    }
}
