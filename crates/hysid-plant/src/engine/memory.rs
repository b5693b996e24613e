//! Operators with memory: `play`, `relay`, `lag`, `delay`.
//!
//! A cell holds what the operator remembers as of the last commit. Within a step the operator's value follows from the cell,
//! the argument now and the time since the commit; nothing changes until the step is accepted and committed. At the first
//! sample each is at rest: play in the middle of its band, lag settled, delay filled with the first value, relay at -1
//! unless its argument is above the upper threshold.
//!
//! - `lag` is exact for an argument that is linear between commits (so for every input, held or linear).
//! - `delay` of inputs is linear between samples; under a zero-order hold a derivative sees the mean of the held signal over
//!   the step, so that the response moves smoothly with the delay. `delay` of a state interpolates what was committed, by a
//!   cubic where the neighbours are evenly spread.
//! - A half-width, time constant or delay below zero acts as zero.

use crate::expr::Function;
use crate::number::Number;

/// When an operator is evaluated.
#[derive(Debug, Clone, Copy)]
pub(super) struct Moment<N> {
    /// Seconds since the first sample.
    pub elapsed: N,
    /// Seconds since the last commit.
    pub since: N,
    /// Length of the step that is tried; 0 where an output is evaluated.
    pub step: N,
    /// What `since` is.
    pub phase: Phase,
}

/// Where in a step an evaluation stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Phase {
    /// At its start, where a held input has just jumped.
    Start,
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
    follow: Follow,
    /// The first evaluation fills the memory.
    filled: bool,
}

impl<N: Number> Cell<N> {
    pub fn new(follow: Follow) -> Self {
        let zero = N::lift(0.0);
        Self { held: zero, argument: zero, now: (zero, zero), past: Vec::new(), follow, filled: false }
    }

    /// Makes the last evaluation the memory.
    pub fn commit(&mut self, elapsed: N) {
        self.argument = self.now.0;
        self.held = self.now.1;
        if !self.past.is_empty() && self.follow != Follow::Held {
            self.past.push((elapsed, self.now.0));
        }
    }

    #[inline(always)]
    pub fn play(&mut self, w: N, half_width: N) -> N {
        if !self.filled {
            self.filled = true;
            self.held = w;
        }
        let r = half_width.max(N::lift(0.0));
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
    pub fn lag(&mut self, w: N, tau: N, moment: &Moment<N>) -> N {
        let zero = N::lift(0.0);
        if !self.filled {
            self.filled = true;
            self.held = w;
            self.argument = w;
        }
        if moment.phase == Phase::Start {
            // A held input may have jumped: what follows is linear from the new value.
            self.argument = w;
        }
        let tau = tau.max(zero);
        let since = moment.since;
        let safe = since.where_positive(since, N::lift(1.0));
        // Below a thousandth of the time gone the exponential is zero; the time constant then acts by the slope alone.
        let ratio = since.div(tau.max(safe.scale(1e-3)));
        let decay = ratio.neg().call(Function::Exp);
        let slope_tau = w.sub(self.argument).div(safe).mul(tau);
        let start = self.held.sub(self.argument).add(slope_tau);
        let moved = w.sub(slope_tau).add(start.mul(decay));
        let still = self.held.where_positive(tau, w);
        let value = moved.where_positive(since, still);
        self.now = (w, value);
        value
    }

    pub fn delay(&mut self, w: N, seconds: N, moment: &Moment<N>) -> N {
        if self.past.is_empty() {
            self.past.push((moment.elapsed, w));
            self.argument = w;
        }
        if moment.phase == Phase::Start {
            self.argument = w;
            if self.follow == Follow::Held {
                // The same start may be tried again with a shorter step.
                match self.past.last_mut() {
                    Some(last) if last.0.value() >= moment.elapsed.value() => *last = (moment.elapsed, w),
                    _ => self.past.push((moment.elapsed, w)),
                }
            }
        }
        let seconds = seconds.max(N::lift(0.0));
        self.now = (w, w);
        if self.follow == Follow::Held && moment.step.value() > 0.0 {
            return self.mean_of_held(seconds, moment);
        }
        let target = moment.elapsed.sub(seconds);
        let committed = moment.elapsed.sub(moment.since);
        if self.follow != Follow::Held && target.value() >= committed.value() {
            // Within the step that is tried.
            let since = moment.since;
            if since.value() <= 0.0 {
                return self.before(target, w, moment.elapsed);
            }
            let share = target.sub(committed).div(since);
            return self.argument.add(w.sub(self.argument).mul(share));
        }
        self.before(target, w, moment.elapsed)
    }

    /// The mean of the held argument over the step, `seconds` ago.
    fn mean_of_held(&self, seconds: N, moment: &Moment<N>) -> N {
        let start = moment.elapsed.sub(moment.since).sub(seconds);
        let end = start.add(moment.step);
        let from = self.past.partition_point(|p| p.0.value() < start.value()).saturating_sub(1);
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
        sum.div(moment.step)
    }

    /// The argument at a time before the last commit.
    fn before(&self, target: N, w: N, now: N) -> N {
        let next = self.past.partition_point(|p| p.0.value() <= target.value());
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
