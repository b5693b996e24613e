//! Steps through switching events.
//!
//! A step that crosses a switching surface is shortened to the crossing (by the Illinois form of the secant), the mode is
//! decided there, and the rest of the step follows. In forward derivatives the length of the shortened step carries the
//! derivative of the crossing time, so that sensitivities go through events.

use super::machine::Machine;
use super::memory::Phase;
use super::surface::Mode;
use crate::document::Hold;
use crate::number::{Single, Span};

/// Most events in one step; what is beyond is integrated across.
const MAX_EVENTS: usize = 12;
/// How near to a crossing the search goes, as a share of the step's way across; Newton's correction squares it.
const NEAR: f64 = 1e-6;

impl<N: Single> Machine<'_, N> {
    pub fn set_mode(&mut self, surface: usize, mode: Mode) {
        self.modes[surface] = mode;
        self.any_stuck = self.modes.contains(&Mode::Stuck);
        self.sigma_set = false;
    }

    /// How far each surface is from its event at `x`, `since` after `tau`, into `distances`: positive before, negative after.
    #[inline(always)]
    fn measure_distances<S: Span<N>>(&mut self, x: &[N], tau: S, since: S, step: S) {
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
                self.tau = N::lift(tau);
                self.go_through_events(N::lift(h), true);
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
            self.go_through_events(length, false);
            left = left.sub(length);
            split = true;
        }
        if split {
            self.go_through_events(left, false);
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
        self.distances.clear();
        self.distances.extend(distances);
        self.tau = N::lift(tau);
        self.go_through_events(N::lift(h), true);
    }

    /// Goes on by `h` from `self.tau`; where a step of that length was `tried` in vain, `distances` are those at its end.
    fn go_through_events(&mut self, h: N, tried: bool) {
        let mut rest = h;
        for event in 0..MAX_EVENTS {
            if event > 0 || !tried {
                // Another surface's event may have jumped the forces.
                if self.any_stuck && self.release(rest) {
                    continue;
                }
                self.step(self.tau, rest);
                self.measure_trial(self.tau, rest);
                if self.distances.iter().all(|d| *d >= 0.0 || d.is_nan()) {
                    self.accept_rest(rest);
                    return;
                }
            }
            let at_end = self.distances.clone();
            let Some((at, surface)) = self.locate(rest.value(), &at_end) else {
                // It turns back at once: nothing moves, the mode is decided anew.
                if let Some(surface) = at_end.iter().position(|d| *d < 0.0) {
                    self.decide(surface);
                }
                continue;
            };
            let mut length = N::lift(at);
            if self.modes[surface] != Mode::Stuck {
                // The derivative of the crossing time, and one Newton correction of its value.
                let (s, rate) = self.argument_after(surface, length);
                let correction = s.div(N::lift(rate));
                if correction.value().abs() <= 1e-3 * rest.value() {
                    length = length.sub(correction);
                }
            }
            self.step(self.tau, length);
            let sign = self.sigma[surface].value();
            self.accept_rest(length);
            rest = rest.sub(length);
            if self.modes[surface] == Mode::Stuck {
                self.set_mode(surface, Mode::of(sign));
            } else {
                self.decide(surface);
            }
            if rest.value() <= 1e-9 * h.value() {
                return;
            }
        }
        self.step(self.tau, rest);
        self.accept_rest(rest);
        self.refresh();
    }

    /// Accepts `trial`, which is `h` after `self.tau`.
    fn accept_rest(&mut self, h: N) {
        self.accept(self.tau, h);
        self.tau = self.tau.add(h);
    }

    /// A surface's argument after a step of this length from `self.tau`, and the value of its rate there.
    fn argument_after(&mut self, surface: usize, length: N) -> (N, f64) {
        self.step(self.tau, length);
        let moment = self.moment(self.tau.add(length), length, length, Phase::Inside);
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

    /// The least distance (in shares of those at the whole step's end) of the surfaces that fired, after a step of length `h`.
    fn nearest(&mut self, h: f64, whole: f64, fired: &[(usize, f64)]) -> (f64, usize) {
        let tau = self.tau.value();
        if h > 0.0 {
            self.step(tau, h);
            let trial = std::mem::take(&mut self.trial);
            self.measure_distances(&trial, tau, h, whole);
            self.trial = trial;
        } else {
            let x = std::mem::take(&mut self.x);
            self.measure_distances(&x, tau, 0.0, whole);
            self.x = x;
        }
        let scaled = fired.iter().map(|&(i, scale)| (self.distances[i] / scale, i));
        scaled.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::NAN, 0))
    }

    /// The length of step at which the first event falls, and its surface; none where a surface is left only to return to it
    /// at once.
    fn locate(&mut self, whole: f64, at_end: &[f64]) -> Option<(f64, usize)> {
        let fired: Vec<(usize, f64)> =
            at_end.iter().enumerate().filter(|(_, d)| **d < 0.0).map(|(i, d)| (i, -d)).collect();
        let (mut high, mut at_high) = (whole, -1.0);
        let (mut low, mut at_low) = (0.0, self.nearest(0.0, whole, &fired).0);
        let mut surface = fired.first().map_or(0, |f| f.0);
        for _ in 0..8 {
            if at_low > 0.0 {
                break;
            }
            // The surface is just being left: look for a point on the way at which it has been.
            low = if low == 0.0 { 0.5 * high } else { low };
            let (value, which) = self.nearest(low, whole, &fired);
            if value > 0.0 {
                at_low = value;
            } else {
                (high, at_high, surface) = (low, value, which);
                low *= 0.5;
            }
        }
        if at_low <= 0.0 || at_low.is_nan() {
            return None;
        }
        for i in 0..60 {
            if high - low <= 1e-13 * whole {
                break;
            }
            let secant = (low * at_high - high * at_low) / (at_high - at_low);
            let middle = if i % 8 == 7 || !(secant > low && secant < high) { 0.5 * (low + high) } else { secant };
            let (value, which) = self.nearest(middle, whole, &fired);
            let near = if self.modes[which] == Mode::Stuck { 1e-14 } else { NEAR };
            if value.abs() < near {
                return Some((middle, which));
            }
            if value > 0.0 {
                (low, at_low) = (middle, value);
                at_high *= 0.5;
            } else {
                (high, at_high, surface) = (middle, value, which);
                at_low *= 0.5;
            }
        }
        Some((high, surface))
    }
}
