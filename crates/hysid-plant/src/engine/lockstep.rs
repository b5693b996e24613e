//! Several runs of one model in lanes: one pass through the programs moves them all by a step.
//!
//! What needs decisions of its own is done by a machine for that lane alone: a step with a switching event, and the motion
//! while a surface is stuck. A lane's numbers are bit for bit those of its run by itself.

use super::Compiled;
use super::machine::Machine;
use super::run::{Direction, Response, Run, Tangents};
use super::surface::Mode;
use super::trajectory::empty;
use crate::number::{Lanes, Number};

/// Who moves a lane.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Lane {
    /// All together.
    Shared,
    /// Its own machine, while a surface is stuck.
    Apart,
    /// Nobody: it has diverged, or repeats another to fill up.
    Done,
}

/// Up to `L` runs of one drive with the same steps, no observer and no injected values.
pub(super) struct Lockstep<'a, const L: usize, const T: usize> {
    together: Machine<'a, Lanes<L, T>>,
    alone: Vec<Machine<'a, Lanes<1, T>>>,
    lanes: Vec<Lane>,
}

impl<'a, const L: usize, const T: usize> Lockstep<'a, L, T> {
    /// At the first sample; `runs` are at most `L`, and for each run of `alone` one machine stands ready.
    pub fn new(model: &'a Compiled, runs: &'a [Run<'a>], directions: &'a [Direction<'a>]) -> Option<Self> {
        let together = Machine::new(model, runs, directions)?;
        let switching = !model.surfaces.is_empty();
        let alone = runs.iter().filter(|_| switching);
        let alone = alone.map(|run| Machine::new(model, std::slice::from_ref(run), directions));
        let lanes = (0..L).map(|l| if l < runs.len() { Lane::Shared } else { Lane::Done }).collect();
        Some(Self { together, alone: alone.collect::<Option<_>>()?, lanes })
    }

    /// Runs over all samples; one result for each lane, those that only fill up too.
    pub fn run(mut self) -> Vec<(Response, Tangents)> {
        let (len, outputs) = (self.together.run.drive.len, self.together.model.outputs.len());
        let (states, directions) = (self.together.x.len(), self.together.directions);
        let mut all: Vec<(Response, Tangents)> = (0..L)
            .map(|_| (empty(outputs, states, len), vec![vec![vec![f64::NAN; len]; outputs]; directions]))
            .collect();
        let substeps = self.together.substeps();
        let step = self.together.run.drive.period_s / substeps as f64;
        let mut y = vec![Lanes::lift(0.0); outputs];
        let mut own = vec![Lanes::lift(0.0); outputs];
        self.together.sigma_set = true;
        for lane in 0..self.alone.len() {
            self.alone[lane].refresh();
            self.lanes[lane] = if self.alone[lane].any_stuck { Lane::Apart } else { Lane::Shared };
            self.take_signs(lane);
        }
        self.together.set_sigma();
        for n in 0..len {
            self.together.go_to(n);
            self.together.measure_freely(&mut y);
            for (lane, (response, tangents)) in all.iter_mut().enumerate() {
                if self.lanes[lane] == Lane::Apart {
                    let machine = &mut self.alone[lane];
                    machine.go_to(n);
                    machine.measure(&mut own);
                    y.iter_mut().zip(&own).for_each(|(y, own)| y.set_lane(lane, *own));
                    let (x, own) = (&mut self.together.x, &self.alone[lane].x);
                    x.iter_mut().zip(own).for_each(|(x, own)| x.set_lane(lane, *own));
                }
                if self.lanes[lane] == Lane::Done {
                    continue;
                }
                let of_lane = |v: &Lanes<L, T>| v.value_of(lane);
                if response.ends_at(n, y.iter().map(of_lane), self.together.x.iter().map(of_lane)) {
                    self.lanes[lane] = Lane::Done;
                    continue;
                }
                for (to, y) in response.outputs.iter_mut().zip(&y) {
                    to[n] = y.value_of(lane);
                }
                for (to, x) in response.states.iter_mut().zip(&self.together.x) {
                    to[n] = x.value_of(lane);
                }
                for (k, to) in tangents.iter_mut().enumerate() {
                    for (to, y) in to.iter_mut().zip(&y) {
                        to[n] = y.tangent_of(lane, k);
                    }
                }
            }
            if n + 1 == len || self.lanes.iter().all(|lane| *lane == Lane::Done) {
                break;
            }
            for s in 0..substeps {
                self.advance(step * s as f64, step);
            }
        }
        all
    }

    fn advance(&mut self, tau: f64, h: f64) {
        if self.alone.is_empty() {
            self.together.step(tau, h);
            self.together.accept(tau, h);
            return;
        }
        let mut fired = [false; L];
        if self.lanes.contains(&Lane::Shared) {
            self.together.step(tau, h);
            fired = self.fired(tau, h);
            for lane in (0..L).filter(|&l| fired[l]) {
                self.leave(lane, tau, h);
            }
            self.together.accept(tau, h);
        }
        for lane in 0..self.alone.len() {
            if self.lanes[lane] == Lane::Apart {
                self.follow(lane);
                self.alone[lane].advance(tau, h);
            }
            if fired[lane] || self.lanes[lane] == Lane::Apart {
                self.come_back(lane);
            }
        }
    }

    /// Makes the present sample that of a lane's own machine.
    fn follow(&mut self, lane: usize) {
        if self.alone[lane].n != self.together.n {
            self.alone[lane].go_to(self.together.n);
        }
    }

    /// The shared lanes in which a surface is crossed on the way to `trial`.
    fn fired(&mut self, tau: f64, h: f64) -> [bool; L] {
        let machine = &mut self.together;
        let model = machine.model;
        if !model.plain_surfaces {
            let trial = std::mem::take(&mut machine.trial);
            machine.set_states(&trial);
            machine.trial = trial;
            let moment = machine.moment(tau + h, h, h, super::memory::Phase::Inside);
            machine.set_inputs(moment.tau);
            model.switches.run(&mut machine.registers, &mut machine.cells, &moment);
        }
        let mut fired = [false; L];
        for (i, sigma) in machine.sigma.iter().enumerate() {
            let argument = machine.argument(i);
            let (sigma, argument) = (sigma.values(), argument.values());
            for lane in 0..L {
                fired[lane] |= sigma[lane] * argument[lane] < 0.0;
            }
        }
        for (fired, lane) in fired.iter_mut().zip(&self.lanes) {
            *fired &= *lane == Lane::Shared;
        }
        fired
    }

    /// Hands a lane that has crossed a surface to its own machine, which moves it.
    #[inline(never)]
    fn leave(&mut self, lane: usize, tau: f64, h: f64) {
        self.follow(lane);
        let (together, alone) = (&self.together, &mut self.alone[lane]);
        for (own, x) in alone.x.iter_mut().zip(&together.x) {
            *own = x.lane(lane);
        }
        for (own, cell) in alone.cells.iter_mut().zip(&together.cells) {
            *own = cell.lane(lane);
        }
        let sigma = together.sigma.iter().enumerate();
        let distances = sigma.map(|(i, sigma)| sigma.value_of(lane) * together.argument(i).value_of(lane));
        alone.advance_through_events(tau, h, distances);
    }

    /// Takes a lane back from its own machine where no surface is stuck.
    #[inline(never)]
    fn come_back(&mut self, lane: usize) {
        let (together, alone) = (&mut self.together, &self.alone[lane]);
        if alone.any_stuck {
            self.lanes[lane] = Lane::Apart;
            return;
        }
        self.lanes[lane] = Lane::Shared;
        for (x, own) in together.x.iter_mut().zip(&alone.x) {
            x.set_lane(lane, *own);
        }
        for (cell, own) in together.cells.iter_mut().zip(&alone.cells) {
            cell.set_lane(lane, own);
        }
        self.take_signs(lane);
        self.together.set_sigma();
    }

    fn take_signs(&mut self, lane: usize) {
        for (sigma, mode) in self.together.sigma.iter_mut().zip(&self.alone[lane].modes) {
            // A stuck lane is not moved here; its sign only must not fire.
            let sign = if *mode == Mode::Stuck { 0.0 } else { mode.sign() };
            *sigma = sigma.with_value(lane, sign);
        }
    }
}

impl<const L: usize, const T: usize> Machine<'_, Lanes<L, T>> {
    /// The argument of a surface at `trial`.
    #[inline(always)]
    fn argument(&self, surface: usize) -> Lanes<L, T> {
        let nodes = &self.model.surfaces[surface];
        match nodes.state {
            Some(i) if self.model.plain_surfaces => self.trial[i as usize],
            _ => self.registers[nodes.argument as usize],
        }
    }
}
