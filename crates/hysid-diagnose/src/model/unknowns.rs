//! What is unknown in a model, its values by name, and where those of a motion start.

use std::collections::BTreeMap;

use hysid_plant::{Expr, Initial};

use super::Model;

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

impl Model<'_> {
    /// A `theta` from values by name; where there is none, the document's value, and the first measurement of an output that *is*
    /// the state, or the slope of the first ones of which it is the derivative, else zero, for an initial value.
    pub fn theta(&self, values: &Values) -> Vec<f64> {
        self.unknowns
            .iter()
            .enumerate()
            .map(|(place, u)| match u {
                Unknown::Parameter(i) => {
                    let p = &self.compiled.parameters()[*i];
                    values
                        .parameters
                        .get(&p.name)
                        .copied()
                        .unwrap_or(p.value)
                        .clamp(self.bounds[place].0, self.bounds[place].1)
                }
                Unknown::Initial { stretch, state } => {
                    let name = &self.simulation().states[*state].name;
                    values
                        .initials
                        .get(&(*stretch, name.clone()))
                        .copied()
                        .unwrap_or_else(|| self.measured_start(*stretch, name))
                }
            })
            .collect()
    }

    fn measured_start(&self, stretch: usize, state: &str) -> f64 {
        let simulation = self.simulation();
        let measured = |state: &str| {
            let is = |e: &Expr| matches!(e, Expr::Symbol(s) if s == state);
            let output = simulation.outputs.iter().position(|o| is(&o.expression))?;
            Some(self.data.stretches[stretch].outputs[output].as_slice())
        };
        if let Some(y) = measured(state) {
            return y.iter().copied().find(|v| v.is_finite()).unwrap_or(0.0);
        }
        let integral = simulation.states.iter().find(|s| matches!(&s.derivative, Expr::Symbol(v) if v == state));
        integral
            .and_then(|x| measured(&x.name))
            .map_or(0.0, |y| slope(y) / self.data.stretches[stretch].drive.period_s())
    }

    /// The values by name of a `theta`, fixed parameters included.
    pub fn values(&self, theta: &[f64]) -> Values {
        let mut values = Values::default();
        for p in self.compiled.parameters() {
            values.parameters.insert(p.name.clone(), p.value);
        }
        for (u, &x) in self.unknowns.iter().zip(theta) {
            match u {
                Unknown::Parameter(i) => {
                    values.parameters.insert(self.compiled.parameters()[*i].name.clone(), x);
                }
                Unknown::Initial { stretch, state } => {
                    values.initials.insert((*stretch, self.simulation().states[*state].name.clone()), x);
                }
            }
        }
        values
    }

    /// The parameters in the document's order; `set` overrides some by name, fixed ones too.
    pub(super) fn parameters(&self, theta: &[f64], set: &[(String, f64)]) -> Vec<f64> {
        let mut all = self.compiled.theta();
        for (name, x) in set {
            if let Some(i) = self.compiled.parameter_index(name) {
                all[i] = *x;
            }
        }
        for (u, &x) in self.unknowns.iter().zip(theta) {
            if let Unknown::Parameter(i) = u {
                all[*i] = x;
            }
        }
        all
    }

    /// The start of a stretch: free values (in order of the free states) or all states.
    pub fn start_of(&self, stretch: usize, theta: &[f64]) -> Vec<f64> {
        let mine = |state: usize| {
            self.unknowns.iter().position(|u| *u == Unknown::Initial { stretch, state }).map(|place| theta[place])
        };
        let states = &self.simulation().states;
        if self.from_document[stretch] {
            (0..states.len()).filter_map(mine).collect()
        } else {
            (0..states.len())
                .map(|s| {
                    mine(s).unwrap_or(match states[s].initial {
                        Initial::Number(x) => x,
                        _ => 0.0,
                    })
                })
                .collect()
        }
    }
}

/// Samples whose slope a velocity starts from.
const SLOPE: usize = 7;

/// The slope of the first samples, per sample: that of the straight line through them, shrunk by as much as it is uncertain (James and Stein's
/// factor), so that a noise that is larger than the motion of a few samples starts nothing.
fn slope(y: &[f64]) -> f64 {
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
