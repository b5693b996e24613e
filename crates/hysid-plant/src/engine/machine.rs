//! One run in progress: its registers, states and memories, and the state derivatives at a point.
//!
//! A machine runs one simulation, or several in lanes (then without events, see `lockstep`). The first registers are the states.

use super::Compiled;
use super::memory::{Cell, Follow, Moment, Phase};
use super::run::{Direction, Injection, Run, Slot, Start};
use super::surface::Mode;
use super::vector::Width;
use crate::document::{Hold, Initial};
use crate::number::{Number, Span};

/// A signal added at a slot, as value or as tangent.
pub(super) struct Added<'a> {
    pub slot: Slot,
    series: &'a [f64],
    /// The tangent that it is; none where it is a value.
    tangent: Option<usize>,
    /// Its value at the present sample, and its slope from there.
    level: f64,
    slope: f64,
}

impl<'a> Added<'a> {
    fn new(injection: &Injection<'a>, tangent: Option<usize>) -> Self {
        Self { slot: injection.slot, series: injection.series, tangent, level: 0.0, slope: 0.0 }
    }

    #[inline(always)]
    pub fn to<N: Number, S: Span<N>>(&self, value: N, tau: S) -> N {
        match self.tangent {
            None => value.add(tau.line(self.level, self.slope)),
            Some(k) => value.add_tangent(k, self.level + self.slope * tau.value()),
        }
    }
}

/// A signal's value at the present sample, and its slope from there.
#[derive(Debug, Clone, Copy)]
pub(super) struct Line {
    pub register: u32,
    pub level: f64,
    pub slope: f64,
}

/// One run in progress, or one in each lane.
pub(super) struct Machine<'a, N> {
    pub model: &'a Compiled,
    /// The run (of the first lane; the drive, the steps and the observer are those of all).
    pub run: &'a Run<'a>,
    pub hold: Hold,
    pub directions: usize,
    pub added: Vec<Added<'a>>,
    pub registers: Vec<N>,
    pub cells: Vec<Cell<N>>,
    /// Whether steps end where an input that passed a delay jumps or bends.
    pub delays: bool,
    pub modes: Vec<Mode>,
    pub sigma: Vec<N>,
    pub x: Vec<N>,
    /// Present sample, and seconds since it.
    pub n: usize,
    pub tau: N,
    pub stages: [Vec<N>; 4],
    pub trial: Vec<N>,
    /// Derivatives of the states where only they are asked for.
    pub spare: Vec<N>,
    pub sticking: Vec<Vec<N>>,
    /// Whether a surface is stuck, and whether the signs' registers are those of the modes.
    pub any_stuck: bool,
    pub sigma_set: bool,
    /// Whether the registers hold the stimulus with which the next step begins.
    pub stimulated: bool,
    pub lines: Vec<Line>,
    pub distances: Vec<f64>,
    pub width: Width,
}

impl<'a, N: Number> Machine<'a, N> {
    /// At the first sample; `runs` has one run for each lane.
    pub fn new(model: &'a Compiled, runs: &'a [Run<'a>], directions: &'a [Direction<'a>]) -> Option<Self> {
        let run = runs.first()?;
        let zero = N::lift(0.0);
        let states = model.simulation.states.len();
        let lanes = |value: &dyn Fn(&Run<'_>) -> f64| {
            let all = runs.iter().enumerate();
            all.fold(N::lift(value(run)), |number, (lane, run)| number.with_value(lane, value(run)))
        };
        let mut registers = vec![zero; model.nodes.len()];
        for (register, node) in registers.iter_mut().zip(&model.nodes) {
            if let super::graph::Node::Constant(x) = node {
                *register = N::lift(*x);
            }
        }
        for &(register, p) in &model.parameter_leaves {
            let mut value = lanes(&|run| run.theta.get(p).copied().unwrap_or(f64::NAN));
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
        let cells: Vec<Cell<N>> = model.delay_of_input.iter().map(|&of_input| Cell::new(follow(of_input))).collect();
        // Without friction that sticks the mean over a step says enough.
        let delays = !model.surfaces.is_empty() && model.delay_of_input.contains(&true);
        let values = run.injections.iter().map(|i| Added::new(i, None));
        let tangents = directions.iter().enumerate().filter_map(|(k, d)| match d {
            Direction::Injection(i) => Some(Added::new(i, Some(k))),
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
            delays,
            modes: vec![Mode::Positive; model.surfaces.len()],
            sigma: vec![zero; model.surfaces.len()],
            x: vec![zero; states],
            n: 0,
            tau: zero,
            stages: std::array::from_fn(|_| vec![zero; states]),
            trial: vec![zero; states],
            spare: vec![zero; states],
            sticking: Vec::new(),
            any_stuck: false,
            sigma_set: false,
            stimulated: false,
            lines: Vec::new(),
            distances: Vec::new(),
            width: Width::of::<N>(),
        };
        machine.go_to(0);
        let moment = machine.moment(0.0, 0.0, 0.0, Phase::Start);
        model.prologue.run(&mut machine.registers, &mut machine.cells, &moment);
        let mut free = 0;
        for (i, state) in model.simulation.states.iter().enumerate() {
            let is_free = state.initial == Initial::Free;
            let mut value = match (&state.initial, model.initials.get(i).copied().flatten()) {
                (Initial::Expr(_), Some(id)) => machine.registers[id as usize],
                _ => zero,
            };
            for (lane, run) in runs.iter().enumerate() {
                let given = match (&run.start, &state.initial) {
                    (Start::States(x), _) => Some(x.get(i)),
                    (Start::Document(x), Initial::Free) => Some(x.get(free)),
                    (_, Initial::Number(x)) => Some(Some(x)),
                    (_, Initial::Expr(_)) => None,
                };
                if let Some(given) = given {
                    let given = given.copied().unwrap_or(0.0);
                    value = if lane == 0 { N::lift(given) } else { value.with_value(lane, given) };
                }
            }
            free += usize::from(is_free);
            for (k, direction) in directions.iter().enumerate() {
                if matches!(direction, Direction::Initial(s) if *s == i) {
                    value = value.add_tangent(k, 1.0);
                }
            }
            machine.x[i] = value;
        }
        Some(machine)
    }

    /// Makes sample `n` the present one.
    pub fn go_to(&mut self, n: usize) {
        self.n = n;
        self.tau = N::lift(0.0);
        self.stimulated &= self.hold == Hold::Linear;
        let drive = self.run.drive;
        let model = self.model;
        self.lines.clear();
        for (leaves, series) in [(&model.input_leaves, &drive.inputs), (&model.rate_leaves, &drive.rates)] {
            for &(register, i) in leaves {
                let (level, slope) = self.between(|n| series.get(i).and_then(|s| s.get(n)).copied().unwrap_or(0.0));
                self.lines.push(Line { register, level, slope });
            }
        }
        let mut added = std::mem::take(&mut self.added);
        for added in &mut added {
            let at = |n: usize| added.series.get(n).copied().filter(|x| x.is_finite()).unwrap_or(0.0);
            (added.level, added.slope) = self.between(at);
        }
        self.added = added;
    }

    /// `since` the last commit, on the way through a step; `tau` after the present sample.
    #[inline(always)]
    pub fn moment<S: Span<N>>(&self, tau: S, since: S, step: S, phase: Phase) -> Moment<S> {
        Moment { sample_s: self.run.drive.period_s * self.n as f64, tau, since, step, phase }
    }

    /// A signal's value and slope after the present sample.
    pub fn between(&self, series: impl Fn(usize) -> f64) -> (f64, f64) {
        let value = series(self.n);
        let slope = match self.hold {
            Hold::Linear if self.n + 1 < self.run.drive.len => (series(self.n + 1) - value) / self.run.drive.period_s,
            _ => 0.0,
        };
        (value, slope)
    }

    fn added_to<S: Span<N>>(&self, slot: Slot, tau: S, value: N) -> N {
        self.added.iter().filter(|a| a.slot == slot).fold(value, |value, added| added.to(value, tau))
    }

    /// Sets the registers of inputs and time, `tau` after the present sample.
    #[inline(always)]
    pub fn set_inputs<S: Span<N>>(&mut self, tau: S) {
        let model = self.model;
        for line in &self.lines {
            self.registers[line.register as usize] = tau.line(line.level, line.slope);
        }
        if !self.added.is_empty() {
            for &(register, i) in &model.input_leaves {
                let value = self.registers[register as usize];
                self.registers[register as usize] = self.added_to(Slot::Input(i), tau, value);
            }
        }
        if let Some(register) = model.time_leaf {
            let drive = self.run.drive;
            self.registers[register as usize] = tau.line(drive.start_s + drive.period_s * self.n as f64, 1.0);
        }
    }

    #[inline(always)]
    pub fn set_states(&mut self, x: &[N]) {
        for (register, x) in self.registers.iter_mut().zip(x) {
            *register = *x;
        }
    }

    #[inline(always)]
    pub fn set_sigma(&mut self) {
        for &(register, i) in &self.model.sigma_leaves {
            self.registers[register as usize] = self.sigma[i];
        }
    }

    /// Sets inputs and time, and what rests on them only.
    pub fn stimulate<S: Span<N>>(&mut self, moment: &Moment<S>) {
        self.set_inputs(moment.tau);
        self.model.stimulus.run(&mut self.registers, &mut self.cells, moment);
    }

    /// State derivatives with stimulus, states and signs as they are set.
    pub fn flow<S: Span<N>>(&mut self, moment: &Moment<S>, out: &mut [N]) {
        self.model.flow.run(&mut self.registers, &mut self.cells, moment);
        self.take_derivatives(moment, out);
    }

    fn take_derivatives<S: Span<N>>(&self, moment: &Moment<S>, out: &mut [N]) {
        for (to, &register) in out.iter_mut().zip(&self.model.derivatives) {
            *to = self.registers[register as usize];
        }
        if !self.added.is_empty() {
            for (i, to) in out.iter_mut().enumerate() {
                *to = self.added_to(Slot::State(i), moment.tau, *to);
            }
        }
    }

    /// The signs of the modes, where none is stuck.
    #[inline(always)]
    pub fn set_signs(&mut self) {
        if !self.sigma_set {
            for (sigma, mode) in self.sigma.iter_mut().zip(&self.modes) {
                *sigma = N::lift(mode.sign());
            }
            self.set_sigma();
            self.sigma_set = true;
        }
    }

    /// Outputs at the present sample, where no surface is stuck.
    pub fn measure_freely(&mut self, y: &mut [N]) {
        let moment = self.moment(0.0, 0.0, 0.0, Phase::Start);
        self.set_signs();
        self.set_inputs(0.0);
        let x = std::mem::take(&mut self.x);
        self.set_states(&x);
        self.x = x;
        self.measure_here(&moment, y);
    }

    /// Outputs with inputs, states and signs as they are set.
    pub fn measure_here(&mut self, moment: &Moment<f64>, y: &mut [N]) {
        self.model.measure.run(&mut self.registers, &mut self.cells, moment);
        for (j, (y, &register)) in y.iter_mut().zip(&self.model.outputs).enumerate() {
            *y = self.added_to(Slot::Output(j), 0.0, self.registers[register as usize]);
        }
    }
}
