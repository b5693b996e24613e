//! The integrator: classical Runge-Kutta of order 4 with fixed steps, and switching surfaces whose events are located.
//!
//! A step that crosses a switching surface is shortened to the crossing (by the Illinois form of the secant), the mode is
//! decided there, and the rest of the step follows. In forward derivatives the length of the shortened step carries the
//! derivative of the crossing time, so that sensitivities go through events.

use super::Compiled;
use super::memory::{Cell, Follow, Moment, Phase};
use super::run::{Direction, Response, Run, Slot, Start};
use super::surface::{Mode, solve};
use crate::document::{Hold, Initial};
use crate::number::Single;

/// `[direction][output][sample]`.
pub(super) type Tangents = Vec<Vec<Vec<f64>>>;

/// Beyond this size a state or output counts as diverged.
const HUGE: f64 = 1e100;
/// Most events in one step; what is beyond is integrated across.
const MAX_EVENTS: usize = 12;

/// A signal added at a slot, as value or as tangent.
struct Added<'a> {
    slot: Slot,
    series: &'a [f64],
    /// The tangent that it is; none where it is a value.
    tangent: Option<usize>,
}

impl Added<'_> {
    fn at(&self, n: usize) -> f64 {
        self.series.get(n).copied().filter(|x| x.is_finite()).unwrap_or(0.0)
    }
}

/// One run in progress.
pub(super) struct Machine<'a, N> {
    model: &'a Compiled,
    run: &'a Run<'a>,
    hold: Hold,
    directions: usize,
    added: Vec<Added<'a>>,
    registers: Vec<N>,
    cells: Vec<Cell<N>>,
    modes: Vec<Mode>,
    sigma: Vec<N>,
    x: Vec<N>,
    /// Present sample, and seconds since it.
    n: usize,
    tau: N,
    stages: [Vec<N>; 4],
    trial: Vec<N>,
    point: Vec<N>,
    sticking: Vec<Vec<N>>,
    beside_flow: Vec<N>,
    /// Whether a surface is stuck, and whether the signs' registers are those of the modes.
    any_stuck: bool,
    sigma_set: bool,
    /// Registers of inputs with level and slope after the present sample.
    levels: Vec<(u32, f64, f64)>,
    distances: Vec<f64>,
    arch: pulp::Arch,
}

impl<'a, N: Single> Machine<'a, N> {
    pub fn new(model: &'a Compiled, run: &'a Run<'a>, directions: &'a [Direction<'a>]) -> Self {
        let zero = N::lift(0.0);
        let states = model.simulation.states.len();
        let mut registers = vec![zero; model.nodes.len()];
        for (register, node) in registers.iter_mut().zip(&model.nodes) {
            if let super::graph::Node::Constant(x) = node {
                *register = N::lift(*x);
            }
        }
        for &(register, p) in &model.parameter_leaves {
            let mut value = N::lift(run.theta.get(p).copied().unwrap_or(f64::NAN));
            for (k, direction) in directions.iter().enumerate() {
                if matches!(direction, Direction::Parameter(i) if *i == p) {
                    value = value.add_tangent(k, 1.0);
                }
            }
            registers[register as usize] = value;
        }
        let hold = model.hold();
        let follow = |of_input: bool| match (of_input, hold) {
            (false, _) => Follow::Smooth,
            (true, Hold::Linear) => Follow::Linear,
            (true, Hold::Zero) => Follow::Held,
        };
        let cells = model.delay_of_input.iter().map(|&of_input| Cell::new(follow(of_input))).collect();
        let values = run.injections.iter().map(|i| Added { slot: i.slot, series: i.series, tangent: None });
        let tangents = directions.iter().enumerate().filter_map(|(k, d)| match d {
            Direction::Injection(i) => Some(Added { slot: i.slot, series: i.series, tangent: Some(k) }),
            _ => None,
        });
        let mut machine = Self {
            model,
            run,
            hold,
            directions: directions.len(),
            added: values.chain(tangents).collect(),
            registers,
            cells,
            modes: vec![Mode::Positive; model.surfaces.len()],
            sigma: vec![zero; model.surfaces.len()],
            x: vec![zero; states],
            n: 0,
            tau: zero,
            stages: std::array::from_fn(|_| vec![zero; states]),
            trial: vec![zero; states],
            point: vec![zero; states],
            sticking: Vec::new(),
            beside_flow: Vec::new(),
            any_stuck: false,
            sigma_set: false,
            levels: Vec::new(),
            distances: Vec::new(),
            arch: pulp::Arch::new(),
        };
        machine.go_to(0);
        let moment = machine.moment(zero, zero, zero, Phase::Start);
        model.prologue.run(&mut machine.registers, &mut machine.cells, &moment);
        let mut free = 0;
        for (i, state) in model.simulation.states.iter().enumerate() {
            let mut value = match (&run.start, &state.initial) {
                (Start::States(x), _) => N::lift(x.get(i).copied().unwrap_or(0.0)),
                (_, Initial::Number(x)) => N::lift(*x),
                (Start::Document(x), Initial::Free) => {
                    free += 1;
                    N::lift(x.get(free - 1).copied().unwrap_or(0.0))
                }
                (_, Initial::Expr(_)) => {
                    model.initials.get(i).copied().flatten().map_or(zero, |id| machine.registers[id as usize])
                }
            };
            for (k, direction) in directions.iter().enumerate() {
                if matches!(direction, Direction::Initial(s) if *s == i) {
                    value = value.add_tangent(k, 1.0);
                }
            }
            machine.x[i] = value;
        }
        machine
    }

    /// Makes sample `n` the present one.
    pub fn go_to(&mut self, n: usize) {
        self.n = n;
        self.tau = N::lift(0.0);
        let drive = self.run.drive;
        let model = self.model;
        self.levels.clear();
        for (leaves, series) in [(&model.input_leaves, &drive.inputs), (&model.rate_leaves, &drive.rates)] {
            for &(register, i) in leaves {
                let (level, slope) = self.between(|n| series.get(i).and_then(|s| s.get(n)).copied().unwrap_or(0.0));
                self.levels.push((register, level, slope));
            }
        }
    }

    fn set_mode(&mut self, surface: usize, mode: Mode) {
        self.modes[surface] = mode;
        self.any_stuck = self.modes.contains(&Mode::Stuck);
        self.sigma_set = false;
    }

    /// `since` the last commit, on the way through a step.
    #[inline(always)]
    fn moment(&self, tau: N, since: N, step: N, phase: Phase) -> Moment<N> {
        let elapsed = N::lift(self.run.drive.period_s * self.n as f64).add(tau);
        Moment { elapsed, since, step, phase }
    }

    /// A signal's value and slope after sample `n`.
    fn between(&self, series: impl Fn(usize) -> f64) -> (f64, f64) {
        let value = series(self.n);
        let slope = match self.hold {
            Hold::Linear if self.n + 1 < self.run.drive.len => (series(self.n + 1) - value) / self.run.drive.period_s,
            _ => 0.0,
        };
        (value, slope)
    }

    fn added_at(&self, slot: Slot, tau: N, mut value: N) -> N {
        for added in self.added.iter().filter(|a| a.slot == slot) {
            let (level, slope) = self.between(|n| added.at(n));
            value = match added.tangent {
                None => value.add(N::lift(level).add(tau.scale(slope))),
                Some(k) => value.add_tangent(k, level + slope * tau.value()),
            };
        }
        value
    }

    /// Sets the registers of inputs and time, `tau` after sample `n`.
    #[inline(always)]
    fn set_inputs(&mut self, tau: N) {
        let model = self.model;
        for &(register, level, slope) in &self.levels {
            self.registers[register as usize] = N::lift(level).add(tau.scale(slope));
        }
        if !self.added.is_empty() {
            for &(register, i) in &model.input_leaves {
                let value = self.registers[register as usize];
                self.registers[register as usize] = self.added_at(Slot::Input(i), tau, value);
            }
        }
        if let Some(register) = model.time_leaf {
            let drive = self.run.drive;
            self.registers[register as usize] = N::lift(drive.start_s + drive.period_s * self.n as f64).add(tau);
        }
    }

    #[inline(always)]
    fn set_states(&mut self, x: &[N]) {
        for &(register, i) in &self.model.state_leaves {
            self.registers[register as usize] = x[i];
        }
    }

    #[inline(always)]
    fn set_sigma(&mut self) {
        for &(register, i) in &self.model.sigma_leaves {
            self.registers[register as usize] = self.sigma[i];
        }
    }

    /// State derivatives with the signs as they are set.
    #[inline(always)]
    fn flow(&mut self, x: &[N], moment: &Moment<N>, tau: N, out: &mut [N]) {
        let model = self.model;
        self.set_inputs(tau);
        self.set_states(x);
        model.flow.run(&mut self.registers, &mut self.cells, moment);
        for (i, (to, &register)) in out.iter_mut().zip(&model.derivatives).enumerate() {
            let value = self.registers[register as usize];
            *to = if self.added.is_empty() { value } else { self.added_at(Slot::State(i), tau, value) };
        }
    }

    /// d/dt of a surface's argument, where the states move by `k`; needs the gradients' registers.
    fn rate(&self, surface: usize, k: &[N]) -> N {
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

    /// State derivatives in the present modes: the signs of stuck surfaces are solved for and kept in `sigma`.
    #[inline(always)]
    fn moded_flow(&mut self, x: &[N], moment: &Moment<N>, tau: N, out: &mut [N]) {
        if self.any_stuck {
            self.stuck_flow(x, moment, tau, out);
        } else {
            self.set_signs();
            self.flow(x, moment, tau, out);
        }
    }

    /// The signs of the modes, where none is stuck.
    #[inline(always)]
    fn set_signs(&mut self) {
        if !self.sigma_set {
            for (sigma, mode) in self.sigma.iter_mut().zip(&self.modes) {
                *sigma = N::lift(mode.sign());
            }
            self.set_sigma();
            self.sigma_set = true;
        }
    }

    #[inline(never)]
    fn stuck_flow(&mut self, x: &[N], moment: &Moment<N>, tau: N, out: &mut [N]) {
        self.sigma_set = false;
        let mut all = self.modes.iter().enumerate().filter(|(_, m)| **m == Mode::Stuck);
        match (all.next(), all.next()) {
            (Some((surface, _)), None) => self.stuck_flow_of_one(surface, x, moment, tau, out),
            _ => self.stuck_flow_of_several(x, moment, tau, out),
        }
    }

    /// As [`Self::stuck_flow_of_several`], for the common case.
    fn stuck_flow_of_one(&mut self, surface: usize, x: &[N], moment: &Moment<N>, tau: N, out: &mut [N]) {
        let one = N::lift(1.0);
        for (sigma, mode) in self.sigma.iter_mut().zip(&self.modes) {
            *sigma = N::lift(mode.sign());
        }
        self.sigma[surface] = one.neg();
        self.set_sigma();
        self.flow(x, moment, tau, out);
        let model = self.model;
        model.gradients.run(&mut self.registers, &mut self.cells, moment);
        let below = self.rate(surface, out);
        let mut above_flow = std::mem::take(&mut self.beside_flow);
        above_flow.resize(out.len(), one);
        self.sigma[surface] = one;
        self.set_sigma();
        self.flow(x, moment, tau, &mut above_flow);
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
        self.beside_flow = above_flow;
        self.sigma[surface] = share.scale(2.0).sub(one);
        self.set_sigma();
    }

    fn stuck_flow_of_several(&mut self, x: &[N], moment: &Moment<N>, tau: N, out: &mut [N]) {
        let mut stuck = Vec::new();
        for (i, mode) in self.modes.iter().enumerate() {
            self.sigma[i] = N::lift(mode.sign());
            if *mode == Mode::Stuck {
                stuck.push(i);
                self.sigma[i] = N::lift(-1.0);
            }
        }
        self.set_sigma();
        self.flow(x, moment, tau, out);
        let model = self.model;
        model.gradients.run(&mut self.registers, &mut self.cells, moment);
        let m = stuck.len();
        let mut changes = std::mem::take(&mut self.sticking);
        changes.resize(m, Vec::new());
        let mut system = vec![N::lift(0.0); m * m];
        let mut right: Vec<N> = stuck.iter().map(|&i| self.rate(i, out).neg()).collect();
        for (j, &surface) in stuck.iter().enumerate() {
            self.sigma[surface] = N::lift(1.0);
            self.set_sigma();
            let mut k = std::mem::take(&mut changes[j]);
            k.resize(out.len(), N::lift(0.0));
            self.flow(x, moment, tau, &mut k);
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

    /// One Runge-Kutta step of length `h` from `x`, into `trial`.
    fn step(&mut self, h: N) {
        if N::WIDE {
            let arch = self.arch;
            arch.dispatch(
                #[inline(always)]
                || self.step_body(h),
            );
        } else {
            self.step_body(h);
        }
    }

    #[inline(always)]
    fn step_body(&mut self, h: N) {
        let mut stages = std::mem::take(&mut self.stages);
        let mut point = std::mem::take(&mut self.point);
        let x = std::mem::take(&mut self.x);
        let half = h.scale(0.5);
        let zero = N::lift(0.0);
        let tau = self.tau;
        point.copy_from_slice(&x);
        for s in 0..4 {
            let (since, phase) = match s {
                0 => (zero, Phase::Start),
                3 => (h, Phase::Inside),
                _ => (half, Phase::Inside),
            };
            let now = tau.add(since);
            let moment = self.moment(now, since, h, phase);
            self.moded_flow(&point, &moment, now, &mut stages[s]);
            if s < 3 {
                let next = if s == 2 { h } else { half };
                for ((p, x), k) in point.iter_mut().zip(&x).zip(&stages[s]) {
                    *p = x.add(next.mul(*k));
                }
            }
        }
        let sixth = h.scale(1.0 / 6.0);
        let [k1, k2, k3, k4] = &stages;
        for i in 0..x.len() {
            let middle = k2[i].add(k3[i]);
            let sum = k1[i].add(middle.add(middle)).add(k4[i]);
            self.trial[i] = x[i].add(sixth.mul(sum));
        }
        self.stages = stages;
        self.point = point;
        self.x = x;
    }

    /// How far each surface is from its event at `x`, `since` into a step: positive before, negative after.
    fn measure_distances(&mut self, x: &[N], since: N, step: N, out: &mut Vec<f64>) {
        let model = self.model;
        let tau = self.tau.add(since);
        let moment = self.moment(tau, since, step, Phase::Inside);
        if self.any_stuck {
            let mut k = std::mem::take(&mut self.point);
            self.stuck_flow(x, &moment, tau, &mut k);
            self.point = k;
        } else {
            self.set_signs();
            self.set_inputs(tau);
            self.set_states(x);
        }
        model.switches.run(&mut self.registers, &mut self.cells, &moment);
        out.clear();
        for (i, surface) in model.surfaces.iter().enumerate() {
            out.push(match self.modes[i] {
                Mode::Stuck => 1.0 + 1e-12 - self.sigma[i].value().abs(),
                mode => mode.sign() * self.registers[surface.argument as usize].value(),
            });
        }
    }

    /// Accepts `trial` as the state, `h` further on.
    fn accept(&mut self, h: N) {
        std::mem::swap(&mut self.x, &mut self.trial);
        self.tau = self.tau.add(h);
        if !self.cells.is_empty() {
            let moment = self.moment(self.tau, h, h, Phase::Inside);
            let x = std::mem::take(&mut self.x);
            self.set_inputs(self.tau);
            self.set_states(&x);
            self.model.memories.run(&mut self.registers, &mut self.cells, &moment);
            self.cells.iter_mut().for_each(|c| c.commit(moment.elapsed));
            self.x = x;
        }
    }

    /// Rates of a surface's argument with its sign at 1 and at -1, from `x`.
    fn rates_beside(&mut self, surface: usize) -> (f64, f64) {
        let zero = N::lift(0.0);
        let moment = self.moment(self.tau, zero, zero, Phase::Start);
        let x = std::mem::take(&mut self.x);
        let mut k = std::mem::take(&mut self.point);
        let kept = self.modes[surface];
        let rates = [Mode::Positive, Mode::Negative].map(|mode| {
            self.set_mode(surface, mode);
            self.moded_flow(&x, &moment, self.tau, &mut k);
            self.model.gradients.run(&mut self.registers, &mut self.cells, &moment);
            self.rate(surface, &k).value()
        });
        self.set_mode(surface, kept);
        self.point = k;
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
    fn refresh(&mut self) {
        let mut distances = Vec::new();
        let zero = N::lift(0.0);
        let x = self.x.clone();
        let stuck: Vec<bool> = self.modes.iter().map(|m| *m == Mode::Stuck).collect();
        self.modes.iter_mut().for_each(|m| *m = Mode::Positive);
        (self.any_stuck, self.sigma_set) = (false, false);
        self.measure_distances(&x, zero, zero, &mut distances);
        for (i, s) in distances.into_iter().enumerate() {
            // A stuck surface stays so while its argument is zero up to rounding.
            let tiny = self.model.surfaces[i].state.is_none() && stuck[i];
            if s == 0.0 || (tiny && s.abs() < 1e-12) {
                self.decide(i);
            } else {
                self.set_mode(i, Mode::of(s));
            }
        }
    }

    /// Goes on by `h`, through every event on the way.
    fn advance(&mut self, h: N) {
        if self.modes.is_empty() {
            self.step(h);
            self.accept(h);
            return;
        }
        let (mut rest, zero) = (h, N::lift(0.0));
        let mut distances = std::mem::take(&mut self.distances);
        for event in 0..MAX_EVENTS {
            if self.any_stuck && (event > 0 || self.hold == Hold::Zero) {
                // A held input may have jumped, or another surface's event the forces: a sign beyond its range lets go.
                let x = self.x.clone();
                self.measure_distances(&x, zero, rest, &mut distances);
                let mut released = false;
                for i in 0..self.modes.len() {
                    if self.modes[i] == Mode::Stuck && distances[i] < 0.0 {
                        let mode = Mode::of(self.sigma[i].value());
                        self.set_mode(i, mode);
                        released = true;
                    }
                }
                if released {
                    continue;
                }
            }
            self.step(rest);
            let trial = std::mem::take(&mut self.trial);
            self.measure_distances(&trial, rest, rest, &mut distances);
            self.trial = trial;
            if distances.iter().all(|d| *d >= 0.0 || d.is_nan()) {
                self.accept(rest);
                self.distances = distances;
                return;
            }
            let at_end = distances.clone();
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
                self.step(length);
                let trial = self.trial.clone();
                self.measure_distances(&trial, length, length, &mut distances);
                let s = self.registers[self.model.surfaces[surface].argument as usize];
                let mut k = std::mem::take(&mut self.point);
                let moment = self.moment(self.tau.add(length), length, length, Phase::Inside);
                self.moded_flow(&trial, &moment, self.tau.add(length), &mut k);
                self.model.gradients.run(&mut self.registers, &mut self.cells, &moment);
                let rate = self.rate(surface, &k);
                self.point = k;
                let correction = s.div(N::lift(rate.value()));
                if correction.value().abs() <= 1e-3 * rest.value() {
                    length = length.sub(correction);
                }
            }
            self.step(length);
            let sign = self.sigma[surface].value();
            self.accept(length);
            rest = rest.sub(length);
            if self.modes[surface] == Mode::Stuck {
                self.set_mode(surface, Mode::of(sign));
            } else {
                self.decide(surface);
            }
            if rest.value() <= 1e-9 * h.value() {
                self.tau = self.tau.add(rest);
                return;
            }
        }
        self.step(rest);
        self.accept(rest);
        self.refresh();
    }

    /// The length of step at which the first event falls, and its surface; none where a surface is left only to return to it
    /// at once.
    fn locate(&mut self, whole: f64, at_end: &[f64]) -> Option<(f64, usize)> {
        let fired: Vec<usize> = (0..at_end.len()).filter(|&i| at_end[i] < 0.0).collect();
        let scale: Vec<f64> = fired.iter().map(|&i| -at_end[i]).collect();
        let mut distances = Vec::new();
        let mut nearest = |machine: &mut Self, h: f64| {
            let x = if h > 0.0 {
                machine.step(N::lift(h));
                machine.trial.clone()
            } else {
                machine.x.clone()
            };
            machine.measure_distances(&x, N::lift(h), N::lift(whole), &mut distances);
            let scaled = fired.iter().zip(&scale).map(|(&i, s)| (distances[i] / s, i));
            scaled.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::NAN, 0))
        };
        let (mut high, mut at_high) = (whole, -1.0);
        let (mut low, mut at_low) = (0.0, nearest(self, 0.0).0);
        let mut surface = fired.first().copied().unwrap_or(0);
        for _ in 0..8 {
            if at_low > 0.0 {
                break;
            }
            // The surface is just being left: look for a point on the way at which it has been.
            low = if low == 0.0 { 0.5 * high } else { low };
            let (value, which) = nearest(self, low);
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
            let (value, which) = nearest(self, middle);
            if value.abs() < 1e-14 {
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

    /// State derivatives and outputs at the start, each with its tangents.
    pub fn beside(mut self) -> (Vec<(f64, Vec<f64>)>, Vec<(f64, Vec<f64>)>) {
        let zero = N::lift(0.0);
        let x = self.x.clone();
        let mut flow = vec![zero; x.len()];
        let mut outputs = vec![zero; self.model.outputs.len()];
        let moment = self.moment(zero, zero, zero, Phase::Start);
        self.moded_flow(&x, &moment, zero, &mut flow);
        self.measure(&mut outputs);
        let directions = self.directions;
        let split =
            |y: Vec<N>| y.iter().map(|y| (y.value(), (0..directions).map(|k| y.tangent(k)).collect())).collect();
        (split(flow), split(outputs))
    }

    /// Runs over all samples.
    pub fn run(mut self) -> (Response, Tangents) {
        let model = self.model;
        let drive = self.run.drive;
        let (len, period) = (drive.len, drive.period_s);
        let outputs = model.outputs.len();
        let mut response = Response {
            outputs: vec![vec![f64::NAN; len]; outputs],
            states: vec![vec![f64::NAN; len]; self.x.len()],
            diverged: None,
        };
        let mut tangents = vec![vec![vec![f64::NAN; len]; outputs]; self.directions];
        let substeps = if self.x.is_empty() { 1 } else { self.run.substeps.max(1) };
        let step = period / substeps as f64;
        let zero = N::lift(0.0);
        let jumps = self.run.observer.is_some()
            || (self.hold == Hold::Zero && model.surfaces.iter().any(|s| !s.by_input.is_empty()));
        let mut y = vec![zero; outputs];
        for n in 0..len {
            self.go_to(n);
            if !self.modes.is_empty() && (n == 0 || jumps) {
                self.refresh();
            }
            self.measure(&mut y);
            let bad = |v: &N| !(v.value().abs() < HUGE);
            if y.iter().chain(&self.x).any(bad) {
                response.diverged = Some(n);
                break;
            }
            for (j, y) in y.iter().enumerate() {
                response.outputs[j][n] = y.value();
                for (k, t) in tangents.iter_mut().enumerate() {
                    t[j][n] = y.tangent(k);
                }
            }
            for (i, x) in self.x.iter().enumerate() {
                response.states[i][n] = x.value();
            }
            if n + 1 == len {
                break;
            }
            if let Some(observer) = self.run.observer {
                self.correct(&y, observer.gain, observer.measured);
            }
            for s in 0..substeps {
                self.tau = N::lift(step * s as f64);
                self.advance(N::lift(step));
            }
        }
        (response, tangents)
    }

    /// Outputs at the present sample.
    fn measure(&mut self, y: &mut [N]) {
        let zero = N::lift(0.0);
        let moment = self.moment(zero, zero, zero, Phase::Start);
        let x = std::mem::take(&mut self.x);
        if self.any_stuck {
            let mut k = std::mem::take(&mut self.point);
            self.stuck_flow(&x, &moment, zero, &mut k);
            self.point = k;
        } else {
            self.set_signs();
            self.set_inputs(zero);
            self.set_states(&x);
        }
        self.x = x;
        self.model.measure.run(&mut self.registers, &mut self.cells, &moment);
        for (j, (y, &register)) in y.iter_mut().zip(&self.model.outputs).enumerate() {
            *y = self.added_at(Slot::Output(j), zero, self.registers[register as usize]);
        }
    }

    /// The observer's correction of the states.
    fn correct(&mut self, y: &[N], gain: &[f64], measured: &[Vec<f64>]) {
        for (j, y) in y.iter().enumerate() {
            let Some(target) = measured.get(j).and_then(|m| m.get(self.n)).filter(|m| m.is_finite()) else {
                continue;
            };
            let error = N::lift(*target).sub(*y);
            for (i, x) in self.x.iter_mut().enumerate() {
                *x = x.add(error.scale(gain.get(i * y_count(self.model) + j).copied().unwrap_or(0.0)));
            }
        }
        if !self.modes.is_empty() {
            self.refresh();
        }
    }
}

fn y_count(model: &Compiled) -> usize {
    model.outputs.len()
}
