//! The numbers that equations are evaluated in: values and their tangents, of one run or of several in lanes.
//!
//! Derivatives are defined on purpose where a function has none: `abs`, `sign` and `step` have derivative 0 at their kinks and
//! jumps; `floor` has the slope of its mean, 1, since its own, 0, would hide what is behind a converter from every fit; `min` and
//! `max` follow their first argument in a tie; a root or a power whose slope at 0 is infinite has slope 0 there, and the slope of
//! `a^b` in `b` is 0 at `a = 0`. Values follow IEEE 754: what is not finite ends a simulation.

mod functions;
mod lanes;

use crate::expr::Function;

pub(crate) use functions::sign;
pub(crate) use lanes::Lanes;

/// What the engine needs of a number.
pub(crate) trait Number: Copy + Send + Sync + std::fmt::Debug + 'static {
    /// Whether vector instructions pay.
    const WIDE: bool;
    fn lift(x: f64) -> Self;
    fn add(self, other: Self) -> Self;
    fn sub(self, other: Self) -> Self;
    fn mul(self, other: Self) -> Self;
    fn div(self, other: Self) -> Self;
    fn neg(self) -> Self;
    fn scale(self, factor: f64) -> Self;
    fn call(self, function: Function) -> Self;
    fn abs(self) -> Self;
    fn powi(self, n: i32) -> Self;
    fn pow(self, exponent: Self) -> Self;
    fn atan2(self, other: Self) -> Self;
    fn min(self, other: Self) -> Self;
    fn max(self, other: Self) -> Self;
    /// The number where the value of `test` is positive, else `other`.
    fn where_positive(self, test: Self, other: Self) -> Self;
    /// The value of a lane.
    fn value_of(self, lane: usize) -> f64;
    /// The derivative of a lane's value in direction `k`.
    fn tangent_of(self, lane: usize, k: usize) -> f64;
    /// The number with another value in one lane.
    fn with_value(self, lane: usize, value: f64) -> Self;
    /// The number with `slope` added to tangent `k` in every lane.
    fn add_tangent(self, k: usize, slope: f64) -> Self;
    /// The value of the first lane. Control flow rests on it only where there is one lane or all agree.
    #[inline(always)]
    fn value(self) -> f64 {
        self.value_of(0)
    }
    /// The derivative of the first lane.
    #[inline(always)]
    fn tangent(self, k: usize) -> f64 {
        self.tangent_of(0, k)
    }
}

/// A number with one value, on which control flow can rest.
pub(crate) trait Single: Number {}

/// A length of time: plain, or one that carries tangents (up to a located event).
pub(crate) trait Span<N>: Copy {
    /// Whether it has no tangents.
    const PLAIN: bool;
    /// Of a number, whose tangents a plain one leaves out.
    fn of(seconds: N) -> Self;
    fn seconds(self) -> N;
    fn value(self) -> f64;
    fn times(self, x: N) -> N;
    fn plus(self, other: Self) -> Self;
    fn minus(self, other: Self) -> Self;
    fn part(self, share: f64) -> Self;
    /// `level + slope * self`.
    fn line(self, level: f64, slope: f64) -> N;
}

impl<N: Number> Span<N> for f64 {
    const PLAIN: bool = true;
    #[inline(always)]
    fn of(seconds: N) -> Self {
        seconds.value()
    }
    #[inline(always)]
    fn seconds(self) -> N {
        N::lift(self)
    }
    #[inline(always)]
    fn value(self) -> f64 {
        self
    }
    #[inline(always)]
    fn times(self, x: N) -> N {
        x.scale(self)
    }
    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        self + other
    }
    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        self - other
    }
    #[inline(always)]
    fn part(self, share: f64) -> Self {
        self * share
    }
    #[inline(always)]
    fn line(self, level: f64, slope: f64) -> N {
        N::lift(level + self * slope)
    }
}

impl<N: Number> Span<N> for N {
    const PLAIN: bool = false;
    #[inline(always)]
    fn of(seconds: Self) -> Self {
        seconds
    }
    #[inline(always)]
    fn seconds(self) -> Self {
        self
    }
    #[inline(always)]
    fn value(self) -> f64 {
        Number::value(self)
    }
    #[inline(always)]
    fn times(self, x: Self) -> Self {
        self.mul(x)
    }
    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        self.add(other)
    }
    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        self.sub(other)
    }
    #[inline(always)]
    fn part(self, share: f64) -> Self {
        self.scale(share)
    }
    #[inline(always)]
    fn line(self, level: f64, slope: f64) -> Self {
        Self::lift(level).add(self.scale(slope))
    }
}
