//! The Runge-Kutta step of order 4, with and without a surface that is stuck.
//!
//! The step without is what simulations spend their time in: it is compiled as a whole for each instruction set (see
//! `vector`), what rests on inputs and time only is evaluated once for each of its three moments (its start is the end of the step before), and states go straight
//! into the registers that the program reads.

use super::machine::Machine;
use super::memory::{Moment, Phase};
use super::run::Slot;
use crate::document::Hold;
use crate::number::{Number, Span};

impl<N: Number> Machine<'_, N> {
    /// The body of [`Machine::step`] for each instruction set, where no surface is stuck.
    #[inline(always)]
    pub fn step_here<S: Span<N>>(&mut self, tau: S, h: S) {
        self.set_signs();
        let Self { model, registers, cells, stages, x, trial, lines, added, stimulated, .. } = self;
        let (x, trial) = (x.as_slice(), trial.as_mut_slice());
        let (zero, half) = (h.part(0.0), h.part(0.5));
        let held = model.stimulus_lasts && !model.stimulus_ticks && self.hold == Hold::Zero && added.is_empty();
        let drive = self.run.drive;
        let sample_s = drive.period_s * self.n as f64;
        for &i in &model.state_numbers {
            registers[i] = x[i];
        }
        for s in 0..4 {
            let (since, phase) = match s {
                0 => (zero, Phase::Start),
                3 => (h, Phase::Inside),
                _ => (half, Phase::Inside),
            };
            let moment = Moment { sample_s, tau: tau.plus(since), since, step: h, phase };
            // The third stage is at the moment of the second, the first at that of the last step's fourth, and where inputs are held all are alike.
            if s != 2 && !(s == 0 && *stimulated) && !(s > 0 && held) {
                for line in lines.iter() {
                    registers[line.register as usize] = moment.tau.line(line.level, line.slope);
                }
                if !added.is_empty() {
                    for &(register, i) in &model.input_leaves {
                        for added in added.iter().filter(|a| a.slot == Slot::Input(i)) {
                            registers[register as usize] = added.to(registers[register as usize], moment.tau);
                        }
                    }
                }
                if let Some(register) = model.time_leaf {
                    registers[register as usize] = moment.tau.line(drive.start_s + sample_s, 1.0);
                }
                model.stimulus.run_here(registers, cells, &moment);
            }
            model.flow.run_here(registers, cells, &moment);
            let k = stages[s].as_mut_slice();
            for &i in &model.state_numbers {
                k[i] = registers[model.derivatives[i] as usize];
            }
            if !added.is_empty() {
                for added in added.iter() {
                    if let Slot::State(i) = added.slot
                        && let Some(k) = k.get_mut(i)
                    {
                        *k = added.to(*k, moment.tau);
                    }
                }
            }
            if s < 3 {
                let next = if s == 2 { h } else { half };
                for &i in &model.state_numbers {
                    registers[i] = x[i].add(next.times(k[i]));
                }
            }
        }
        *stimulated = model.stimulus_lasts;
        let [k1, k2, k3, k4] = stages;
        for &i in &model.state_numbers {
            trial[i] = weighted(x[i], h, [k1[i], k2[i], k3[i], k4[i]]);
        }
    }

    /// As [`Machine::step_here`], where a surface is stuck.
    #[inline(never)]
    pub fn step_stuck<S: Span<N>>(&mut self, tau: S, h: S) {
        let mut stages = std::mem::take(&mut self.stages);
        let x = std::mem::take(&mut self.x);
        self.set_states(&x);
        let (zero, half) = (h.part(0.0), h.part(0.5));
        for (s, k) in stages.iter_mut().enumerate() {
            let (since, phase) = match s {
                0 => (zero, Phase::Start),
                3 => (h, Phase::Inside),
                _ => (half, Phase::Inside),
            };
            let moment = self.moment(tau.plus(since), since, h, phase);
            if s != 2 {
                self.stimulate(&moment);
            }
            self.stuck_flow(&moment, k);
            if s < 3 {
                let next = if s == 2 { h } else { half };
                for &i in &self.model.state_numbers {
                    self.registers[i] = x[i].add(next.times(k[i]));
                }
            }
        }
        let [k1, k2, k3, k4] = &stages;
        for &i in &self.model.state_numbers {
            self.trial[i] = weighted(x[i], h, [k1[i], k2[i], k3[i], k4[i]]);
        }
        self.stages = stages;
        self.x = x;
    }

    /// Accepts `trial` as the state, `h` after `tau`.
    pub fn accept<S: Span<N>>(&mut self, tau: S, h: S) {
        std::mem::swap(&mut self.x, &mut self.trial);
        if !self.cells.is_empty() {
            let moment = self.moment(tau.plus(h), h, h, Phase::Inside);
            if !self.model.memories.is_empty() {
                let x = std::mem::take(&mut self.x);
                self.set_inputs(moment.tau);
                self.set_states(&x);
                self.model.memories.run(&mut self.registers, &mut self.cells, &moment);
                self.x = x;
            }
            self.cells.iter_mut().for_each(|c| c.commit(&moment));
        }
    }
}

/// The end of a Runge-Kutta step from its four slopes.
#[inline(always)]
fn weighted<N: Number, S: Span<N>>(x: N, h: S, [k1, k2, k3, k4]: [N; 4]) -> N {
    let middle = k2.add(k3);
    let sum = k1.add(middle.add(middle)).add(k4);
    x.add(h.part(1.0 / 6.0).times(sum))
}
