//! The true machine: a plant with effects, run on an input.
//!
//! Dry friction has a hard sign and sticks; stops, plays, clearances and relays switch at located events. Outputs are read at the
//! samples, plant states first (displacements, then velocities), then the inner states of the effects in their order.

use crate::body::{Body, Chain, Kind, Store, body};
use crate::input::{Hold, Input, Path, through_hysteresis};
use crate::integrate::{Failed, Hybrid, Integrator};
use crate::law::{Effect, Law, Place};
use crate::seed::{Random, Stream};

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
        self.drive(&mut command, input, force)
    }

    /// The command that the loop gives, and the outputs.
    pub fn run_loop(&self, feedback: &Loop) -> Result<(Vec<f64>, Vec<Vec<f64>>), Failed> {
        let n = feedback.reference.len();
        let period = feedback.period;
        let input = Input::Held { values: vec![0.0; n], period, hold: Hold::Zero };
        let mut command = Command { values: Vec::new(), hold: Hold::Zero, period, feedback: Some(feedback.clone()) };
        let y = self.drive(&mut command, &input, None)?;
        Ok((command.values, y))
    }

    fn drive(&self, command: &mut Command, input: &Input, force: Option<&[f64]>) -> Result<Vec<Vec<f64>>, Failed> {
        let (n, period) = (input.len(), input.period());
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

/// What a discrete mode stands for.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Mode {
    /// Dry friction of a mass: -1 and 1 slide, 0 sticks.
    Friction,
    /// Piece of a piecewise law of effect `.0`.
    Piece(usize),
    /// Play in the output: -1 and 1 engaged, 0 free.
    Play(usize),
    /// Relay with hysteresis.
    Relay(usize),
    /// Content above the overflow.
    Above(usize),
}

struct Run<'a> {
    machine: &'a Machine,
    input: &'a Input,
    path: Path<'a>,
    list: Vec<Mode>,
    /// First inner state of each effect.
    at: Vec<usize>,
    /// Mass on which dry friction acts.
    rubbing: usize,
    body: Body,
    modulated: bool,
    walk: Vec<f64>,
    /// Unknown force in this interval.
    force: f64,
    scratch: Vec<f64>,
}

impl<'a> Run<'a> {
    fn new(machine: &'a Machine, input: &'a Input) -> Self {
        let plant = match body(machine.kind, &machine.theta) {
            Body::Chain(c) => 2 * c.n,
            Body::Store(_) => 1,
            _ => 0,
        };
        let mut at = Vec::new();
        let mut next = plant;
        for e in &machine.effects {
            at.push(next);
            next += e.law.states();
        }
        let mut list = Vec::new();
        let body = body(machine.kind, &machine.theta);
        let own = matches!(&body, Body::Chain(c) if c.friction > 0.0)
            && machine.regularised.is_none()
            && !machine.effects.iter().any(|e| e.law.replaces_friction());
        let rubs = machine.effects.iter().find(|e| e.law.sticks());
        if (own || rubs.is_some()) && matches!(body, Body::Chain(_)) {
            list.push(Mode::Friction);
        }
        for (i, e) in machine.effects.iter().enumerate() {
            match e.law {
                Law::GapStop | Law::Bilinear | Law::SpringClearance | Law::ImpactDamping if plant > 0 => {
                    list.push(Mode::Piece(i));
                }
                Law::OutputBacklash if plant > 0 => list.push(Mode::Play(i)),
                Law::ChatterRelay => list.push(Mode::Relay(i)),
                Law::Overflow => list.push(Mode::Above(i)),
                _ => {}
            }
        }
        let walk = machine.effects.iter().find(|e| e.law == Law::RandomWalk).map_or_else(Vec::new, |e| {
            let mut random = Random::for_case(Stream::Development, e.p[1].to_bits(), 0);
            let mut sum = 0.0;
            (0..=40)
                .map(|_| {
                    sum += random.normal() / 40.0_f64.sqrt();
                    sum
                })
                .collect()
        });
        Self {
            machine,
            input,
            path: Path::new(&machine.effects),
            list,
            at,
            rubbing: rubs.map_or(0, |e| e.dof),
            body,
            modulated: machine.effects.iter().any(|e| e.law.place() == Place::Parameter),
            walk,
            force: 0.0,
            scratch: vec![0.0; next],
        }
    }

    /// Appends the inner states at rest.
    fn rest(&self, x: &mut Vec<f64>) {
        let q0 = x.first().copied().unwrap_or(0.0);
        x.resize(self.scratch.len(), 0.0);
        let start = self.input_at(0.0);
        for (e, &at) in self.machine.effects.iter().zip(&self.at) {
            match e.law {
                Law::OutputBacklash | Law::SensorLag => x[at] = q0,
                Law::LogCreep => x[at..at + 3].fill(q0),
                Law::UnmodelledMode | Law::Viscoelastic => x[at] = self.motion(0.0, x, e.dof).0,
                Law::Fractional => {
                    let q = self.motion(0.0, x, e.dof).0;
                    x[at..at + 6].fill(q);
                }
                Law::ActuatorLag => x[at] = start,
                Law::StallLag => {
                    if let Body::Wing(w) = self.body {
                        x[at] = attached(&w, self.motion(0.0, x, 0).0);
                    }
                }
                _ => {}
            }
        }
    }

    fn input_at(&self, t: f64) -> f64 {
        match self.input {
            Input::Held { values, .. } if t <= 0.0 => values.first().copied().unwrap_or(0.0),
            _ => self.path.at(t),
        }
    }

    fn modes(&self) -> Vec<i8> {
        // A relay starts on its upper branch; every other mode starts at rest.
        self.list.iter().map(|m| if matches!(m, Mode::Relay(_)) { 1 } else { 0 }).collect()
    }

    /// Position and velocity of mass `dof`, or of the specimen.
    fn motion(&self, t: f64, x: &[f64], dof: usize) -> (f64, f64) {
        match (&self.body, self.input) {
            (Body::Chain(c), _) => (x[dof], x[c.n + dof]),
            (_, Input::Motion { motion, .. }) => motion.at(t),
            _ => (x[0], 0.0),
        }
    }

    fn modulate(&mut self, t: f64, x: &[f64]) {
        if !self.modulated {
            return;
        }
        let mut theta = self.machine.theta.clone();
        for (e, &at) in self.machine.effects.iter().zip(&self.at) {
            let factor = match e.law {
                Law::Drift => 1.0 + e.p[0] * t / e.p[1],
                Law::Heating => 1.0 - (e.p[0] * x[at]).min(0.95),
                // A sample instant: the last stage of the step that ends there still belongs to the time before.
                Law::AbruptChange => 1.0 + if t > e.p[1] + 1e-9 { e.p[0] } else { 0.0 },
                Law::Parametric => 1.0 + e.p[0] * (std::f64::consts::TAU * e.p[1] * t).sin(),
                Law::RandomWalk => {
                    let s = (t / e.p[2] * 40.0).clamp(0.0, 39.999);
                    let i = s as usize;
                    let w = self.walk[i] + (s - i as f64) * (self.walk[i + 1] - self.walk[i]);
                    (1.0 + e.p[0] * w).max(0.05)
                }
                _ => 1.0,
            };
            theta[e.theta] *= factor;
        }
        self.body = body(self.machine.kind, &theta);
    }

    /// Level of dry friction on the rubbing mass for a slide towards `side`.
    fn level(&self, side: f64, q: f64, v: f64, load: f64) -> f64 {
        let mut sum = match &self.body {
            Body::Chain(c)
                if self.machine.regularised.is_none()
                    && !self.machine.effects.iter().any(|e| e.law.replaces_friction()) =>
            {
                c.friction
            }
            _ => 0.0,
        };
        for e in &self.machine.effects {
            sum += match e.law {
                Law::Coulomb => e.p[0],
                Law::AsymmetricFriction => e.p[if side > 0.0 { 0 } else { 1 }],
                Law::Stribeck => e.p[0] + e.p[1] * (-(v / e.p[2]).powi(2)).exp(),
                Law::LoadDependent => e.p[0] * load.abs(),
                Law::PositionCoulomb => e.p[0] * (1.0 + 0.9 * (q / e.p[1]).sin()),
                _ => 0.0,
            };
        }
        sum.max(0.0)
    }

    /// Resisting force of effect `i` (a law without dry friction) on its mass, and the rates of its inner states.
    fn resist(&self, i: usize, t: f64, x: &[f64], mode: &[i8], dx: &mut [f64]) -> f64 {
        let e = &self.machine.effects[i];
        let (at, p) = (self.at[i], &e.p);
        let (q, v) = self.motion(t, x, e.dof);
        let piece = || self.piece(i, q, v, mode);
        match e.law {
            Law::Dahl => {
                dx[at] = (v - v.abs() * x[at]) / p[1];
                p[0] * x[at]
            }
            Law::LuGre => {
                // z in units of z_s; sigma_0 = F_c/z_s.
                let level = p[0] + (p[1] - p[0]) * (-(v / p[2]).powi(2)).exp();
                let rate = v - v.abs() * x[at] * p[0] / level;
                dx[at] = rate / p[3];
                p[0] * x[at] + p[4] * rate
            }
            Law::Elastoplastic => {
                // Dupont et al. 2002: no plastic slip below the breakaway share z_ba.
                let z = x[at];
                let share = if z * v <= 0.0 || z.abs() <= p[2] {
                    0.0
                } else if z.abs() >= 1.0 {
                    1.0
                } else {
                    0.5 - 0.5 * (std::f64::consts::PI * (1.0 + p[2] - 2.0 * z.abs()) / (2.0 * (1.0 - p[2]))).sin()
                };
                dx[at] = v * (1.0 - share * z.abs()) / p[1];
                p[0] * z
            }
            Law::QuadraticDamping => p[0] * v * v.abs(),
            Law::PowerLaw => p[0] * v.signum() * v.abs().powf(p[1]),
            Law::SquareRootDamping => p[0] * v.signum() * v.abs().sqrt(),
            Law::DisplacementDamping => p[0] * q * q * v,
            Law::Cubic => p[0] * q.powi(3),
            Law::Quintic => p[0] * q.powi(5),
            Law::QuadraticStiffness => p[0] * q * q,
            Law::GapStop => match piece() {
                0 => 0.0,
                side => p[0] * (q - f64::from(side) * p[1]),
            },
            Law::Bilinear => p[0] * (q - p[1]) * f64::from(piece()),
            Law::SpringClearance => {
                let k = match &self.body {
                    Body::Chain(c) => c.k[e.dof],
                    Body::Specimen(s) => s[1],
                    _ => 0.0,
                };
                match piece() {
                    0 => -k * q,
                    side => -k * f64::from(side) * p[0],
                }
            }
            Law::ImpactDamping => p[0] * v * f64::from(piece()),
            Law::BoucWen | Law::AsymmetricBoucWen | Law::Pinching | Law::Degradation => {
                let z = x[at];
                let grown = z.abs().powf(p[3]);
                let mut bend = p[2] * (v * z).signum() + 1.0 - p[2];
                if e.law == Law::AsymmetricBoucWen {
                    bend += p[4] * (z.signum() + v.signum());
                }
                let mut gain = 1.0;
                if e.law == Law::Degradation {
                    gain = (1.0 - p[4] * x[at + 1]).max(0.05);
                    dx[at + 1] = z * v / p[1];
                }
                let mut rate = v * (gain - grown * bend);
                if e.law == Law::Pinching {
                    rate *= 1.0 - p[4] * (-((z * v.signum() - p[6]) / p[5]).powi(2)).exp();
                }
                dx[at] = rate / p[1];
                p[0] * z
            }
            Law::UnmodelledMode => {
                let w = std::f64::consts::TAU * p[1];
                let pull = p[0] * (w * w * (x[at] - q) + 2.0 * p[2] * w * (x[at + 1] - v));
                dx[at] = x[at + 1];
                dx[at + 1] = -pull / p[0].max(f64::MIN_POSITIVE);
                -pull
            }
            Law::Gravity => p[0] * (q + p[1]).sin(),
            Law::Cogging => p[0] * (std::f64::consts::TAU * q / p[1] + p[2]).sin(),
            Law::Viscoelastic => {
                dx[at] = (q - x[at]) / p[1];
                p[0] * (q - x[at])
            }
            Law::Fractional => {
                let mut sum = 0.0;
                for cell in 0..6 {
                    let tau = p[1] * 0.25_f64.powi(cell as i32);
                    dx[at + cell] = (q - x[at + cell]) / tau;
                    sum += (p[1] / tau).powf(p[2]) * (q - x[at + cell]);
                }
                p[0] * sum
            }
            Law::DisplacementSpeed => p[0] * q * v.abs(),
            Law::SpeedSine => p[0] * v * (q / p[1]).sin(),
            Law::InputStiffness => p[0] * self.path.at(t).abs() * q,
            Law::ChatterRelay => {
                let up = self.list.iter().position(|m| *m == Mode::Relay(i)).map_or(1, |j| mode[j]);
                p[0] * f64::from(up)
            }
            Law::PeriodicDisturbance => -p[0] * (std::f64::consts::TAU * p[1] * t + p[2]).sin(),
            Law::Leakage => p[0] * q.max(0.0).sqrt(),
            Law::Overflow => {
                let above = self.list.iter().position(|m| *m == Mode::Above(i)).map_or(0, |j| mode[j]);
                p[0] * (q - p[1]) * f64::from(above)
            }
            // A sliding specimen: the imposed motion never rests, so that the sign is the whole law.
            law if law.sticks() && self.machine.kind.prescribed() => {
                v.signum() * self.level(v.signum(), q, v, self.load(t))
            }
            _ => 0.0,
        }
    }

    /// What presses on the rubbing surface in load-dependent friction: the drive.
    fn load(&self, t: f64) -> f64 {
        self.path.at(t)
    }

    /// The piece of a piecewise law: from the mode where there is one, else from the motion.
    fn piece(&self, i: usize, q: f64, v: f64, mode: &[i8]) -> i8 {
        match self.list.iter().position(|m| *m == Mode::Piece(i)) {
            Some(j) => mode[j],
            None => self.piece_at(i, q, v),
        }
    }

    fn piece_at(&self, i: usize, q: f64, v: f64) -> i8 {
        let e = &self.machine.effects[i];
        let sided = |g: f64| {
            if q > g {
                1
            } else if q < -g {
                -1
            } else {
                0
            }
        };
        match e.law {
            Law::GapStop => sided(e.p[1]),
            Law::SpringClearance => sided(e.p[0]),
            Law::Bilinear => i8::from(q > e.p[1]),
            _ => i8::from(q > e.p[1] && v > 0.0),
        }
    }

    fn piece_guard(&self, i: usize, piece: i8, q: f64, v: f64) -> f64 {
        let e = &self.machine.effects[i];
        let two_sided = |g: f64| match piece {
            0 => g - q.abs(),
            side => f64::from(side) * q - g,
        };
        match e.law {
            Law::GapStop => two_sided(e.p[1]),
            Law::SpringClearance => two_sided(e.p[0]),
            Law::Bilinear => (q - e.p[1]) * if piece == 1 { 1.0 } else { -1.0 },
            _ => (q - e.p[1]).min(v) * if piece == 1 { 1.0 } else { -1.0 },
        }
    }

    /// What reaches the plant, and the rates of the actuator's states.
    fn actuate(&self, t: f64, x: &[f64], v: f64, dx: &mut [f64]) -> f64 {
        let mut u = self.path.at(t);
        for (e, &at) in self.machine.effects.iter().zip(&self.at) {
            match e.law {
                Law::ActuatorLag => {
                    dx[at] = (u - x[at]) / e.p[0];
                    u = x[at];
                }
                Law::BackEmf => {
                    dx[at] = (u - e.p[0] * v - x[at]) / e.p[1];
                    u = x[at];
                }
                _ => {}
            }
        }
        u
    }

    /// Net force on each mass without dry friction, and the effective masses.
    fn forces(&self, c: &Chain, t: f64, x: &[f64], mode: &[i8], dx: &mut [f64]) -> ([f64; 3], [f64; 3]) {
        let n = c.n;
        let mut f = [0.0; 3];
        let mut m = c.m;
        f[0] = c.gain * (self.actuate(t, x, x[n], dx) + self.force);
        for j in 0..n {
            let (q, v) = (x[j], x[n + j]);
            let (before, slower) = if j == 0 { (0.0, 0.0) } else { (x[j - 1], x[n + j - 1]) };
            let link = c.c[j] * (v - slower) + c.k[j] * (q - before);
            f[j] -= link;
            if j > 0 {
                f[j - 1] += link;
            }
        }
        f[0] -= c.gravity * x[0].sin();
        if let (Some(v_s), true) = (self.machine.regularised, c.friction > 0.0) {
            f[0] -= c.friction * (x[n] / v_s).tanh();
        }
        for (i, e) in self.machine.effects.iter().enumerate() {
            if e.law == Law::PositionInertia {
                let (q, v) = (x[e.dof], x[n + e.dof]);
                m[e.dof] += e.p[0] * q * q;
                f[e.dof] -= e.p[0] * q * v * v;
            } else {
                f[e.dof] -= self.resist(i, t, x, mode, dx);
            }
        }
        (f, m)
    }

    /// The first mode's meaning is dry friction.
    fn rubs(&self) -> bool {
        self.list.first() == Some(&Mode::Friction)
    }

    /// Net force on the rubbing mass.
    fn push(&mut self, t: f64, x: &[f64], mode: &[i8]) -> f64 {
        let mut scratch = std::mem::take(&mut self.scratch);
        let f = match &self.body {
            Body::Chain(c) => self.forces(c, t, x, mode, &mut scratch).0[self.rubbing],
            _ => 0.0,
        };
        self.scratch = scratch;
        f
    }

    /// Recorded value of a channel.
    fn read(&mut self, t: f64, x: &[f64], channel: usize) -> f64 {
        let machine = self.machine;
        if machine.kind.prescribed() {
            return self.force_read(t, x);
        }
        let mut y = x[machine.kind.output_mass(channel)];
        if channel > 0 {
            return y;
        }
        for (e, &at) in machine.effects.iter().zip(&self.at) {
            match e.law {
                Law::OutputBacklash | Law::SensorLag => y = x[at],
                Law::LogCreep => y += e.p[0] * (x[at] + x[at + 1] + x[at + 2]),
                _ => {}
            }
        }
        sensor(machine, t, y)
    }

    fn force_read(&mut self, t: f64, x: &[f64]) -> f64 {
        let (q, v) = self.motion(t, x, 0);
        let mut scratch = std::mem::take(&mut self.scratch);
        self.modulate(t, x);
        let mut y = match &self.body {
            Body::Specimen(s) => s[0] * v + s[1] * q + s[2],
            Body::Wing(w) => {
                let stall = machine_state(self, Law::StallLag).map(|at| x[at]);
                let x0 = stall.unwrap_or_else(|| attached(w, q));
                w[0] * ((q - w[1]).to_radians()).sin() * (1.0 + x0.max(0.0).sqrt()).powi(2) / 4.0
            }
            _ => 0.0,
        };
        for i in 0..self.machine.effects.len() {
            y += self.resist(i, t, x, &[], &mut scratch);
        }
        self.scratch = scratch;
        sensor(self.machine, t, y)
    }
}

/// Steady attached share of the flow (Goman-Khrabrov's X_0).
fn attached(w: &[f64; 4], alpha: f64) -> f64 {
    1.0 / (1.0 + (w[3] * (alpha - w[2])).exp())
}

fn machine_state(run: &Run, law: Law) -> Option<usize> {
    run.machine.effects.iter().position(|e| e.law == law).map(|i| run.at[i])
}

/// Effects of the sensor that have no memory.
fn sensor(machine: &Machine, t: f64, mut y: f64) -> f64 {
    for e in &machine.effects {
        match e.law {
            Law::OutputOffset => y += e.p[0],
            Law::SensorDrift => y += e.p[0] * t,
            Law::OutputSaturation => y = y.clamp(-e.p[0], e.p[0]),
            Law::Rectified => y = y.abs(),
            Law::Quantisation => y = e.p[0] * (y / e.p[0]).round(),
            _ => {}
        }
    }
    y
}

impl Hybrid for Run<'_> {
    fn derivative(&mut self, t: f64, x: &[f64], mode: &[i8], dx: &mut [f64]) {
        self.modulate(t, x);
        let power;
        match self.body {
            Body::Chain(c) => {
                let n = c.n;
                let (f, m) = self.forces(&c, t, x, mode, dx);
                for j in 0..n {
                    dx[j] = x[n + j];
                    dx[n + j] = f[j] / m[j];
                }
                if self.rubs() {
                    let j = self.rubbing;
                    let (q, v) = (x[j], x[n + j]);
                    if mode[0] == 0 {
                        (dx[j], dx[n + j]) = (0.0, 0.0);
                    } else {
                        let side = f64::from(mode[0]);
                        dx[n + j] = (f[j] - side * self.level(side, q, v, self.load(t))) / m[j];
                    }
                }
                power = (c.c[0] * x[n].abs() + c.friction) * x[n].abs();
                for (e, &at) in self.machine.effects.iter().zip(&self.at) {
                    if e.law == Law::OutputBacklash {
                        let j = self.list.iter().position(|l| matches!(l, Mode::Play(_)));
                        dx[at] = if j.is_some_and(|j| mode[j] != 0) { dx[0] } else { 0.0 };
                    }
                }
            }
            Body::Store(Store { capacity, gain, loss }) => {
                let mut flow = gain * (self.actuate(t, x, 0.0, dx) + self.force) - loss * x[0];
                for i in 0..self.machine.effects.len() {
                    flow -= self.resist(i, t, x, mode, dx);
                }
                dx[0] = flow / capacity;
                power = loss * x[0] * x[0];
                for (e, &at) in self.machine.effects.iter().zip(&self.at) {
                    if e.law == Law::OutputBacklash {
                        let j = self.list.iter().position(|l| matches!(l, Mode::Play(_)));
                        dx[at] = if j.is_some_and(|j| mode[j] != 0) { dx[0] } else { 0.0 };
                    }
                }
            }
            Body::Specimen(s) => {
                let (_, v) = self.motion(t, x, 0);
                power = s[0] * v * v;
                for i in 0..self.machine.effects.len() {
                    let _ = self.resist(i, t, x, mode, dx);
                }
            }
            Body::Wing(w) => {
                let (alpha, rate) = self.motion(t, x, 0);
                power = 0.0;
                for i in 0..self.machine.effects.len() {
                    let e = &self.machine.effects[i];
                    if e.law == Law::StallLag {
                        let at = self.at[i];
                        dx[at] = (attached(&w, alpha - e.p[1] * rate) - x[at]) / e.p[0];
                    } else {
                        let _ = self.resist(i, t, x, mode, dx);
                    }
                }
            }
        }
        let q = x.first().copied().unwrap_or(0.0);
        for (e, &at) in self.machine.effects.iter().zip(&self.at) {
            match e.law {
                Law::Heating => dx[at] = (power / e.p[2] - x[at]) / e.p[1],
                Law::SensorLag => dx[at] = (q - x[at]) / e.p[0],
                Law::LogCreep => {
                    for cell in 0..3 {
                        dx[at + cell] = (q - x[at + cell]) / e.p[1 + cell];
                    }
                }
                _ => {}
            }
        }
    }

    fn guards(&mut self, t: f64, x: &[f64], mode: &[i8], guard: &mut [f64]) {
        for j in 0..self.list.len() {
            guard[j] = match self.list[j] {
                Mode::Friction => {
                    let (q, v) = self.motion(t, x, self.rubbing);
                    if mode[j] == 0 {
                        self.modulate(t, x);
                        let f = self.push(t, x, mode);
                        self.level(f.signum(), q, 0.0, self.load(t)) - f.abs()
                    } else {
                        f64::from(mode[j]) * v
                    }
                }
                Mode::Piece(i) => {
                    let (q, v) = self.motion(t, x, self.machine.effects[i].dof);
                    self.piece_guard(i, mode[j], q, v)
                }
                Mode::Relay(i) => {
                    let (q, _) = self.motion(t, x, self.machine.effects[i].dof);
                    self.machine.effects[i].p[1] + f64::from(mode[j]) * q
                }
                Mode::Above(i) => (x[0] - self.machine.effects[i].p[1]) * if mode[j] == 1 { 1.0 } else { -1.0 },
                Mode::Play(i) => {
                    let (w, r) = (x[self.at[i]], self.machine.effects[i].p[0]);
                    if mode[j] == 0 { r - (x[0] - w).abs() } else { f64::from(mode[j]) * self.speed(t, x, mode) }
                }
            };
        }
    }

    fn switch(&mut self, i: usize, t: f64, x: &mut [f64], mode: &mut [i8]) {
        match self.list[i] {
            Mode::Friction => {
                if let Body::Chain(c) = self.body {
                    x[c.n + self.rubbing] = 0.0;
                }
                let f = self.push(t, x, mode);
                let level = self.level(f.signum(), x[self.rubbing], 0.0, self.load(t));
                mode[i] = if f.abs() > level { f.signum() as i8 } else { 0 };
            }
            Mode::Piece(effect) => {
                let (q, v) = self.motion(t, x, self.machine.effects[effect].dof);
                mode[i] = self.piece_at(effect, q, v);
            }
            Mode::Relay(_) => mode[i] = -mode[i],
            Mode::Above(_) => mode[i] = 1 - mode[i],
            Mode::Play(effect) => {
                let (w, r) = (x[self.at[effect]], self.machine.effects[effect].p[0]);
                if mode[i] == 0 {
                    let side = (x[0] - w).signum();
                    mode[i] = side as i8;
                    x[self.at[effect]] = x[0] - side * r;
                } else {
                    mode[i] = 0;
                    // Held just inside the gap, so that rounding does not engage it at once.
                    let (q, inside) = (x[0], r * (1.0 - 1e-12));
                    let w = &mut x[self.at[effect]];
                    *w = w.clamp(q - inside, q + inside);
                }
            }
        }
    }
}

impl Run<'_> {
    /// Speed of the quantity that drives a play in the output.
    fn speed(&mut self, t: f64, x: &[f64], mode: &[i8]) -> f64 {
        match self.body {
            Body::Chain(c) => x[c.n],
            _ => {
                let mut dx = vec![0.0; x.len()];
                self.derivative(t, x, mode, &mut dx);
                dx[0]
            }
        }
    }
}
