//! Sizes of the undisturbed plant's motion, from which effects take their units.

use super::{Design, Source};
use crate::body::Kind;
use crate::input::Input;

/// Sizes of the undisturbed plant's motion, from which effects take their units.
#[derive(Debug, Clone, Copy)]
pub struct Scales {
    pub(super) q: f64,
    pub(super) q_max: f64,
    pub(super) v: f64,
    pub(super) f: f64,
    pub(super) u: f64,
    pub(super) u_max: f64,
    pub(super) y: f64,
    pub(super) y_max: f64,
    pub(super) length: f64,
    pub(super) period: f64,
}

impl Design {
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

    /// Power of dissipation at the rms motion.
    pub(super) fn power(&self, s: &Scales) -> f64 {
        match self.kind {
            Kind::Drive | Kind::ClosedDrive => (self.theta[1] * s.v + self.theta[2]) * s.v,
            Kind::Specimen => self.theta[0] * s.v * s.v,
            Kind::Oscillator | Kind::TwoMasses | Kind::ThreeMasses | Kind::Pendulum => self.theta[1] * s.v * s.v,
            _ => 1.0,
        }
    }
}
