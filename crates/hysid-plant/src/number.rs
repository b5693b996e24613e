//! The numbers that equations are evaluated in: plain `f64` and `f64` with tangents.
//!
//! Derivatives are defined on purpose where a function has none: `abs`, `sign`, `step` and `floor` have derivative 0 at their
//! kinks and jumps; `min` and `max` follow their first argument in a tie; a root or a power whose slope at 0 is infinite has
//! slope 0 there, and the slope of `a^b` in `b` is 0 at `a = 0`. Values follow IEEE 754: what is not finite ends a simulation.

use crate::expr::Function;

/// -1, 0 or 1; `NaN` for `NaN`.
pub(crate) fn sign(x: f64) -> f64 {
    if x > 0.0 {
        1.0
    } else if x < 0.0 {
        -1.0
    } else {
        x * 0.0
    }
}

/// `a^n` by repeated multiplication, the same on every machine.
pub(crate) fn powi(a: f64, n: i32) -> f64 {
    let (mut base, mut left, mut result) = (a, n.unsigned_abs(), 1.0);
    while left > 0 {
        if left & 1 == 1 {
            result *= base;
        }
        base *= base;
        left >>= 1;
    }
    if n < 0 { 1.0 / result } else { result }
}

/// A function of one argument.
#[inline(always)]
pub(crate) fn value(function: Function, x: f64) -> f64 {
    match function {
        Function::Sin => x.sin(),
        Function::Cos => x.cos(),
        Function::Tan => x.tan(),
        Function::Asin => x.asin(),
        Function::Acos => x.acos(),
        Function::Atan => x.atan(),
        Function::Sinh => x.sinh(),
        Function::Cosh => x.cosh(),
        Function::Tanh => x.tanh(),
        Function::Exp => x.exp(),
        Function::Ln => x.ln(),
        Function::Log10 => x.log10(),
        Function::Sqrt => x.sqrt(),
        Function::Abs => x.abs(),
        Function::Sign => sign(x),
        Function::Floor => x.floor(),
        Function::Step => f64::from(u8::from(x > 0.0)),
        // Functions of two arguments have operations of their own.
        Function::Atan2 | Function::Min | Function::Max => f64::NAN,
    }
}

/// A function of one argument and its derivative, by the conventions above.
#[inline(always)]
pub(crate) fn value_and_slope(function: Function, x: f64) -> (f64, f64) {
    let finite = |slope: f64| if slope.is_finite() { slope } else { 0.0 };
    let y = value(function, x);
    let slope = match function {
        Function::Sin => x.cos(),
        Function::Cos => -x.sin(),
        Function::Tan => 1.0 + y * y,
        Function::Asin => finite(1.0 / (1.0 - x * x).sqrt()),
        Function::Acos => finite(-1.0 / (1.0 - x * x).sqrt()),
        Function::Atan => 1.0 / (1.0 + x * x),
        Function::Sinh => x.cosh(),
        Function::Cosh => x.sinh(),
        Function::Tanh => 1.0 - y * y,
        Function::Exp => y,
        Function::Ln => finite(1.0 / x),
        Function::Log10 => finite(1.0 / (x * std::f64::consts::LN_10)),
        Function::Sqrt => finite(0.5 / y),
        Function::Abs => sign(x),
        Function::Sign | Function::Floor | Function::Step => 0.0,
        Function::Atan2 | Function::Min | Function::Max => f64::NAN,
    };
    (y, slope)
}

/// What the tape needs of a number.
pub(crate) trait Number: Copy + Send + Sync + std::fmt::Debug + 'static {
    fn lift(x: f64) -> Self;
    fn add(self, other: Self) -> Self;
    fn sub(self, other: Self) -> Self;
    fn mul(self, other: Self) -> Self;
    fn div(self, other: Self) -> Self;
    fn neg(self) -> Self;
    fn scale(self, factor: f64) -> Self;
    fn call(self, function: Function) -> Self;
    fn powi(self, n: i32) -> Self;
    fn pow(self, exponent: Self) -> Self;
    fn atan2(self, other: Self) -> Self;
    fn min(self, other: Self) -> Self;
    fn max(self, other: Self) -> Self;
    /// The number where the value of `test` is positive, else `other`.
    fn where_positive(self, test: Self, other: Self) -> Self;
    /// The value.
    fn value(self) -> f64;
}

/// A number with one value, on which control flow can rest.
pub(crate) trait Single: Number {
    /// Whether vector instructions pay.
    const WIDE: bool;
    fn tangent(self, k: usize) -> f64;
    /// `self` with `slope` added to tangent `k`.
    fn add_tangent(self, k: usize, slope: f64) -> Self;
}

impl Number for f64 {
    #[inline(always)]
    fn lift(x: f64) -> Self {
        x
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self + other
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self - other
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self * other
    }
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        self / other
    }
    #[inline(always)]
    fn neg(self) -> Self {
        -self
    }
    #[inline(always)]
    fn scale(self, factor: f64) -> Self {
        self * factor
    }
    #[inline(always)]
    fn call(self, function: Function) -> Self {
        value(function, self)
    }
    #[inline(always)]
    fn powi(self, n: i32) -> Self {
        powi(self, n)
    }
    #[inline(always)]
    fn pow(self, exponent: Self) -> Self {
        self.powf(exponent)
    }
    #[inline(always)]
    fn atan2(self, other: Self) -> Self {
        f64::atan2(self, other)
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        if other < self { other } else { self }
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        if other > self { other } else { self }
    }
    #[inline(always)]
    fn where_positive(self, test: Self, other: Self) -> Self {
        if test > 0.0 { self } else { other }
    }
    #[inline(always)]
    fn value(self) -> f64 {
        self
    }
}

impl Single for f64 {
    const WIDE: bool = false;
    #[inline(always)]
    fn tangent(self, _: usize) -> f64 {
        0.0
    }
    #[inline(always)]
    fn add_tangent(self, _: usize, _: f64) -> Self {
        self
    }
}

/// A value and its derivatives in `T` directions.
///
/// Its operations are written as loops over the tangents: that is the form that the compiler vectorises.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C)]
pub(crate) struct Dual<const T: usize> {
    d: [f64; T],
    v: f64,
}

#[allow(clippy::needless_range_loop)] // zipped iterators of arrays are not vectorised as well
impl<const T: usize> Dual<T> {
    #[inline(always)]
    fn chain(self, v: f64, slope: f64) -> Self {
        let mut d = [0.0; T];
        for k in 0..T {
            d[k] = slope * self.d[k];
        }
        Self { v, d }
    }

    #[inline(always)]
    fn chain2(self, other: Self, v: f64, slope: f64, other_slope: f64) -> Self {
        let mut d = [0.0; T];
        for k in 0..T {
            d[k] = slope * self.d[k] + other_slope * other.d[k];
        }
        Self { v, d }
    }
}

#[allow(clippy::needless_range_loop)] // as above
impl<const T: usize> Number for Dual<T> {
    #[inline(always)]
    fn lift(v: f64) -> Self {
        Self { v, d: [0.0; T] }
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        let mut d = [0.0; T];
        for k in 0..T {
            d[k] = self.d[k] + other.d[k];
        }
        Self { v: self.v + other.v, d }
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        let mut d = [0.0; T];
        for k in 0..T {
            d[k] = self.d[k] - other.d[k];
        }
        Self { v: self.v - other.v, d }
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.chain2(other, self.v * other.v, other.v, self.v)
    }
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        let v = self.v / other.v;
        let inverse = 1.0 / other.v;
        self.chain2(other, v, inverse, -v * inverse)
    }
    #[inline(always)]
    fn neg(self) -> Self {
        self.chain(-self.v, -1.0)
    }
    #[inline(always)]
    fn scale(self, factor: f64) -> Self {
        self.chain(self.v * factor, factor)
    }
    #[inline(always)]
    fn call(self, function: Function) -> Self {
        let (v, slope) = value_and_slope(function, self.v);
        self.chain(v, slope)
    }
    #[inline(always)]
    fn powi(self, n: i32) -> Self {
        let slope = f64::from(n) * powi(self.v, n - 1);
        self.chain(powi(self.v, n), if slope.is_finite() { slope } else { 0.0 })
    }
    #[inline(always)]
    fn pow(self, exponent: Self) -> Self {
        let v = self.v.powf(exponent.v);
        let finite = |slope: f64| if slope.is_finite() { slope } else { 0.0 };
        let slope = if exponent.v == 0.0 { 0.0 } else { finite(exponent.v * self.v.powf(exponent.v - 1.0)) };
        let in_exponent = if self.v > 0.0 { finite(v * self.v.ln()) } else { 0.0 };
        self.chain2(exponent, v, slope, in_exponent)
    }
    #[inline(always)]
    fn atan2(self, other: Self) -> Self {
        let r2 = self.v * self.v + other.v * other.v;
        let inverse = if r2 > 0.0 { 1.0 / r2 } else { 0.0 };
        self.chain2(other, self.v.atan2(other.v), other.v * inverse, -self.v * inverse)
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        if other.v < self.v { other } else { self }
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        if other.v > self.v { other } else { self }
    }
    #[inline(always)]
    fn where_positive(self, test: Self, other: Self) -> Self {
        if test.v > 0.0 { self } else { other }
    }
    #[inline(always)]
    fn value(self) -> f64 {
        self.v
    }
}

impl<const T: usize> Single for Dual<T> {
    const WIDE: bool = T > 1;
    #[inline(always)]
    fn tangent(self, k: usize) -> f64 {
        self.d.get(k).copied().unwrap_or(0.0)
    }
    #[inline(always)]
    fn add_tangent(mut self, k: usize, slope: f64) -> Self {
        if let Some(d) = self.d.get_mut(k) {
            *d += slope;
        }
        self
    }
}
