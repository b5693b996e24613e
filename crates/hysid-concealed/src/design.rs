//! Draws a plant with its drive, and effects of unit strength that suit it.

use std::f64::consts::{PI, TAU};

use crate::body::Kind;
use crate::excite::{Excitation, motion};
use crate::input::{Hold, Input};
use crate::law::{Effect, Law, Place};
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

/// Sizes of the undisturbed plant's motion, from which effects take their units.
#[derive(Debug, Clone, Copy)]
pub struct Scales {
    q: f64,
    q_max: f64,
    v: f64,
    f: f64,
    u: f64,
    u_max: f64,
    y: f64,
    y_max: f64,
    length: f64,
    period: f64,
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

    /// Sizes of the undisturbed motion of the mass that output `channel` reads.
    pub fn scales(&self, source: &Source, dof: usize) -> Option<Scales> {
        let mut plain = self.machine(Vec::new());
        plain.channels = self.kind.outputs().len();
        let quiet = vec![0.0; self.samples];
        let (input, y) = self.run(&plain, source, &quiet)?;
        let channel = (0..plain.channels).find(|&c| self.kind.output_mass(c) == dof)?;
        let y = &y[channel];
        let rms = |x: &[f64]| (x.iter().map(|v| v * v).sum::<f64>() / x.len().max(1) as f64).sqrt();
        let most = |x: &[f64]| x.iter().fold(0.0_f64, |a, v| a.max(v.abs()));
        let rate = |x: &[f64]| -> Vec<f64> { x.windows(2).map(|w| (w[1] - w[0]) / self.period).collect() };
        let (q, v, u, f) = match &input {
            Input::Held { values, .. } => (y.clone(), rate(y), values.clone(), rms(values) * self.gain()),
            Input::Motion { motion, .. } => {
                let (q, v): (Vec<f64>, Vec<f64>) = (0..self.samples).map(|k| motion.at(k as f64 * self.period)).unzip();
                (q.clone(), v, q, rms(y))
            }
        };
        Some(Scales {
            q: rms(&q),
            q_max: most(&q),
            v: rms(&v),
            f,
            u: rms(&u),
            u_max: most(&u),
            y: rms(y),
            y_max: most(y),
            length: self.length(),
            period: self.period,
        })
    }

    /// Force (or flow) per unit of command.
    fn gain(&self) -> f64 {
        match self.kind {
            Kind::Piezo => self.theta[1].powi(2) * self.theta[0],
            Kind::PiezoSlow | Kind::Circuit => self.theta[0],
            _ => 1.0,
        }
    }

    /// An effect of unit strength of this law, or `None` where it would mean nothing.
    pub fn effect(&self, law: Law, source: &Source, random: &mut Random) -> Option<Effect> {
        let dof = match self.kind {
            Kind::TwoMasses if law.place() == Place::Plant => random.below(2),
            Kind::ThreeMasses if law.place() == Place::Plant => 2 * random.below(2),
            _ => 0,
        };
        let s = self.scales(source, dof)?;
        let r = random;
        let force = s.f;
        let drive = matches!(self.kind, Kind::Drive | Kind::ClosedDrive);
        let mut theta = 0;
        let mut scaled = None;
        let p = match law {
            Law::Coulomb | Law::QuadraticDamping | Law::Cubic | Law::Quintic | Law::QuadraticStiffness => {
                let unit = match law {
                    Law::Coulomb => 1.0,
                    Law::QuadraticDamping => s.v.powi(2),
                    Law::Cubic => s.q.powi(3),
                    Law::Quintic => s.q.powi(5),
                    _ => s.q.powi(2),
                };
                vec![force / unit]
            }
            Law::AsymmetricFriction => {
                let share = r.uniform(0.2, 0.6);
                if drive {
                    // The baseline has the mean; what is left out is the difference.
                    vec![force * share, -force * share]
                } else {
                    vec![force, force * share]
                }
            }
            Law::Stribeck => {
                vec![if drive { 0.0 } else { force }, force * r.uniform(0.4, 1.2), s.v * r.log_uniform(0.08, 0.4)]
            }
            Law::LoadDependent => vec![force / s.u],
            Law::Dahl | Law::LuGre | Law::Elastoplastic => {
                let size = if drive { self.theta[2] } else { force };
                let z = s.q * if drive { 1.0 } else { r.log_uniform(0.03, 0.2) };
                if drive {
                    scaled = Some(match law {
                        Law::LuGre => vec![3],
                        _ => vec![1],
                    });
                }
                match law {
                    Law::Dahl => vec![size, z],
                    Law::Elastoplastic => vec![size, z, r.uniform(0.5, 0.8)],
                    _ => vec![size, size * r.uniform(1.1, 1.5), s.v * r.uniform(0.1, 0.3), z, 0.05 * size / s.v],
                }
            }
            Law::PowerLaw => {
                let p = r.pick(&[0.4, 0.6, 1.6, 2.5, 3.0]);
                vec![force / s.v.powf(p), p]
            }
            Law::SquareRootDamping => vec![force / s.v.sqrt()],
            Law::DisplacementDamping => vec![force / (s.q.powi(2) * s.v)],
            Law::GapStop => vec![3.0 * force / s.q, s.q_max * r.uniform(0.45, 0.75)],
            Law::Bilinear => vec![force / s.q, s.q * r.uniform(-0.3, 0.6)],
            Law::SpringClearance => vec![s.q],
            Law::BoucWen => vec![force, s.q * r.log_uniform(0.3, 1.5), r.uniform(0.3, 0.7), r.pick(&[1.0, 2.0])],
            Law::AsymmetricBoucWen => {
                vec![force, s.q * r.log_uniform(0.3, 1.2), r.uniform(0.5, 0.8), 1.0, r.uniform(0.1, 0.25) * r.sign()]
            }
            Law::Pinching => vec![
                force,
                s.q * r.uniform(0.2, 0.6),
                r.uniform(0.5, 0.8),
                1.0,
                r.uniform(0.7, 0.95),
                r.uniform(0.15, 0.35),
                r.uniform(0.0, 0.2),
            ],
            Law::Degradation => {
                let cycles = s.v * s.length / s.q;
                vec![force, s.q * r.uniform(0.3, 1.0), r.uniform(0.5, 0.8), 1.0, r.uniform(0.6, 1.2) / (0.3 * cycles)]
            }
            Law::InputBacklash => vec![s.u],
            Law::OutputBacklash => vec![s.q],
            Law::PrandtlIshlinskii => {
                let mut p = vec![1.0];
                p.extend((1..=5).map(|i| s.u_max * 0.16 * f64::from(i)));
                let weights: Vec<f64> = (0..5).map(|_| r.uniform(0.2, 1.0)).collect();
                let sum: f64 = weights.iter().sum();
                p.extend(weights.iter().map(|w| w / sum));
                p
            }
            Law::Preisach => vec![1.0, s.u_max * 1.3, r.uniform(0.4, 0.9)],
            Law::AsymmetricHysteresis => vec![1.0, s.u_max * 1.3, r.uniform(0.4, 0.8), r.uniform(1.0, 2.0) * r.sign()],
            Law::RateDependent => vec![1.0, s.u_max, r.uniform(0.4, 1.2)],
            Law::DeadZone => vec![s.u],
            Law::InputSaturation => vec![s.u_max],
            Law::OutputSaturation => vec![s.y_max],
            Law::InputPolynomial => {
                let (b2, b3) = r.pick(&[(1.0, 0.0), (0.0, 1.0), (0.0, -0.4), (0.7, 0.5)]);
                vec![b2 / s.u, b3 / (s.u * s.u)]
            }
            Law::Delay => vec![8.0 * s.period],
            Law::ActuatorLag | Law::SensorLag => vec![8.0 * s.period],
            Law::Drift | Law::Heating | Law::AbruptChange | Law::RandomWalk | Law::Parametric => {
                theta = self.varying(law, r);
                match law {
                    Law::Drift => vec![r.sign(), s.length],
                    Law::Heating => vec![1.0, s.length * r.log_uniform(0.05, 0.4), self.power(&s)],
                    Law::AbruptChange => {
                        let at = (r.uniform(0.3, 0.7) * self.samples as f64).floor();
                        vec![r.sign(), at * s.period]
                    }
                    Law::RandomWalk => vec![1.0, 1.0 + r.below(1 << 20) as f64, s.length],
                    _ => vec![1.0, s.v / s.q / TAU * r.uniform(0.15, 0.6)],
                }
            }
            Law::UnmodelledMode => {
                let mass = match self.kind {
                    Kind::TwoMasses | Kind::ThreeMasses => self.theta[3 * dof],
                    _ => self.theta[0],
                };
                vec![mass, self.band.1 * r.uniform(0.3, 0.9), r.log_uniform(0.01, 0.1)]
            }
            Law::InputOffset => vec![s.u * r.sign()],
            Law::OutputOffset => vec![s.y * r.sign()],
            Law::Gravity if s.q_max > 0.8 => vec![force, 0.0],
            Law::Cogging => vec![force, s.q_max * r.uniform(0.25, 0.7), r.uniform(0.0, TAU)],
            Law::PositionInertia => vec![self.theta[0] / (s.q * s.q)],
            Law::Viscoelastic => vec![force / s.q, r.log_uniform(0.3, 3.0) * s.q / s.v],
            Law::LogCreep => {
                let fast = s.length / 300.0;
                vec![0.2, fast, 8.0 * fast, 64.0 * fast]
            }
            Law::Quantisation => vec![s.y],
            Law::Rectified => Vec::new(),
            Law::SensorDrift => vec![s.y / s.length * r.sign()],
            Law::BackEmf => vec![self.theta[1] * 2.0, 8.0 * s.period],
            Law::Leakage => vec![force / s.q.sqrt()],
            Law::Overflow => vec![5.0 * force / s.q, s.q_max * r.uniform(0.75, 0.9)],
            Law::StallLag => vec![0.5 / (TAU * self.band.0), 0.7 / (TAU * self.band.0)],
            Law::PeriodicDisturbance => vec![force, r.log_uniform(self.band.0 * 1.5, self.band.1), r.uniform(0.0, TAU)],
            Law::SolverArtefact => vec![s.v],
            Law::DisplacementSpeed => vec![force / (s.q * s.v)],
            Law::SpeedSine => vec![force / s.v, s.q * r.uniform(0.4, 0.8)],
            Law::ImpactDamping => vec![5.0 * force / s.v, s.q * r.uniform(0.3, 0.8)],
            Law::PositionCoulomb => vec![force, s.q * r.uniform(0.3, 0.7)],
            Law::Fractional => vec![force / s.q, 3.0 * s.q / s.v, r.uniform(0.3, 0.6)],
            Law::InputStiffness => vec![force / (s.u * s.q)],
            Law::ChatterRelay => vec![force, s.q * r.uniform(0.3, 0.8)],
            _ => return None,
        };
        if p.iter().any(|v| !v.is_finite()) || (PI * s.q).abs() < f64::MIN_POSITIVE {
            return None;
        }
        let mut effect = Effect::new(law, p);
        effect.dof = dof;
        effect.theta = theta;
        if let Some(scaled) = scaled {
            effect.scaled = scaled;
        }
        Some(effect)
    }

    /// Which parameter an effect in time changes.
    fn varying(&self, law: Law, random: &mut Random) -> usize {
        match (self.kind, law) {
            (_, Law::Heating) if self.kind.prescribed() => 0,
            (Kind::Oscillator | Kind::TwoMasses | Kind::ThreeMasses | Kind::Pendulum, Law::Heating) => 1,
            (Kind::Oscillator | Kind::TwoMasses | Kind::ThreeMasses, Law::Parametric) => 2,
            (Kind::Pendulum, Law::Parametric) => 2,
            (Kind::Oscillator | Kind::TwoMasses | Kind::ThreeMasses | Kind::Pendulum, _) => 1 + random.below(2),
            (Kind::Drive | Kind::ClosedDrive, _) => 1 + random.below(2),
            (Kind::Specimen, _) => random.below(2),
            (Kind::Tank | Kind::Thermal, _) => 1,
            _ => 0,
        }
    }

    /// Power of dissipation at the rms motion.
    fn power(&self, s: &Scales) -> f64 {
        match self.kind {
            Kind::Drive | Kind::ClosedDrive => (self.theta[1] * s.v + self.theta[2]) * s.v,
            Kind::Specimen => self.theta[0] * s.v * s.v,
            Kind::Oscillator | Kind::TwoMasses | Kind::ThreeMasses | Kind::Pendulum => self.theta[1] * s.v * s.v,
            _ => 1.0,
        }
    }
}

/// The laws that mean something on a kind of plant.
pub fn suits(kind: Kind, law: Law) -> bool {
    use Law::{
        AbruptChange, ActuatorLag, AsymmetricBoucWen, AsymmetricFriction, AsymmetricHysteresis, BackEmf, Bilinear,
        BoucWen, ChatterRelay, Cogging, Coulomb, Cubic, Dahl, DeadZone, Degradation, Delay, DisplacementDamping,
        DisplacementSpeed, Drift, Elastoplastic, Fractional, GapStop, Gravity, Heating, ImpactDamping, InputBacklash,
        InputOffset, InputPolynomial, InputSaturation, InputStiffness, Leakage, LoadDependent, LogCreep, LuGre,
        OutputBacklash, OutputOffset, OutputSaturation, Overflow, Parametric, PeriodicDisturbance, Pinching,
        PositionCoulomb, PositionInertia, PowerLaw, PrandtlIshlinskii, Preisach, QuadraticDamping, QuadraticStiffness,
        Quantisation, Quintic, RandomWalk, RateDependent, Rectified, SensorDrift, SensorLag, SolverArtefact, SpeedSine,
        SpringClearance, SquareRootDamping, StallLag, Stribeck, UnmodelledMode, Viscoelastic,
    };
    let restoring = [Cubic, Quintic, GapStop, QuadraticStiffness, Bilinear, SpringClearance, Cogging, Viscoelastic];
    let memory = [BoucWen, AsymmetricBoucWen, Pinching, Degradation, Dahl, LuGre, Elastoplastic];
    let damping =
        [Coulomb, AsymmetricFriction, Stribeck, LoadDependent, QuadraticDamping, PowerLaw, DisplacementDamping];
    let command = [DeadZone, InputSaturation, InputPolynomial, Delay, ActuatorLag, InputOffset];
    let sensor = [OutputSaturation, Quantisation, SensorDrift];
    let time = [Drift, AbruptChange, PeriodicDisturbance];
    let strange = [
        DisplacementSpeed,
        SpeedSine,
        ImpactDamping,
        PositionCoulomb,
        Fractional,
        SquareRootDamping,
        InputStiffness,
        ChatterRelay,
        RandomWalk,
        Parametric,
    ];
    let any = |lists: &[&[Law]]| lists.iter().any(|l| l.contains(&law));
    match kind {
        Kind::Oscillator => any(&[
            &restoring,
            &memory,
            &damping,
            &command,
            &sensor,
            &time,
            &strange,
            &[Heating, OutputBacklash, SensorLag, UnmodelledMode, OutputOffset, PositionInertia, Rectified],
        ]),
        Kind::TwoMasses | Kind::ThreeMasses => any(&[
            &[
                Coulomb,
                Dahl,
                QuadraticDamping,
                Cubic,
                GapStop,
                QuadraticStiffness,
                BoucWen,
                Viscoelastic,
                UnmodelledMode,
            ],
            &command,
            &time,
            &[DisplacementSpeed, ImpactDamping, SpeedSine],
        ]),
        Kind::Drive => any(&[
            &[
                AsymmetricFriction,
                Stribeck,
                Dahl,
                LuGre,
                Elastoplastic,
                QuadraticDamping,
                InputBacklash,
                OutputBacklash,
            ],
            &[Gravity, Cogging, PositionInertia, BackEmf, SolverArtefact, Heating, UnmodelledMode, SensorLag],
            &command,
            &time,
            &[OutputSaturation, Quantisation],
            &[PositionCoulomb, SpeedSine, RandomWalk],
        ]),
        Kind::ClosedDrive => any(&[
            &[AsymmetricFriction, Stribeck, Dahl, LuGre, QuadraticDamping, Gravity, Cogging, PositionInertia, BackEmf],
            &[
                DeadZone,
                Delay,
                ActuatorLag,
                InputOffset,
                OutputBacklash,
                InputBacklash,
                Drift,
                AbruptChange,
                PeriodicDisturbance,
            ],
            &[PositionCoulomb, SpeedSine],
        ]),
        Kind::Piezo | Kind::PiezoSlow => any(&[
            &[InputBacklash, PrandtlIshlinskii, Preisach, AsymmetricHysteresis, RateDependent, LogCreep, OutputOffset],
            &[DeadZone, InputSaturation, InputPolynomial, InputOffset, Drift, AbruptChange, PeriodicDisturbance],
            &sensor,
        ]),
        Kind::Tank => any(&[
            &[Leakage, Overflow, InputSaturation, InputPolynomial, Delay, SensorLag, OutputOffset, RandomWalk],
            &time,
            &sensor,
        ]),
        Kind::Thermal => {
            any(&[&[InputPolynomial, Delay, SensorLag, InputOffset, RandomWalk], &time, &[Quantisation, SensorDrift]])
        }
        Kind::Circuit => {
            any(&[&command, &sensor, &time, &[InputBacklash, Rectified, OutputOffset, Preisach, RandomWalk]])
        }
        Kind::Pendulum => any(&[
            &[Coulomb, Stribeck, QuadraticDamping, Cogging, PositionInertia, OutputBacklash, UnmodelledMode, Dahl],
            &[InputOffset, Delay, ActuatorLag, OutputSaturation, DeadZone],
            &time,
            &[SpeedSine, PositionCoulomb],
        ]),
        Kind::Wing => any(&[&[StallLag, OutputOffset], &sensor]),
        Kind::Specimen => any(&[
            &restoring,
            &memory,
            &damping,
            &sensor,
            &[Drift, AbruptChange, Heating, DisplacementSpeed, SpeedSine, ImpactDamping, PositionCoulomb, Fractional],
        ]),
    }
}
