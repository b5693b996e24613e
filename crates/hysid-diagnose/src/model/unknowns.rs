//! What is unknown in a model, its values by name, and where those of a motion start.

use std::collections::BTreeMap;

/// One unknown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unknown {
    /// A parameter, by its number in the simulation.
    Parameter(usize),
    /// A state's value at the first sample of a stretch.
    Initial {
        /// The stretch.
        stretch: usize,
        /// The state, by its number.
        state: usize,
    },
}

/// How many unknowns a model has.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Count {
    /// Parameters, and free initial values where a recording begins.
    pub lasting: usize,
    /// Initial values in the middle of a recording: the few samples that settle one of them grow no more with the recording.
    pub passing: usize,
}

impl Count {
    /// What is unknown here and not there.
    pub fn beyond(self, other: Self) -> Self {
        Self {
            lasting: self.lasting.saturating_sub(other.lasting),
            passing: self.passing.saturating_sub(other.passing),
        }
    }
}

/// Values by name: how the unknowns of one simulation are carried over to a rewriting of it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Values {
    /// Parameters, fixed ones included.
    pub parameters: BTreeMap<String, f64>,
    /// Initial values by (stretch, state).
    pub initials: BTreeMap<(usize, String), f64>,
}

/// Samples whose slope a velocity starts from.
const SLOPE: usize = 7;

/// The slope of the first samples, per sample: that of the straight line through them, shrunk by as much as it is uncertain (James and Stein's
/// factor), so that a noise that is larger than the motion of a few samples starts nothing.
pub fn slope(y: &[f64]) -> f64 {
    let points: Vec<(f64, f64)> =
        y.iter().take(SLOPE).enumerate().filter(|(_, v)| v.is_finite()).map(|(n, v)| (n as f64, *v)).collect();
    if points.len() < 3 {
        return 0.0;
    }
    let n = points.len() as f64;
    let mean = |f: &dyn Fn(&(f64, f64)) -> f64| points.iter().map(f).sum::<f64>() / n;
    let (t, level) = (mean(&|p| p.0), mean(&|p| p.1));
    let spread = points.iter().map(|p| (p.0 - t).powi(2)).sum::<f64>();
    let slope = points.iter().map(|p| (p.0 - t) * (p.1 - level)).sum::<f64>() / spread;
    let left = points.iter().map(|p| (p.1 - level - slope * (p.0 - t)).powi(2)).sum::<f64>();
    let variance = left / (n - 2.0) / spread;
    if slope == 0.0 { 0.0 } else { slope * (1.0 - variance / (slope * slope)).max(0.0) }
}

#[cfg(test)]
mod tests {
    use hysid_plant::Simulation;
    use hysid_signal::{Channel, Clock, Recording};

    use super::*;
    use crate::data::DataSet;
    use crate::evidence::{NoiseModel, Whitener, norm2};
    use crate::model::Model;
    use crate::oscillator::{BASELINE, PERIOD, drive, normal};
    use crate::refit::{LmOptions, Problem, levenberg_marquardt};

    /// The oscillator with a small resonator on it, which no output shows.
    fn with_a_resonator() -> Simulation {
        let text = BASELINE
            .replace("[states]", "p = { value = 0.05, min = 0.0, max = 1.0, unit = \"kg\" }\n[states]")
            .replace("- k*x)/m", "- k*x - p*(60*(x - z) + 0.5*(v - w)))/m")
            .replace("[outputs]", "z = { derivative = \"w\", initial = 0.0 }\nw = { derivative = \"60*(x - z) + 0.5*(v - w)\", initial = 0.0 }\n[outputs]");
        Simulation::parse(&text, "test.sim.toml").unwrap()
    }

    /// A recording of that, cut into windows.
    fn windows(simulation: &Simulation) -> DataSet {
        let u = drive(4000, &mut normal(5));
        let of = |y: Vec<f64>| {
            let channels =
                vec![Channel { name: "u_N".into(), samples: u.clone() }, Channel { name: "x_m".into(), samples: y }];
            let recording = Recording::new("est.csv", Clock { start_s: 0.0, period_s: PERIOD }, channels).unwrap();
            DataSet::new(simulation, &[recording], 4).unwrap()
        };
        let unanswered = of(u.clone());
        let model = Model::new(simulation, &unanswered, 4).unwrap();
        let y = model.simulate(&model.theta(&Values::default())).0.concat().concat();
        of(y).within(1600)
    }

    #[test]
    fn what_is_remembered_is_unknown_in_the_middle_of_a_recording() {
        let simulation = with_a_resonator();
        let data = windows(&simulation);
        let windows = data.stretches.len();
        assert!(windows > 2);
        let model = Model::new(&simulation, &data, 4).unwrap();
        let passing = 4 * (windows - 1);
        assert_eq!(model.count(), Count { lasting: 4, passing });
        let more = Count { lasting: 6, passing: passing + 3 };
        assert_eq!(more.beyond(model.count()), Count { lasting: 2, passing: 3 });
        // At the true parameters nothing but the starts is wrong, and a fit that may move them leaves nothing.
        let noise = Whitener::of(vec![NoiseModel::white(1.0)]);
        let start = model.theta(&Values::default());
        let left = |theta: &[f64]| norm2(&model.residual(theta).unwrap()) / norm2(&data.y);
        let fit = levenberg_marquardt(&model, &start, &data.layout, &noise, None, LmOptions::default()).unwrap();
        assert!(left(&start) > 1e-3 && left(&fit.theta) < 1e-12, "{} {}", left(&start), left(&fit.theta));
    }

    #[test]
    fn a_velocity_starts_at_the_slope_of_what_is_measured() {
        assert!((slope(&[1.0, 1.5, f64::NAN, 2.5, 3.0]) - 0.5).abs() < 1e-12);
        assert_eq!(slope(&[2.0, 2.0, 2.0, 2.0]), 0.0);
        assert_eq!(slope(&[1.0, f64::NAN, 2.0]), 0.0);
        // Noise alone: the squares of the slopes are a third of what they would be unshrunk, or less.
        let mut random = normal(7);
        let (mut shrunk, mut plain) = (0.0, 0.0);
        for _ in 0..2000 {
            let y: Vec<f64> = (0..SLOPE).map(|_| random()).collect();
            let line: f64 = y.iter().enumerate().map(|(i, v)| (i as f64 - 3.0) * v).sum::<f64>() / 28.0;
            shrunk += slope(&y).powi(2);
            plain += line * line;
            assert!(slope(&y).abs() <= line.abs() + 1e-12 && slope(&y) * line >= 0.0);
        }
        assert!(shrunk < 0.6 * plain, "{}", shrunk / plain);
    }
}
