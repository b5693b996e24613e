//! The true machine: a plant with effects, run on an input.
//!
//! Dry friction has a hard sign and sticks; stops, plays, clearances and relays switch at located events. Outputs are read at the
//! samples, plant states first (displacements, then velocities), then the inner states of the effects in their order.

mod course;
mod resistance;
mod run;
mod sensing;

use self::run::Run;
use crate::body::Kind;
use crate::input::{Hold, Input, Path, through_hysteresis};
use crate::integrate::{Failed, Integrator};
use crate::law::{Effect, Law};

/// A plant with the effects that its simulation leaves out.
#[derive(Debug, Clone)]
pub struct Machine {
    /// Kind of plant.
    pub kind: Kind,
    /// True parameters of the plant, in the order of [`Kind::parameters`].
    pub theta: Vec<f64>,
    /// Effects.
    pub effects: Vec<Effect>,
    /// Initial plant states (displacements, then velocities; or the content); empty for a prescribed motion.
    pub initial: Vec<f64>,
    /// Number of outputs that are recorded.
    pub channels: usize,
    /// Dry friction as `tanh(v/v_s)` with this `v_s` in place of the hard sign: the simulation's own fault, never the machine's.
    pub regularised: Option<f64>,
}

/// A position loop: `u = kp (r - y) - kd dy/dt`, limited, computed at each sample and held.
#[derive(Debug, Clone)]
pub struct Loop<'a> {
    /// Reference at the samples.
    pub reference: &'a [f64],
    /// Proportional gain.
    pub kp: f64,
    /// Gain on the backward difference of the measurement.
    pub kd: f64,
    /// Limit of the command.
    pub limit: f64,
    /// Measurement noise that the controller sees.
    pub noise: &'a [f64],
    /// Sampling period in seconds.
    pub period: f64,
}

impl Machine {
    /// Outputs (one column for each channel) at the samples of `input`. `force` is an unknown force, held, on the driven mass (or inflow).
    pub fn run(&self, input: &Input, force: Option<&[f64]>) -> Result<Vec<Vec<f64>>, Failed> {
        self.run_for(input, input.len(), force)
    }

    /// The same for the first `samples` of the input.
    pub fn run_for(&self, input: &Input, samples: usize, force: Option<&[f64]>) -> Result<Vec<Vec<f64>>, Failed> {
        let mut command = match input {
            Input::Held { values, hold, period } => Command {
                values: through_hysteresis(values, &self.effects, *period),
                hold: *hold,
                period: *period,
                feedback: None,
            },
            Input::Motion { period, .. } => {
                Command { values: Vec::new(), hold: Hold::Linear, period: *period, feedback: None }
            }
        };
        self.drive(&mut command, input, samples, force)
    }

    /// The command that the loop gives, and the outputs.
    pub fn run_loop(&self, feedback: &Loop) -> Result<(Vec<f64>, Vec<Vec<f64>>), Failed> {
        let n = feedback.reference.len();
        let period = feedback.period;
        let input = Input::Held { values: vec![0.0; n], period, hold: Hold::Zero };
        let mut command = Command { values: Vec::new(), hold: Hold::Zero, period, feedback: Some(feedback.clone()) };
        let y = self.drive(&mut command, &input, n, None)?;
        Ok((command.values, y))
    }

    fn drive(
        &self,
        command: &mut Command,
        input: &Input,
        samples: usize,
        force: Option<&[f64]>,
    ) -> Result<Vec<Vec<f64>>, Failed> {
        let (n, period) = (samples.min(input.len()), input.period());
        let mut run = Run::new(self, input);
        let mut x = self.initial.clone();
        run.rest(&mut x);
        let mut y = vec![Vec::with_capacity(n); self.channels];
        let mut integrator = Integrator::new(x, run.modes());
        let delay = self.effects.iter().find(|e| e.law == Law::Delay).map_or(0.0, |e| e.p[0] / period);
        let whole = delay.floor();
        // Knots of the delayed command fall this far behind the samples.
        let late = (delay - whole) * period;
        let whole = whole as usize;
        for k in 0..n {
            let t = k as f64 * period;
            run.force = force.map_or(0.0, |f| f[k]);
            for (channel, column) in y.iter_mut().enumerate() {
                column.push(run.read(t, &integrator.x, channel));
            }
            if let Some(feedback) = &command.feedback {
                let measured = |i: usize| y[0][i] + feedback.noise[i];
                let rate = if k > 0 { (measured(k) - measured(k - 1)) / period } else { 0.0 };
                let u = feedback.kp * (feedback.reference[k] - measured(k)) - feedback.kd * rate;
                command.values.push(u.clamp(-feedback.limit, feedback.limit));
            }
            if k + 1 == n {
                break;
            }
            let end = (k + 1) as f64 * period;
            if late > 1e-9 * period {
                if k == 0 {
                    command.enter(&mut run.path, None, 0.0);
                }
                integrator.advance(&mut run, t, t + late)?;
                command.enter(&mut run.path, k.checked_sub(whole), t + late);
                integrator.advance(&mut run, t + late, end)?;
            } else {
                command.enter(&mut run.path, k.checked_sub(whole), t);
                integrator.advance(&mut run, t, end)?;
            }
        }
        Ok(y)
    }
}

/// The command's samples and how they are held.
struct Command<'a> {
    values: Vec<f64>,
    hold: Hold,
    period: f64,
    feedback: Option<Loop<'a>>,
}

impl Command<'_> {
    /// Enters the interval of knot `k` at time `t`; before the record the first value stands.
    fn enter(&self, path: &mut Path, k: Option<usize>, t: f64) {
        let value = |i: usize| self.values.get(i).or(self.values.last()).copied().unwrap_or(0.0);
        let slope = match (self.hold, k) {
            (Hold::Linear, Some(k)) => (value(k + 1) - value(k)) / self.period,
            _ => 0.0,
        };
        path.enter(t, value(k.unwrap_or(0)), slope);
    }
}
