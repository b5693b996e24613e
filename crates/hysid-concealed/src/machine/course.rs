//! The course of a machine in time, for the integrator: rates of its states, and the events at which its modes switch.

use super::run::{Mode, Run};
use super::sensing::attached;
use crate::body::{Body, Store};
use crate::integrate::Hybrid;
use crate::law::Law;

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
