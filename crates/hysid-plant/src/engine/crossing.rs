//! Where on the way through a step a switching surface is crossed.

use super::machine::Machine;
use super::surface::Mode;
use crate::number::{Single, Span};

/// How near to a crossing the search goes, as a share of the step's way across; Newton's correction squares it.
const NEAR: f64 = 1e-6;
/// Correction, as a share of the step, that Newton's method makes along the tangent at once, and steps in which it must come so near.
const CLOSE: f64 = 1e-5;
const NEWTON: usize = 4;
/// Iterations for the root of a step's own polynomial, which is only where the search begins.
const REFINED: usize = 6;

/// A crossing on the way through a step, with `trial` the state there.
pub(super) struct Crossing<N, S> {
    /// Seconds after the step's begin.
    pub length: S,
    pub surface: usize,
    /// The derivative of that moment that the length does not carry, as a number without a value.
    pub moved: N,
}

impl<N: Single> Machine<'_, N> {
    /// The first crossing after `tau` within `rest`, at the end of which, in `trial`, the surfaces are at these distances; none where a surface is left only
    /// to return to it at once.
    pub fn cross<S: Span<N>>(&mut self, tau: S, rest: S, at_end: &[f64]) -> Option<Crossing<N, S>> {
        let whole = rest.value();
        let begun = self.foreseen(whole, at_end);
        if let Some(found) = begun.and_then(|(at, surface)| self.by_newton(tau, at, whole, surface)) {
            return Some(found);
        }
        let (at, surface) = self.locate(whole, at_end)?;
        if self.modes[surface] != Mode::Stuck
            && let Some(found) = self.by_newton(tau, at, whole, surface)
        {
            return Some(found);
        }
        let length = S::of(N::lift(at));
        self.step(tau, length);
        Some(Crossing { length, surface, moved: N::lift(0.0) })
    }

    /// Where the polynomial of the step that has just been tried puts the crossing of the only surface that fired, where its argument is a state (the continuous
    /// extension of order 3; E. Hairer, S. P. Norsett and G. Wanner, Solving Ordinary Differential Equations I, section II.6).
    fn foreseen(&self, rest: f64, at_end: &[f64]) -> Option<(f64, usize)> {
        let mut fired = (0..at_end.len()).filter(|&i| at_end[i] < 0.0);
        let (surface, None) = (fired.next()?, fired.next()) else { return None };
        let state = self.model.surfaces[surface].state? as usize;
        let sign = self.modes[surface].sign();
        let [k1, k2, k3, k4] = self.stages.each_ref().map(|k| sign * rest * k[state].value());
        let (start, middle) = (sign * self.x[state].value(), k2 + k3);
        let (square, cube) = (middle - 1.5 * k1 - 0.5 * k4, (k1 - middle + k4) / 1.5);
        // Just left, or stuck, it is looked for on the way.
        if !(start > NEAR * -at_end[surface]) {
            return None;
        }
        let (mut low, mut high) = (0.0, 1.0);
        let mut share = start / (start - at_end[surface]);
        for _ in 0..REFINED {
            let value = start + share * (k1 + share * (square + share * cube));
            if value > 0.0 {
                low = share;
            } else {
                high = share;
            }
            let slope = k1 + share * (2.0 * square + share * 3.0 * cube);
            let next = share - value / slope;
            share = if next > low && next < high { next } else { 0.5 * (low + high) };
        }
        Some((share * rest, surface))
    }

    /// A crossing by Newton's method. The last correction of a plain length is made along the tangent, which also tells what moves the moment.
    fn by_newton<S: Span<N>>(&mut self, tau: S, begun: f64, whole: f64, surface: usize) -> Option<Crossing<N, S>> {
        let mut at = begun;
        for _ in 0..NEWTON {
            let (s, rate) = self.argument_after(surface, tau, S::of(N::lift(at)));
            let correction = s.div(N::lift(rate));
            let length = N::lift(at).sub(correction);
            if correction.value().abs() <= CLOSE * whole {
                let (length, moved) = (S::of(length), length.sub(N::lift(length.value())));
                if S::PLAIN {
                    self.trial.iter_mut().zip(&self.spare).for_each(|(x, k)| *x = x.sub(k.mul(correction)));
                } else {
                    self.step(tau, length);
                }
                return Some(Crossing { length, surface, moved });
            }
            at = length.value();
            if !(at > 0.0 && at < whole) {
                return None;
            }
        }
        None
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
    pub fn locate(&mut self, whole: f64, at_end: &[f64]) -> Option<(f64, usize)> {
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
