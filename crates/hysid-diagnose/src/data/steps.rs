//! The steps of the converters through which outputs were recorded.

use hysid_plant::{Compiled, Simulation};
use hysid_signal::range;

use super::DataSet;
use crate::mechanism::{mean, rms};

/// Part of a step by which values on the steps may miss them.
pub const OFF_A_STEP: f64 = 0.1;
/// Rounding of fine steps in standard deviations of what is recorded, at most: that of a sensor's noise. Beyond it the recording is stairs.
const FINE: f64 = 0.06;
/// Share of the samples that are read on the same step as the one before, from which on no noise before the converter hides its steps.
const REPEATED: f64 = 0.5;
/// Levels from which on it can be seen that they lie on steps.
const LEVELS: usize = 12;
/// Period of a ripple, in steps by which its position is read, from which on it is one: what repeats with the steps is what the rounding does.
const RIPPLE: f64 = 3.0;

/// The steps on which all values lie; `None` where they lie on no steps, or these are not fine.
fn fine_steps(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut levels: Vec<f64> = values.filter(|y| y.is_finite()).collect();
    levels.sort_by(f64::total_cmp);
    let spread = rms(&levels, mean(&levels));
    levels.dedup();
    let (low, high) = range(levels.iter().copied());
    let apart: Vec<f64> = levels.windows(2).map(|w| w[1] - w[0]).collect();
    let least = apart.iter().copied().fold(f64::INFINITY, f64::min);
    // A difference is as exact as the recording is written; the mean of those of one step is more so, and the whole range even more.
    let (sum, single) = apart.iter().filter(|d| **d < 1.5 * least).fold((0.0, 0.0), |(sum, n), d| (sum + d, n + 1.0));
    let count = ((high - low) * single / sum).round();
    let q = (high - low) / count;
    let off = |y: &f64| ((y - low) / q - ((y - low) / q).round()).abs();
    let fine = levels.len() >= LEVELS && q <= 12.0_f64.sqrt() * FINE * spread;
    (count.is_finite() && fine && levels.iter().all(|y| off(y) <= OFF_A_STEP)).then_some(q)
}

impl DataSet {
    /// The steps of the fine converter on which the recorded values of an output lie.
    pub fn steps(&self, output: usize) -> Option<f64> {
        fine_steps(self.stretches.iter().flat_map(|s| s.outputs[output].iter().copied()))
    }

    /// Whether a fine converter's rounding is what noise an output has: most samples are read on the step of the one before, and a mean over some of them
    /// is no longer what was read.
    pub fn is_in_steps(&self, output: usize) -> bool {
        let pairs = || {
            self.stretches
                .iter()
                .flat_map(|s| s.outputs[output].windows(2))
                .filter(|p| p[0].is_finite() && p[1].is_finite())
        };
        let repeated = pairs().filter(|p| p[0] == p[1]).count();
        repeated as f64 > REPEATED * pairs().count() as f64 && self.steps(output).is_some()
    }

    /// The states of a simulation that fine converters read by themselves, and the shortest period over each that a ripple can have.
    pub fn read_in_steps(&self, simulation: &Simulation) -> Vec<(String, f64)> {
        let Ok(compiled) = Compiled::new(simulation) else { return Vec::new() };
        let (states, inputs) = (simulation.states.len(), simulation.inputs.len());
        let at = compiled.linearise(&compiled.theta(), &vec![0.0; states], &vec![0.0; inputs]);
        let read = |(place, row): (usize, &[f64])| {
            let mut seen = row.iter().enumerate().filter(|(_, gain)| **gain != 0.0);
            let (Some((state, gain)), None) = (seen.next(), seen.next()) else { return None };
            Some((simulation.states[state].name.clone(), RIPPLE * self.steps(place)? / gain.abs()))
        };
        at.c.chunks(states.max(1)).enumerate().filter_map(read).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::samples::{recording, simulation};
    use super::*;
    use crate::oscillator::normal;

    #[test]
    fn steps_are_seen_through_the_digits_that_a_recording_is_written_with() {
        let steps = |q: f64, digits: f64| (0..900).map(move |i| (q * f64::from(i * i % 700) * digits).round() / digits);
        let found = fine_steps(steps(0.917_33, 1e3)).unwrap();
        assert!((found / 0.917_33 - 1.0).abs() < 1e-5, "{found}");
        assert_eq!(fine_steps(steps(0.917_33, 1e3).take(8)), None, "a handful of levels");
        let mut random = normal(3);
        assert_eq!(fine_steps((0..900).map(|_| random())), None);
        assert_eq!(fine_steps(std::iter::repeat_n(1.0, 9)), None);
    }

    #[test]
    fn what_was_read_in_steps_is_compared_as_it_was_read() {
        let n = 20_000;
        let slow = |noise: f64| {
            let mut random = normal(3);
            let y = (0..n).map(|i| (40.0 * (0.012 * f64::from(i)).sin() + noise * random()).round());
            let mut simulation = simulation();
            simulation.time.clock = hysid_plant::ClockSource::Period(1e-3);
            DataSet::new(&simulation, &[recording(vec![0.0; n as usize], y.collect())], 1).unwrap()
        };
        let read = slow(0.0);
        assert!(read.is_in_steps(0) && read.own_step() == 1);
        let noisy = slow(0.6);
        assert!(!noisy.is_in_steps(0) && noisy.own_step() > 1);
    }
}
