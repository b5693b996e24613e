//! A machine on the way through a recording: its modes, inner states, moving parameters and what pushes its masses.

use super::Machine;
use super::sensing::attached;
use crate::body::{Body, Chain, body};
use crate::input::{Input, Path};
use crate::law::{Law, Place};
use crate::seed::{Random, Stream};

/// What a discrete mode stands for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Mode {
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

/// A machine with its drive, while it runs.
pub(super) struct Run<'a> {
    pub(super) machine: &'a Machine,
    pub(super) input: &'a Input,
    pub(super) path: Path<'a>,
    pub(super) list: Vec<Mode>,
    /// First inner state of each effect.
    pub(super) at: Vec<usize>,
    /// Mass on which dry friction acts.
    pub(super) rubbing: usize,
    pub(super) body: Body,
    modulated: bool,
    walk: Vec<f64>,
    /// Unknown force in this interval.
    pub(super) force: f64,
    pub(super) scratch: Vec<f64>,
}

impl<'a> Run<'a> {
    pub(super) fn new(machine: &'a Machine, input: &'a Input) -> Self {
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
    pub(super) fn rest(&self, x: &mut Vec<f64>) {
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

    pub(super) fn modes(&self) -> Vec<i8> {
        // A relay starts on its upper branch; a mass that moves at the start slides; every other mode starts at rest.
        let speed = match self.body {
            Body::Chain(c) => self.machine.initial.get(c.n + self.rubbing).copied().unwrap_or(0.0),
            _ => 0.0,
        };
        let side = if speed == 0.0 { 0 } else { speed.signum() as i8 };
        let at_start = |m: &Mode| match m {
            Mode::Relay(_) => 1,
            Mode::Friction => side,
            _ => 0,
        };
        self.list.iter().map(at_start).collect()
    }

    /// Position and velocity of mass `dof`, or of the specimen.
    pub(super) fn motion(&self, t: f64, x: &[f64], dof: usize) -> (f64, f64) {
        match (&self.body, self.input) {
            (Body::Chain(c), _) => (x[dof], x[c.n + dof]),
            (_, Input::Motion { motion, .. }) => motion.at(t),
            _ => (x[0], 0.0),
        }
    }

    pub(super) fn modulate(&mut self, t: f64, x: &[f64]) {
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

    /// What reaches the plant, and the rates of the actuator's states.
    pub(super) fn actuate(&self, t: f64, x: &[f64], v: f64, dx: &mut [f64]) -> f64 {
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
    pub(super) fn forces(&self, c: &Chain, t: f64, x: &[f64], mode: &[i8], dx: &mut [f64]) -> ([f64; 3], [f64; 3]) {
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
    pub(super) fn rubs(&self) -> bool {
        self.list.first() == Some(&Mode::Friction)
    }

    /// Net force on the rubbing mass.
    pub(super) fn push(&mut self, t: f64, x: &[f64], mode: &[i8]) -> f64 {
        let mut scratch = std::mem::take(&mut self.scratch);
        let f = match &self.body {
            Body::Chain(c) => self.forces(c, t, x, mode, &mut scratch).0[self.rubbing],
            _ => 0.0,
        };
        self.scratch = scratch;
        f
    }
}
