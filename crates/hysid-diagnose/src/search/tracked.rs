//! Screening along the motion that was recorded.
//!
//! What is missing in a drive without a loop moves it away from its simulation, and where a force depends on where the machine is (cogging, a stop, gravity),
//! its feature along the simulated motion is that of another motion. Where the residual is that of an unknown force (process noise), an observer
//! holds the simulation at the recording, and every mechanism is screened along that motion, by the derivative of what the observer leaves.
//!
//! Such features hold the noise of the recording itself, so that their scores flatter: they take part in no test. They say what is fitted, and where from; the
//! fits, of a simulation that runs free, decide.
//!
//! Reference: L. Ljung, System Identification: Theory for the User, 2nd ed. (1999), sec. 7.4 (the predictor as an observer).

use hysid_plant::{Expr, Hold, Input, Simulation};

use super::candidate::{Candidate, Columns, promising};
use super::screen::{Along, screen_along};
use crate::data::{DataSet, Stretch};
use crate::mechanism::Mechanism;
use crate::model::Model;
use crate::model::base::{Base, NoiseKind, Start, fit_simulation};
use crate::model::hypothesis::{Hypothesis, Setting};
use crate::refit::{LmOptions, Problem};
use crate::slot::{Slot, Target};

/// Bandwidths of the observer that are tried, in radians for each sample.
const BANDWIDTHS: [f64; 4] = [0.05, 0.1, 0.2, 0.4];
/// What an observer leaves, over what the noise model cannot predict, at which it follows the recording; over what the simulation leaves that runs free,
/// at most.
const FOLLOWS: f64 = 2.0;
const NEARER: f64 = 0.5;
/// Iterations of the fit along the recorded motion, and instants at which its equations are linearised.
const ITERATIONS: usize = 5;
const INSTANTS: usize = 8;

/// What could be missing around a hypothesis and promises most along the recorded motion, with the points of their grids there; none where the residual
/// is not that of an unknown force, or no observer brings the simulation to the recording.
pub fn along_the_recording(setting: &Setting<'_>, h: &Hypothesis<'_>) -> Vec<Candidate> {
    let base = &h.base;
    if !base.driven() {
        return Vec::new();
    }
    let observers = setting.pushed.iter().filter_map(|state| Observer::of(base, state));
    let Some(observer) = observers.min_by(|a, b| a.left.total_cmp(&b.left)) else { return Vec::new() };
    let Some(motion) = observer.motion(base) else { return Vec::new() };
    let bring = |document: &mut Simulation| observer.bring(document);
    let along = Along { motion: &motion, bring: &bring };
    // What a sensor does to a motion is seen in the noise that the observer follows.
    let moves = |_: &Mechanism, slot: &Slot| matches!(slot.target, Target::Derivatives(_));
    promising(screen_along(base, along, &setting.original, &h.effects, &motion.evidence(), &moves, Columns::Dropped))
}

/// What a sensor shows of the state that a force moves.
#[derive(Clone, Copy)]
enum Seen {
    /// The state itself: a speed, a level.
    Itself,
    /// The state whose derivative it is: a position.
    Integrated,
}

/// What holds a simulation at its recording: a force on the derivative of a state, by what the simulation lacks to an output that shows the state or its
/// integral.
struct Observer {
    state: String,
    /// The recorded output and its rate.
    inputs: [Input; 2],
    correction: Expr,
    data: DataSet,
    /// What it leaves of the output (rms).
    left: f64,
}

impl Observer {
    /// The slowest one on the derivative of this state that follows the recording.
    fn of(base: &Base<'_>, state: &str) -> Option<Self> {
        let (document, data) = (base.document(), base.model.data());
        let (output, seen, gain) = shown(base, &document, state)?;
        let series: Vec<[Vec<f64>; 2]> =
            data.stretches.iter().map(|s| rates(s, output, document.time.hold)).collect::<Option<_>>()?;
        let further = [0, 1].map(|i| series.iter().map(|pair| pair[i].clone()).collect::<Vec<_>>());
        let inputs = ["y_rec", "y_rate"].map(|name| {
            let symbol = document.fresh_symbol(name);
            Input { symbol: symbol.clone(), column: symbol }
        });
        let [recorded, rate] = [0, 1].map(|i| Expr::symbol(&inputs[i].symbol));
        let lacking = recorded - document.outputs[output].expression.clone();
        let noise = base.whitener.models[output].innovation();
        let free = data.layout.rms(&base.fit.residual)[output];
        let mut observer = Self {
            state: state.to_owned(),
            inputs,
            correction: Expr::Number(0.0),
            data: data.with_further_inputs(&further),
            left: f64::INFINITY,
        };
        for bandwidth in BANDWIDTHS {
            let w = bandwidth / data.period_s;
            observer.correction = match seen {
                Seen::Itself => Expr::Number(w / gain) * lacking.clone(),
                Seen::Integrated => {
                    let slower = rate.clone() - Expr::Number(gain) * Expr::symbol(state);
                    Expr::Number(w * w / gain) * lacking.clone() + Expr::Number(2.0 * w / gain) * slower
                }
            };
            observer.left = observer.leaves(base, output)?;
            if observer.left < (FOLLOWS * noise).min(NEARER * free) {
                return Some(observer);
            }
        }
        None
    }

    /// Writes it into a simulation.
    fn bring(&self, document: &mut Simulation) {
        document.inputs.extend(self.inputs.iter().cloned());
        if let Some(state) = document.state_mut(&self.state) {
            state.derivative = state.derivative.clone() + self.correction.clone();
        }
    }

    fn model(&self, base: &Base<'_>) -> Option<Model<'_>> {
        let mut document = base.document();
        self.bring(&mut document);
        Model::new(&document, &self.data, base.model.substeps()).ok()
    }

    fn leaves(&self, base: &Base<'_>, output: usize) -> Option<f64> {
        let model = self.model(base)?;
        let residual = model.residual(&model.theta(&base.values()))?;
        Some(self.data.layout.rms(&residual)[output])
    }

    /// The simulation along the recorded motion, with what the observer leaves as its residual.
    fn motion(&self, base: &Base<'_>) -> Option<Base<'_>> {
        let options = LmOptions::within(ITERATIONS, self.data.rows());
        fit_simulation(self.model(base)?, Start::Values(&base.values()), &[], None, 2, options, NoiseKind::Coloured)
    }
}

/// The output that shows a state or its integral and nothing else, and by how many of its units for one of theirs; where several do, the first.
fn shown(base: &Base<'_>, document: &Simulation, state: &str) -> Option<(usize, Seen, f64)> {
    let points = base.model.linearised(&base.fit.theta, INSTANTS);
    let first = points.first()?;
    let n = document.states.len();
    let own = document.states.iter().position(|s| s.name == state)?;
    // The state that follows from this one alone.
    let integrated = (0..n).find(|&i| i != own && document.states[i].derivative == Expr::symbol(state));
    (0..document.outputs.len()).find_map(|o| {
        let row = |p: &hysid_plant::Linearisation| p.c[o * n..(o + 1) * n].to_vec();
        let of = row(first);
        let constant = points.iter().all(|p| row(p) == of);
        let only = |i: usize| constant && of[i] != 0.0 && (0..n).all(|j| j == i || of[j] == 0.0);
        let as_integral = || integrated.filter(|&i| only(i)).map(|i| (o, Seen::Integrated, of[i]));
        if only(own) { Some((o, Seen::Itself, of[own])) } else { as_integral() }
    })
}

/// A recorded output and its rate as inputs; `None` where a sample is missing. Held from sample to sample, what stands for the time between two is the mean.
fn rates(stretch: &Stretch, output: usize, hold: Hold) -> Option<[Vec<f64>; 2]> {
    let y = &stretch.recorded[output];
    let last = y.len().checked_sub(1)?;
    let period_s = stretch.drive.period_s();
    let slope = |a: usize, b: usize| (y[b] - y[a]) / (period_s * (b - a).max(1) as f64);
    let pairs = (0..=last).map(|k| match hold {
        Hold::Zero => (0.5 * (y[k] + y[(k + 1).min(last)]), slope(k.min(last.saturating_sub(1)), (k + 1).min(last))),
        Hold::Linear => (y[k], slope(k.saturating_sub(1), (k + 1).min(last))),
    });
    let (values, rates): (Vec<f64>, Vec<f64>) = pairs.unzip();
    values.iter().all(|v| v.is_finite()).then_some([values, rates])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::Budget;
    use crate::model::hypothesis::{calibrated, recorded};
    use crate::oscillator::normal;
    use crate::search::screen::screen;

    /// A drive without a loop, integrated by hand, whose motor cogs.
    fn periods(amplitude: f64) -> [Option<f64>; 2] {
        let text = "[time]\nperiod_s = 0.01\n[inputs]\nu = \"torque_Nm\"\n[parameters]\nJ = { value = 0.02, min = 0.005, unit = \"kg m^2\" }\nb = { value = 0.06, min = 0.01, unit = \"N m s\" }\n\
                    [states]\nq = { derivative = \"w\", initial = 0.0, unit = \"rad\" }\nw = { derivative = \"(u - b*w)/J\", initial = 0.0, unit = \"rad/s\" }\n[outputs]\nangle_rad = \"q\"\n";
        let simulation = Simulation::parse(text, "drive.sim.toml").unwrap();
        let mut random = normal(3);
        let u: Vec<f64> = (0..3000_i32)
            .map(|i| {
                0.5 * (0.0131 * f64::from(i)).sin()
                    + 0.6 * (0.041 * f64::from(i)).cos()
                    + 0.4 * (0.097 * f64::from(i)).sin()
            })
            .collect();
        let (mut q, mut w, steps) = (0.0_f64, 0.0_f64, 20);
        let mut y = Vec::new();
        for pair in u.windows(2).chain([[u[2999]; 2].as_slice()]) {
            y.push(q + 0.02 * random());
            for i in 0..steps {
                let (dt, share) = (0.01 / f64::from(steps), (f64::from(i) + 0.5) / f64::from(steps));
                let u = pair[0] + share * (pair[1] - pair[0]);
                w += dt * (u - 0.06 * w - amplitude * (std::f64::consts::TAU * q / 1.1).sin()) / 0.02;
                q += dt * w;
            }
        }
        let data = recorded(&simulation, 0.01, [("torque_Nm", u), ("angle_rad", y)]);
        let budget = Budget::new(&|_| false);
        let (setting, none) = calibrated(simulation, &data, NoiseKind::Coloured, &budget);
        let best = |found: Vec<Candidate>| {
            found.first().filter(|c| c.mechanism.id == "cogging").map(|c| c.points[0].shapes[0].1)
        };
        let free = screen(&none.base, &setting.original, &[], &none.base.evidence(), &|_, _| true);
        [best(free), best(along_the_recording(&setting, &none))]
    }

    #[test]
    fn what_moves_a_drive_away_is_seen_along_the_recording() {
        let [free, tracked] = periods(0.1);
        assert!(tracked.is_some_and(|p| (p / 1.1 - 1.0).abs() < 0.01), "{tracked:?}");
        assert!(free.is_none_or(|p| (p / 1.1 - 1.0).abs() > 0.05), "{free:?}");
        assert_eq!(periods(0.0)[1], None);
    }
}
