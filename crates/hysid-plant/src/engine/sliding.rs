//! State derivatives on switching surfaces: the signs of the surfaces that are stuck are solved for.
//!
//! The equations are affine in each sign, so the derivatives with the sign at -1 and at 1 give all in between. One surface is
//! the common case and has a form of its own.

use super::machine::Machine;
use super::memory::Moment;
use super::surface::{Mode, solve};
use crate::number::{Number, Span};

impl<N: Number> Machine<'_, N> {
    /// d/dt of a surface's argument, where the states move by `k`; needs the gradients' registers.
    pub fn rate(&self, surface: usize, k: &[N]) -> N {
        let s = &self.model.surfaces[surface];
        let mut rate = N::lift(0.0);
        for &(i, register) in &s.by_state {
            rate = rate.add(self.registers[register as usize].mul(k[i as usize]));
        }
        for &(i, register) in &s.by_input {
            let inputs = &self.run.drive.inputs;
            let (_, slope) = self.between(|n| inputs.get(i as usize).and_then(|s| s.get(n)).copied().unwrap_or(0.0));
            rate = rate.add(self.registers[register as usize].scale(slope));
        }
        if let Some(register) = s.by_time {
            rate = rate.add(self.registers[register as usize]);
        }
        rate
    }

    /// State derivatives from `x` in the present modes: inputs, states and signs are set first.
    pub fn moded_flow<S: Span<N>>(&mut self, x: &[N], moment: &Moment<S>, out: &mut [N]) {
        self.set_states(x);
        self.stimulate(moment);
        if self.any_stuck {
            self.stuck_flow(moment, out);
        } else {
            self.set_signs();
            self.flow(moment, out);
        }
    }

    /// State derivatives, with stimulus and states as they are set, where a surface is stuck; its sign is kept in `sigma`.
    #[inline(never)]
    pub fn stuck_flow<S: Span<N>>(&mut self, moment: &Moment<S>, out: &mut [N]) {
        self.sigma_set = false;
        let mut all = self.modes.iter().enumerate().filter(|(_, m)| **m == Mode::Stuck);
        match (all.next(), all.next()) {
            (Some((surface, _)), None) => self.stuck_flow_of_one(surface, moment, out),
            _ => self.stuck_flow_of_several(moment, out),
        }
    }

    fn stuck_flow_of_one<S: Span<N>>(&mut self, surface: usize, moment: &Moment<S>, out: &mut [N]) {
        let one = N::lift(1.0);
        for (sigma, mode) in self.sigma.iter_mut().zip(&self.modes) {
            *sigma = N::lift(mode.sign());
        }
        self.sigma[surface] = one.neg();
        self.set_sigma();
        self.flow(moment, out);
        let model = self.model;
        model.gradients.run(&mut self.registers, &mut self.cells, moment);
        let below = self.rate(surface, out);
        let mut above_flow = self.sticking.pop().unwrap_or_default();
        above_flow.resize(out.len(), one);
        self.sigma[surface] = one;
        self.set_sigma();
        self.flow(moment, &mut above_flow);
        let change = self.rate(surface, &above_flow).sub(below);
        // 0 for a sign of -1 and 1 for a sign of 1.
        let share = if change.value() != 0.0 {
            below.neg().div(change)
        } else if below.value() == 0.0 {
            N::lift(0.5)
        } else {
            // No friction can hold it: the sign leaves its range on the side of the motion.
            N::lift(10.0 * crate::number::sign(below.value()))
        };
        for (to, above) in out.iter_mut().zip(&above_flow) {
            *to = to.add(above.sub(*to).mul(share));
        }
        self.sticking.push(above_flow);
        self.sigma[surface] = share.scale(2.0).sub(one);
        self.set_sigma();
    }

    fn stuck_flow_of_several<S: Span<N>>(&mut self, moment: &Moment<S>, out: &mut [N]) {
        let mut stuck = Vec::new();
        for (i, mode) in self.modes.iter().enumerate() {
            self.sigma[i] = N::lift(mode.sign());
            if *mode == Mode::Stuck {
                stuck.push(i);
                self.sigma[i] = N::lift(-1.0);
            }
        }
        self.set_sigma();
        self.flow(moment, out);
        let model = self.model;
        model.gradients.run(&mut self.registers, &mut self.cells, moment);
        let m = stuck.len();
        let mut changes = std::mem::take(&mut self.sticking);
        changes.resize(m.max(1), Vec::new());
        let mut system = vec![N::lift(0.0); m * m];
        let mut right: Vec<N> = stuck.iter().map(|&i| self.rate(i, out).neg()).collect();
        for (j, &surface) in stuck.iter().enumerate() {
            self.sigma[surface] = N::lift(1.0);
            self.set_sigma();
            let mut k = std::mem::take(&mut changes[j]);
            k.resize(out.len(), N::lift(0.0));
            self.flow(moment, &mut k);
            self.sigma[surface] = N::lift(-1.0);
            for (i, &row) in stuck.iter().enumerate() {
                // `right` is minus the rate at the base.
                system[i * m + j] = self.rate(row, &k).add(right[i]);
            }
            for (k, base) in k.iter_mut().zip(out.iter()) {
                *k = k.sub(*base);
            }
            changes[j] = k;
        }
        solve(&mut system, &mut right, m);
        for (j, &surface) in stuck.iter().enumerate() {
            // `right` is 0 for a sign of -1 and 1 for a sign of 1.
            let free = right[j].value() == 0.0 && changes[j].iter().all(|k| k.value() == 0.0);
            let share = if free { N::lift(0.5) } else { right[j] };
            self.sigma[surface] = share.scale(2.0).sub(N::lift(1.0));
            for (to, change) in out.iter_mut().zip(&changes[j]) {
                *to = to.add(change.mul(share));
            }
        }
        self.set_sigma();
        self.sticking = changes;
    }
}
