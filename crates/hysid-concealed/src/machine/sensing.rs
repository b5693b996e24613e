//! What is recorded of a machine: displacements through the sensor's effects, or the force on a specimen whose motion is imposed.

use super::Machine;
use super::run::Run;
use crate::body::Body;
use crate::law::Law;

impl Run<'_> {
    /// Recorded value of a channel.
    pub(super) fn read(&mut self, t: f64, x: &[f64], channel: usize) -> f64 {
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
pub(super) fn attached(w: &[f64; 4], alpha: f64) -> f64 {
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
