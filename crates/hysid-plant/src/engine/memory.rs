//! Operators with memory: `play`, `relay`, `lag`, `delay`.
//!
//! A cell holds what the operator remembers as of the last commit. Within a step the operator's value follows from the cell,
//! the argument now and the time since the commit; nothing changes until the step is accepted and committed. At the first
//! sample each is as a machine that was at rest: play came from 0 (the initial output of the field's literature), lag settled, delay filled with the first
//! value, relay at -1 unless its argument is above the upper threshold.
//!
//! - `lag` is exact for an argument that is linear between commits (so for every input, held or linear); within a
//!   step a derivative sees what makes the step's integrals exact, however short the time constant.
//! - `delay` of inputs is linear between samples; under a zero-order hold a derivative sees the mean of the held signal over
//!   the step, so that the response moves smoothly with the delay. Where friction may stick, steps end where the delayed signal
//!   jumps or bends. `delay` of a state interpolates what was committed, by a cubic where the neighbours are evenly spread.
//! - A half-width, time constant or delay below zero acts as zero.

use crate::expr::Function;
use crate::number::{Lanes, Number, Span};

/// When an operator is evaluated; `S` is a plain length of time or one with tangents.
#[derive(Debug, Clone, Copy)]
pub(super) struct Moment<S> {
    /// Seconds from the first sample to the present one.
    pub sample_s: f64,
    /// Seconds since the present sample.
    pub tau: S,
    /// Seconds since the last commit.
    pub since: S,
    /// Length of the step that is tried; 0 where an output is evaluated.
    pub step: S,
    /// What `since` is.
    pub phase: Phase,
}

impl<S> Moment<S> {
    /// Seconds since the first sample.
    fn elapsed<N>(&self) -> N
    where
        S: Span<N>,
    {
        self.tau.line(self.sample_s, 1.0)
    }

    /// Whether this is the middle stage of a step.
    fn midway<N>(&self) -> bool
    where
        S: Span<N>,
    {
        let (since, step) = (self.since.value(), self.step.value());
        step > 0.0 && (2.0 * since - step).abs() <= 1e-9 * step
    }
}

/// Where in a step an evaluation stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Phase {
    /// At its start, where a held input has just jumped.
    Start,
    /// At a moment at which the motion is decided anew.
    Event,
    /// Later.
    Inside,
}

/// What the argument of a delay does between samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Follow {
    /// It is held.
    Held,
    /// It is made of inputs that are linear between samples.
    Linear,
    /// It rests on states.
    Smooth,
}

/// What a length of time does to a lag.
#[derive(Debug, Clone, Copy)]
struct Decay<N> {
    since: f64,
    /// The time constant over the length.
    ratio: N,
    /// What is left of a difference after the length.
    decay: N,
    /// What the first and the middle stages of a Runge-Kutta step of this length see of the difference.
    seen: (N, N),
}

impl<N: Number> Decay<N> {
    fn new<S: Span<N>>(since: S, tau: N) -> Self {
        let length = since.seconds();
        // Below a thousandth of the time gone the exponential is zero; the time constant then acts by the slope alone.
        let decay = length.div(tau.max(length.scale(1e-3))).neg().call(Function::Exp);
        let ratio = tau.div(length);
        Self { since: since.value(), ratio, decay, seen: Self::seen(ratio, decay) }
    }

    /// What the stages see, so that the step integrates the difference exactly, once and twice. A lag shorter than the step has a transient
    /// that passes between the stages; with its values there the response would not move with the time constant.
    fn seen(ratio: N, decay: N) -> (N, N) {
        // The step over the time constant where it is small: there the differences would be rounding, and their series is exact.
        let long = N::lift(1e3);
        let z = N::lift(1.0).div(ratio.max(long));
        let series =
            |by_order: [f64; 4]| by_order.into_iter().rev().fold(N::lift(0.0), |sum, c| sum.mul(z).add(N::lift(c)));
        let beyond = ratio.sub(long);
        let once = series([1.0, -1.0 / 2.0, 1.0 / 6.0, -1.0 / 24.0])
            .where_positive(beyond, ratio.min(long).mul(N::lift(1.0).sub(decay)));
        let twice = series([1.0 / 2.0, -1.0 / 6.0, 1.0 / 24.0, -1.0 / 120.0])
            .where_positive(beyond, ratio.min(long).mul(N::lift(1.0).sub(once)));
        let middle = once.scale(3.0).sub(twice.scale(3.0)).sub(decay.scale(0.5));
        (twice.scale(6.0).sub(middle.scale(2.0)), middle)
    }
}

/// One operator's memory.
#[derive(Debug, Clone)]
pub(super) struct Cell<N> {
    /// The output at the last commit.
    held: N,
    /// The argument at the last commit (after a jump of a held input).
    argument: N,
    /// The argument at this evaluation and the output that followed, to be committed.
    now: (N, N),
    /// Committed arguments with their times (delays only).
    past: Vec<(N, N)>,
    /// Where in `past` the last look-up ended.
    hint: usize,
    /// Of a lag: what a plain length of time does, for the lengths that were met last.
    decays: [Option<Decay<N>>; 2],
    /// Of a delay: how long it was when it was asked last.
    seconds: Option<N>,
    follow: Follow,
    /// The first evaluation fills the memory.
    filled: bool,
}

impl<const L: usize, const T: usize> Cell<Lanes<L, T>> {
    /// What one lane remembers, without the past of a delay.
    pub fn lane(&self, lane: usize) -> Cell<Lanes<1, T>> {
        Cell {
            held: self.held.lane(lane),
            argument: self.argument.lane(lane),
            now: (self.now.0.lane(lane), self.now.1.lane(lane)),
            filled: self.filled,
            ..Cell::new(self.follow)
        }
    }

    /// Makes one lane remember what another memory does, without the past of a delay.
    pub fn set_lane(&mut self, lane: usize, from: &Cell<Lanes<1, T>>) {
        self.held.set_lane(lane, from.held);
        self.argument.set_lane(lane, from.argument);
        self.now.0.set_lane(lane, from.now.0);
        self.now.1.set_lane(lane, from.now.1);
    }
}

impl<N: Number> Cell<N> {
    pub fn new(follow: Follow) -> Self {
        let zero = N::lift(0.0);
        Self {
            held: zero,
            argument: zero,
            now: (zero, zero),
            past: Vec::new(),
            hint: 0,
            decays: [None; 2],
            seconds: None,
            follow,
            filled: false,
        }
    }

    /// Makes the last evaluation the memory.
    #[inline(always)]
    pub fn commit<S: Span<N>>(&mut self, moment: &Moment<S>) {
        self.argument = self.now.0;
        self.held = self.now.1;
        if !self.past.is_empty() && self.follow != Follow::Held {
            self.past.push((moment.elapsed(), self.now.0));
        }
    }

    #[inline(always)]
    pub fn play(&mut self, w: N, half_width: N) -> N {
        let r = half_width.max(N::lift(0.0));
        if !self.filled {
            self.filled = true;
            self.held = N::lift(0.0).max(w.sub(r)).min(w.add(r));
        }
        let value = self.held.max(w.sub(r)).min(w.add(r));
        self.now = (w, value);
        value
    }

    #[inline(always)]
    pub fn relay(&mut self, w: N, lower: N, upper: N) -> N {
        let (low, high) = (N::lift(-1.0), N::lift(1.0));
        if !self.filled {
            self.filled = true;
            self.held = low;
        }
        let kept = low.where_positive(lower.sub(w), self.held);
        let value = high.where_positive(w.sub(upper), kept);
        self.now = (w, value);
        value
    }

    #[inline(always)]
    pub fn lag<S: Span<N>>(&mut self, w: N, tau: N, moment: &Moment<S>) -> N {
        if !self.filled {
            self.filled = true;
            self.held = w;
            self.argument = w;
        }
        if moment.phase == Phase::Start {
            // A held input may have jumped: what follows is linear from the new value.
            self.argument = w;
        }
        let tau = tau.max(N::lift(0.0));
        let (since, step) = (moment.since.value(), moment.step.value());
        let value = if since > 0.0 {
            let gone = self.decay(moment.since, tau);
            let slope_tau = w.sub(self.argument).mul(gone.ratio);
            let start = self.held.sub(self.argument).add(slope_tau);
            let left = if moment.midway() { self.decay(moment.step, tau).seen.1 } else { gone.decay };
            w.sub(slope_tau).add(start.mul(left))
        } else if step > 0.0 && moment.phase == Phase::Start {
            w.add(self.held.sub(w).mul(self.decay(moment.step, tau).seen.0))
        } else {
            self.held.where_positive(tau, w)
        };
        self.now = (w, value);
        value
    }

    /// A time constant does not change in a run, so what a plain length of time does is kept.
    #[inline(always)]
    fn decay<S: Span<N>>(&mut self, since: S, tau: N) -> Decay<N> {
        if !S::PLAIN {
            return Decay::new(since, tau);
        }
        let wanted = since.value();
        match self.decays {
            [Some(known), _] | [_, Some(known)] if known.since == wanted => known,
            _ => self.met(since, tau),
        }
    }

    /// A length that was not met before.
    #[inline(never)]
    fn met<S: Span<N>>(&mut self, since: S, tau: N) -> Decay<N> {
        let new = Decay::new(since, tau);
        self.decays = [Some(new), self.decays[0]];
        new
    }

    pub fn delay<S: Span<N>>(&mut self, w: N, seconds: N, moment: &Moment<S>) -> N {
        let elapsed = moment.elapsed();
        if self.past.is_empty() {
            self.past.push((elapsed, w));
            self.argument = w;
        }
        if moment.phase == Phase::Start {
            self.argument = w;
            if self.follow == Follow::Held {
                // The same start may be tried again with a shorter step.
                match self.past.last_mut() {
                    Some(last) if last.0.value() >= elapsed.value() => *last = (elapsed, w),
                    _ => self.past.push((elapsed, w)),
                }
            }
        }
        let seconds = seconds.max(N::lift(0.0));
        self.seconds = Some(seconds);
        self.now = (w, w);
        let since = moment.since.seconds();
        if self.follow == Follow::Held && moment.phase == Phase::Event {
            return self.held_at(elapsed.sub(seconds), w, elapsed);
        }
        if self.follow == Follow::Held && moment.step.value() > 0.0 {
            return self.mean_of_held(elapsed.sub(since).sub(seconds), moment.step.seconds());
        }
        let target = elapsed.sub(seconds);
        let committed = elapsed.sub(since);
        if self.follow != Follow::Held && target.value() >= committed.value() {
            // Within the step that is tried.
            if since.value() <= 0.0 {
                return self.before(target, w, elapsed);
            }
            let share = target.sub(committed).div(since);
            return self.argument.add(w.sub(self.argument).mul(share));
        }
        self.before(target, w, elapsed)
    }

    /// When a signal that is held, or bends, every `period` next does so behind this delay, later than `from` and before `until` (seconds from
    /// the first sample).
    pub fn next_jump(&self, period: f64, from: f64, until: f64) -> Option<N> {
        let seconds = self.seconds.filter(|_| self.follow != Follow::Smooth)?;
        // Before the first sample everything is at rest.
        let knot = ((from - seconds.value()) / period).floor().max(0.0) + 1.0;
        let at = seconds.add(N::lift(knot * period));
        (at.value() < until).then_some(at)
    }

    /// How many of the past's times the test holds for, where it holds up to some time.
    #[inline(always)]
    fn count(&mut self, test: impl Fn(f64) -> bool) -> usize {
        // Times go on, so the last answer is near.
        let mut next = self.hint.min(self.past.len());
        while self.past.get(next).is_some_and(|p| test(p.0.value())) {
            next += 1;
        }
        while next > 0 && !self.past.get(next - 1).is_some_and(|p| test(p.0.value())) {
            next -= 1;
        }
        self.hint = next;
        next
    }

    /// The held argument at a time, after the jump where it jumps there; `w` is what it is `now`.
    fn held_at(&mut self, target: N, w: N, now: N) -> N {
        let reached = target.value() + 1e-12 * now.value();
        if reached >= now.value() {
            return w;
        }
        let next = self.count(|time| time <= reached);
        self.past.get(next.saturating_sub(1)).map_or(w, |knot| knot.1)
    }

    /// The mean of the held argument over `length` from `start`.
    fn mean_of_held(&mut self, start: N, length: N) -> N {
        let end = start.add(length);
        let from = self.count(|time| time < start.value()).saturating_sub(1);
        let mut sum = N::lift(0.0);
        for (i, (time, w)) in self.past.iter().enumerate().skip(from) {
            if time.value() > end.value() {
                break;
            }
            let lower = if i == 0 { start } else { time.max(start) };
            let upper = match self.past.get(i + 1) {
                Some((next, _)) => end.min(*next),
                None => end,
            };
            if upper.value() >= lower.value() {
                sum = sum.add(w.mul(upper.sub(lower)));
            }
        }
        if self.past.first().is_some_and(|p| p.0.value() > end.value()) {
            return self.past.first().map_or(sum, |p| p.1);
        }
        sum.div(length)
    }

    /// The argument at a time before the last commit.
    fn before(&mut self, target: N, w: N, now: N) -> N {
        let next = self.count(|time| time <= target.value());
        let (Some(a), b) = (next.checked_sub(1).and_then(|i| self.past.get(i)), self.past.get(next)) else {
            // At rest before the first sample.
            return self.past.first().map_or(w, |p| p.1);
        };
        let Some(b) = b else {
            // Beyond what is committed: towards the argument now.
            let gap = now.sub(a.0);
            if gap.value() <= 0.0 {
                // The slope in the delay is that of the last interval.
                let Some(z) = next.checked_sub(2).and_then(|i| self.past.get(i)) else { return w };
                let back = target.sub(a.0).div(a.0.sub(z.0));
                return w.add(a.1.sub(z.1).mul(back));
            }
            return a.1.add(w.sub(a.1).mul(target.sub(a.0).div(gap)));
        };
        let share = target.sub(a.0).div(b.0.sub(a.0));
        let line = a.1.add(b.1.sub(a.1).mul(share));
        let outer = (next.checked_sub(2).and_then(|i| self.past.get(i)), self.past.get(next + 1));
        let (Follow::Smooth, (Some(z), Some(c))) = (self.follow, outer) else { return line };
        let gaps = [a.0.value() - z.0.value(), b.0.value() - a.0.value(), c.0.value() - b.0.value()];
        let least = gaps.iter().copied().fold(f64::INFINITY, f64::min);
        let most = gaps.iter().copied().fold(0.0, f64::max);
        if least < 0.2 * most {
            return line;
        }
        // Lagrange's cubic through z, a, b, c.
        let points = [z, a, b, c];
        let mut sum = N::lift(0.0);
        for (i, p) in points.iter().enumerate() {
            let mut weight = N::lift(1.0);
            for (j, q) in points.iter().enumerate() {
                if i != j {
                    weight = weight.mul(target.sub(q.0).div(p.0.sub(q.0)));
                }
            }
            sum = sum.add(p.1.mul(weight));
        }
        sum
    }
}
