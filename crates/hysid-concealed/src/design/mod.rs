//! Draws a plant with its drive, and effects of unit strength that suit it.

mod scales;
mod suits;
mod unit;

pub use scales::Scales;
pub use suits::suits;

use std::f64::consts::TAU;

use crate::body::Kind;
use crate::excite::{Excitation, motion};
use crate::input::{Hold, Input};
use crate::law::{Effect, Law};
use crate::machine::{Loop, Machine};
use crate::seed::Random;

/// A plant, how it is driven, and how long.
#[derive(Debug, Clone)]
pub struct Design {
    /// Kind of plant.
    pub kind: Kind,
    /// True parameters.
    pub theta: Vec<f64>,
    /// Number of recorded outputs.
    pub channels: usize,
    /// Sampling period in seconds.
    pub period: f64,
    /// Number of samples to estimate from.
    pub samples: usize,
    /// Kind of excitation.
    pub excitation: Excitation,
    /// Course of the command between samples.
    pub hold: Hold,
    /// Rms of the command, of the reference of a loop, or of the motion.
    pub level: f64,
    /// Mean of the command or motion.
    pub mean: f64,
    /// Band of the excitation in Hz.
    pub band: (f64, f64),
    /// Gains and limit of a position loop.
    pub gains: Option<(f64, f64, f64)>,
}

/// What drives a run: an open command (or motion), or the reference of a loop.
#[derive(Debug, Clone)]
pub enum Source {
    /// The command or motion itself.
    Open(Input),
    /// The reference of the loop.
    Reference(Vec<f64>),
}

impl Source {
    /// The same source with every amplitude times `factor` (about its mean for a positive command).
    pub fn louder(&self, factor: f64) -> Self {
        match self {
            Source::Open(input) => Source::Open(input.louder(factor)),
            Source::Reference(r) => Source::Reference(r.iter().map(|v| v * factor).collect()),
        }
    }
}

impl Design {
    /// A plant of this kind with `samples` samples.
    pub fn draw(kind: Kind, samples: usize, random: &mut Random) -> Self {
        let r = random;
        let excitation = Excitation::SHARES[r.weighted(&Excitation::SHARES.map(|s| s.1))].0;
        let mut hold = if r.chance(0.5) { Hold::Zero } else { Hold::Linear };
        let finer = r.uniform(10.0, 18.0);
        let (mut channels, mut mean, mut gains) = (1, 0.0, None);
        let (theta, level, band);
        match kind {
            Kind::Oscillator | Kind::TwoMasses | Kind::ThreeMasses => {
                let (f0, m) = (r.log_uniform(0.5, 20.0), r.log_uniform(0.5, 20.0));
                let w = TAU * f0;
                let mut list = Vec::new();
                let mut previous = m;
                for i in 0..kind.masses() {
                    let m = if i == 0 { m } else { previous * r.uniform(0.3, 0.9) };
                    let k = m * w * w * if i == 0 { 1.0 } else { r.uniform(1.5, 5.0) };
                    list.extend([m, 2.0 * r.log_uniform(0.02, 0.12) * (m * k).sqrt(), k]);
                    previous = m;
                }
                theta = list;
                channels = if kind == Kind::Oscillator || r.chance(0.4) { 1 } else { 2 };
                level = r.log_uniform(1.0, 100.0);
                band = (0.12 * f0, f0 * if kind == Kind::Oscillator { 2.5 } else { 4.0 });
            }
            Kind::Drive | Kind::ClosedDrive => {
                let (inertia, tau) = (r.log_uniform(0.01, 1.0), r.log_uniform(0.3, 2.0));
                let torque = inertia / tau * r.log_uniform(1.0, 6.0);
                theta = vec![inertia, inertia / tau, torque * r.uniform(0.2, 0.5)];
                band = (0.08 / tau, 1.2 / tau);
                hold = Hold::Zero;
                level = if kind == Kind::Drive {
                    torque
                } else {
                    let w = TAU * band.1 * 2.0;
                    gains = Some((inertia * w * w, 1.4 * inertia * w, 20.0 * torque));
                    r.uniform(0.5, 3.0)
                };
            }
            Kind::Piezo => {
                let f = r.log_uniform(100.0, 2000.0);
                theta = vec![r.log_uniform(0.5, 10.0), TAU * f, r.log_uniform(0.02, 0.15)];
                (level, band) = (r.log_uniform(1.0, 40.0), (0.01 * f, 0.4 * f));
            }
            Kind::PiezoSlow | Kind::Circuit => {
                let tau = r.log_uniform(1e-3, 0.1);
                theta = vec![r.log_uniform(0.5, 10.0), tau];
                (level, band) = (r.log_uniform(1.0, 40.0), (0.01 / tau, 0.4 / tau));
            }
            Kind::Tank => {
                let (area, tau) = (r.log_uniform(0.01, 1.0), r.log_uniform(20.0, 300.0));
                theta = vec![area, area / tau];
                (level, band) = (r.uniform(0.2, 1.0) * area / tau * 0.4, (0.05 / tau, 0.8 / tau));
                mean = 2.5 * level;
            }
            Kind::Thermal => {
                let (c, tau) = (r.log_uniform(50.0, 2000.0), r.log_uniform(30.0, 600.0));
                theta = vec![c, tau / c];
                (level, band) = (r.uniform(3.0, 15.0) * c / tau, (0.05 / tau, 0.8 / tau));
                mean = 2.5 * level;
            }
            Kind::Pendulum => {
                let (f0, inertia) = (r.log_uniform(0.3, 2.0), r.log_uniform(0.05, 2.0));
                let w = TAU * f0;
                theta = vec![inertia, 2.0 * r.log_uniform(0.04, 0.15) * inertia * w, inertia * w * w];
                (level, band) = (0.25 * inertia * w * w, (0.1 * f0, 1.8 * f0));
            }
            Kind::Wing => {
                theta = vec![r.uniform(5.0, 7.0), r.uniform(-2.0, -0.5), r.uniform(12.0, 17.0), r.uniform(0.3, 0.8)];
                let f = r.log_uniform(0.3, 3.0);
                (level, band, mean) = (r.uniform(4.0, 7.0), (f, 2.0 * f), r.uniform(8.0, 13.0));
            }
            Kind::Specimen => {
                let (q, f) = (r.log_uniform(1e-3, 3e-2), r.log_uniform(0.1, 2.0));
                let k = r.log_uniform(10.0, 1000.0) / q;
                theta = vec![r.uniform(0.3, 1.5) * k / (TAU * 3.0 * f), k, k * q * r.uniform(-0.2, 0.2)];
                (level, band) = (q, (f, 8.0 * f));
            }
        }
        Self {
            kind,
            theta,
            channels,
            period: 1.0 / (finer * band.1),
            samples,
            excitation,
            hold,
            level,
            mean,
            band,
            gains,
        }
    }

    /// Length of the estimation record in seconds.
    pub fn length(&self) -> f64 {
        self.samples as f64 * self.period
    }

    /// A fresh source of `samples` samples.
    pub fn source(&self, random: &mut Random, excitation: Excitation, samples: usize) -> Source {
        let (low, high) = self.band;
        if self.kind.prescribed() {
            let lines = if excitation == Excitation::Sine || self.kind == Kind::Wing { 1 } else { 2 + random.below(3) };
            let mut m = motion(random, samples as f64 * self.period, low, high, lines);
            m.lines.iter_mut().for_each(|l| l.0 *= self.level);
            if self.kind == Kind::Wing {
                m.growth = 0.0;
            }
            m.mean = self.mean;
            return Source::Open(Input::Motion { motion: m, period: self.period, samples });
        }
        let mut values = excitation.samples(random, samples, self.period, low, high);
        for v in &mut values {
            *v = self.mean + self.level * *v;
            if self.mean > 0.0 {
                // A pump or a heater does not take back.
                *v = v.max(0.0);
            }
        }
        if self.gains.is_some() {
            Source::Reference(values)
        } else {
            Source::Open(Input::Held { values, period: self.period, hold: self.hold })
        }
    }

    /// The machine with these effects.
    pub fn machine(&self, effects: Vec<Effect>) -> Machine {
        let n = match self.kind {
            k if k.prescribed() => 0,
            k if k.stores() => 1,
            k => 2 * k.masses(),
        };
        Machine {
            kind: self.kind,
            theta: self.theta.clone(),
            effects,
            initial: vec![0.0; n],
            channels: self.channels,
            regularised: None,
        }
    }

    /// What the simulation describes: the plant without effects, with its own fault where that is the effect.
    pub fn baseline(&self, effects: &[Effect]) -> Machine {
        let mut out = self.machine(Vec::new());
        out.regularised = effects.iter().find(|e| e.law == Law::SolverArtefact).map(|e| e.p[0]);
        out
    }

    /// The command (as recorded) and the outputs without noise; `noise` is what a controller sees added to the output.
    pub fn run(&self, machine: &Machine, source: &Source, noise: &[f64]) -> Option<(Input, Vec<Vec<f64>>)> {
        match (source, self.gains) {
            (Source::Reference(reference), Some((kp, kd, limit))) => {
                let feedback = Loop { reference, kp, kd, limit, noise, period: self.period };
                let (values, y) = machine.run_loop(&feedback).ok()?;
                Some((Input::Held { values, period: self.period, hold: Hold::Zero }, y))
            }
            (Source::Open(input), _) => Some((input.clone(), machine.run(input, None).ok()?)),
            _ => None,
        }
    }
}
