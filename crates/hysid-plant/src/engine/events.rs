//! Steps through switching events.
//!
//! A step that crosses a switching surface is shortened to the crossing (`crossing`), the mode is decided there, and the rest of the step follows. Forward
//! derivatives go through events: where nothing remembers the state is taken to the moment at which the event falls, by the rates before it and after it;
//! else the length of the shortened step carries the derivative of the crossing time.

use super::crossing::Crossing;
use super::machine::Machine;
use super::memory::Phase;
use super::surface::Mode;
use crate::document::Hold;
use crate::number::{Single, Span};

/// Most events in one step; what is beyond is integrated across.
const MAX_EVENTS: usize = 12;

impl<N: Single> Machine<'_, N> {
    pub fn set_mode(&mut self, surface: usize, mode: Mode) {
        self.modes[surface] = mode;
        self.any_stuck = self.modes.contains(&Mode::Stuck);
        self.sigma_set = false;
    }

    /// How far each surface is from its event at `x`, `since` after `tau`, into `distances`: positive before, negative after.
    #[inline(always)]
    pub fn measure_distances<S: Span<N>>(&mut self, x: &[N], tau: S, since: S, step: S) {
        let model = self.model;
        if !self.any_stuck && model.plain_surfaces {
            self.distances.clear();
            for (surface, mode) in model.surfaces.iter().zip(&self.modes) {
                self.distances.push(mode.sign() * x[surface.argument as usize].value());
            }
            return;
        }
        self.measure_distances_of_all(x, tau, since, step);
    }

    fn measure_distances_of_all<S: Span<N>>(&mut self, x: &[N], tau: S, since: S, step: S) {
        let model = self.model;
        let moment = self.moment(tau.plus(since), since, step, Phase::Inside);
        self.set_states(x);
        if self.any_stuck {
            let mut k = std::mem::take(&mut self.spare);
            self.stimulate(&moment);
            self.stuck_flow(&moment, &mut k);
            self.spare = k;
        } else {
            self.set_signs();
            self.set_inputs(moment.tau);
        }
        model.switches.run(&mut self.registers, &mut self.cells, &moment);
        self.distances.clear();
        for (i, surface) in model.surfaces.iter().enumerate() {
            self.distances.push(match self.modes[i] {
                Mode::Stuck => 1.0 + 1e-12 - self.sigma[i].value().abs(),
                mode => mode.sign() * self.registers[surface.argument as usize].value(),
            });
        }
    }

    /// As [`Machine::measure_distances`], of `trial`, the state after a step of length `h`.
    fn measure_trial<S: Span<N>>(&mut self, tau: S, h: S) {
        let trial = std::mem::take(&mut self.trial);
        self.measure_distances(&trial, tau, h, h);
        self.trial = trial;
    }

    /// Rates of a surface's argument with its sign at 1 and at -1, from `x`.
    fn rates_beside(&mut self, surface: usize) -> (f64, f64) {
        let zero = N::lift(0.0);
        let moment = self.moment(self.tau, zero, zero, Phase::Event);
        let x = std::mem::take(&mut self.x);
        let mut k = std::mem::take(&mut self.spare);
        let kept = self.modes[surface];
        let rates = [Mode::Positive, Mode::Negative].map(|mode| {
            self.set_mode(surface, mode);
            self.moded_flow(&x, &moment, &mut k);
            self.model.gradients.run(&mut self.registers, &mut self.cells, &moment);
            self.rate(surface, &k).value()
        });
        self.set_mode(surface, kept);
        self.spare = k;
        self.x = x;
        (rates[0], rates[1])
    }

    /// The mode on a surface that has just been reached.
    fn decide(&mut self, surface: usize) {
        let (above, below) = self.rates_beside(surface);
        let mode = if above <= 0.0 && below >= 0.0 {
            if let Some(i) = self.model.surfaces[surface].state {
                self.x[i as usize] = N::lift(0.0);
            }
            Mode::Stuck
        } else if above > 0.0 && below >= 0.0 {
            Mode::Positive
        } else if below < 0.0 && above <= 0.0 {
            Mode::Negative
        } else {
            // Both sides push away: the motion goes on through.
            match self.modes[surface] {
                Mode::Positive => Mode::Negative,
                _ => Mode::Positive,
            }
        };
        self.set_mode(surface, mode);
    }

    /// Sets the modes from the arguments' signs: at the start, and after a jump.
    pub fn refresh(&mut self) {
        let x = self.x.clone();
        let stuck: Vec<bool> = self.modes.iter().map(|m| *m == Mode::Stuck).collect();
        self.modes.iter_mut().for_each(|m| *m = Mode::Positive);
        (self.any_stuck, self.sigma_set) = (false, false);
        let zero = N::lift(0.0);
        self.measure_distances(&x, self.tau, zero, zero);
        for i in 0..self.modes.len() {
            let s = self.distances[i];
            // A stuck surface stays so while its argument is zero up to rounding.
            let tiny = self.model.surfaces[i].state.is_none() && stuck[i];
            if s == 0.0 || (tiny && s.abs() < 1e-12) {
                // The decision overwrites the distances.
                let kept = std::mem::take(&mut self.distances);
                self.decide(i);
                self.distances = kept;
            } else {
                self.set_mode(i, Mode::of(s));
            }
        }
    }

    /// Goes on by `h` from `tau` after the present sample, through every event on the way.
    pub fn advance(&mut self, tau: f64, h: f64) {
        if self.delays && self.advance_through_jumps(tau, h) {
            return;
        }
        if !self.modes.is_empty() {
            if self.any_stuck && self.hold == Hold::Zero {
                // A held input may have jumped.
                self.tau = N::lift(tau);
                for _ in 0..MAX_EVENTS {
                    if !self.release(N::lift(h)) {
                        break;
                    }
                }
            }
            self.step(tau, h);
            self.measure_trial(tau, h);
            if self.distances.iter().any(|d| *d < 0.0) {
                self.go_through_fired(tau, h);
                return;
            }
        } else {
            self.step(tau, h);
        }
        self.accept(tau, h);
    }

    /// As [`Machine::advance`], in steps that end where an input jumps or bends behind a delay; `false`, with nothing done, where none does.
    ///
    /// The lengths carry the derivative by the delay: where friction sticks a jump may set the motion free, and that moment moves with it.
    fn advance_through_jumps(&mut self, tau: f64, h: f64) -> bool {
        let period = self.run.drive.period_s;
        let sample_s = period * self.n as f64;
        // A jump this near to an end of the step is at that end.
        let slack = 1e-9 * h;
        let mut left = N::lift(h);
        self.tau = N::lift(tau);
        let mut split = false;
        loop {
            let (from, until) = (sample_s + self.tau.value() + slack, sample_s + tau + h - slack);
            let next = self.cells.iter().filter_map(|cell| cell.next_jump(period, from, until));
            let Some(at) = next.min_by(|a, b| a.value().total_cmp(&b.value())) else { break };
            let length = at.sub(N::lift(sample_s)).sub(self.tau);
            self.go_through_events(self.tau, length, false);
            left = left.sub(length);
            split = true;
        }
        if split {
            self.go_through_events(self.tau, left, false);
        }
        split
    }

    /// Lets go of every surface whose sign is beyond its range, and tells whether there was one.
    fn release(&mut self, rest: N) -> bool {
        let x = self.x.clone();
        self.measure_distances(&x, self.tau, N::lift(0.0), rest);
        let mut released = false;
        for i in 0..self.modes.len() {
            if self.modes[i] == Mode::Stuck && self.distances[i] < 0.0 {
                let mode = Mode::of(self.sigma[i].value());
                self.set_mode(i, mode);
                released = true;
            }
        }
        released
    }

    /// As [`Machine::advance`], where a step of that length has been tried in vain and `distances` are those at its end.
    pub fn advance_through_events(&mut self, tau: f64, h: f64, distances: impl Iterator<Item = f64>) {
        // The slopes of the step tell where the crossing is.
        self.step(tau, h);
        self.distances.clear();
        self.distances.extend(distances);
        self.go_through_fired(tau, h);
    }

    /// Goes on where a step has been tried in vain. What remembers is told the moments with their derivatives.
    fn go_through_fired(&mut self, tau: f64, h: f64) {
        if self.cells.is_empty() {
            self.go_through_events(tau, h, true);
        } else {
            self.go_through_events(N::lift(tau), N::lift(h), true);
        }
    }

    /// Goes on by `h` from `tau`; where a step of that length was `tried` in vain, `distances` are those at its end.
    ///
    /// Where lengths are plain, what moves a crossing's moment is told by the state: it has the derivative of the time before at the rates before, and of the time
    /// after at those after (M. A. Aizerman and F. R. Gantmacher, Quarterly Journal of Mechanics and Applied Mathematics 11 (1958), 163). Else the lengths carry it.
    fn go_through_events<S: Span<N>>(&mut self, mut tau: S, h: S, tried: bool) {
        let mut rest = h;
        for event in 0..MAX_EVENTS {
            self.tau = tau.seconds();
            if event > 0 || !tried {
                // Another surface's event may have jumped the forces.
                if self.any_stuck && self.release(rest.seconds()) {
                    continue;
                }
                self.step(tau, rest);
                self.measure_trial(tau, rest);
                if self.distances.iter().all(|d| *d >= 0.0 || d.is_nan()) {
                    return self.accept_rest(tau, rest);
                }
            }
            let at_end = self.distances.clone();
            let Some(Crossing { length, surface, moved }) = self.cross(tau, rest, &at_end) else {
                // It turns back at once: nothing moves, the mode is decided anew.
                if let Some(surface) = at_end.iter().position(|d| *d < 0.0) {
                    self.decide(surface);
                }
                continue;
            };
            let sign = self.sigma[surface].value();
            self.accept_rest(tau, length);
            (tau, rest) = (tau.plus(length), rest.minus(length));
            if self.modes[surface] == Mode::Stuck {
                self.set_mode(surface, Mode::of(sign));
            } else {
                self.decide(surface);
                if S::PLAIN && self.directions > 0 {
                    self.jump(moved);
                }
            }
            if rest.value() <= 1e-9 * h.value() {
                return;
            }
        }
        self.step(tau, rest);
        self.accept_rest(tau, rest);
        self.refresh();
    }

    /// Takes the derivatives of the state from an event back to the moment at which it falls, with the rates after it.
    fn jump(&mut self, moved: N) {
        let zero = N::lift(0.0);
        let moment = self.moment(self.tau, zero, zero, Phase::Event);
        let mut x = std::mem::take(&mut self.x);
        let mut k = std::mem::take(&mut self.spare);
        self.moded_flow(&x, &moment, &mut k);
        x.iter_mut().zip(&k).for_each(|(x, k)| *x = x.sub(k.mul(moved)));
        self.spare = k;
        self.x = x;
    }

    /// Accepts `trial`, which is `h` after `tau`, and goes there.
    fn accept_rest<S: Span<N>>(&mut self, tau: S, h: S) {
        self.accept(tau, h);
        self.tau = tau.plus(h).seconds();
    }

    /// A surface's argument after a step of this length from `tau`, and the value of its rate there; `trial` is the state and `spare` its rate.
    pub fn argument_after<S: Span<N>>(&mut self, surface: usize, tau: S, length: S) -> (N, f64) {
        self.step(tau, length);
        let moment = self.moment(tau.plus(length), length, length, Phase::Inside);
        let trial = std::mem::take(&mut self.trial);
        let mut k = std::mem::take(&mut self.spare);
        self.moded_flow(&trial, &moment, &mut k);
        let model = self.model;
        model.switches.run(&mut self.registers, &mut self.cells, &moment);
        model.gradients.run(&mut self.registers, &mut self.cells, &moment);
        let s = self.registers[model.surfaces[surface].argument as usize];
        let rate = self.rate(surface, &k).value();
        self.spare = k;
        self.trial = trial;
        (s, rate)
    }
}
