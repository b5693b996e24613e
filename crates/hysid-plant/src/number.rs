//! The numbers that equations are evaluated in: values and their tangents, of one run or of several in lanes.
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

impl<const T: usize> Single for Lanes<1, T> {}

/// A length of time: plain, or one that carries tangents (up to a located event).
pub(crate) trait Span<N>: Copy {
    /// Whether it has no tangents.
    const PLAIN: bool;
    fn seconds(self) -> N;
    fn value(self) -> f64;
    fn times(self, x: N) -> N;
    fn plus(self, other: Self) -> Self;
    fn part(self, share: f64) -> Self;
    /// `level + slope * self`.
    fn line(self, level: f64, slope: f64) -> N;
}

impl<N: Number> Span<N> for f64 {
    const PLAIN: bool = true;
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
    fn part(self, share: f64) -> Self {
        self.scale(share)
    }
    #[inline(always)]
    fn line(self, level: f64, slope: f64) -> Self {
        Self::lift(level).add(self.scale(slope))
    }
}

/// The values of `L` runs, each with its derivatives in `T` directions; `Lanes<1, 0>` is a plain number.
///
/// Its operations are written as loops over directions and lanes: that is the form that the compiler vectorises. A lane's
/// value is bit for bit the same whatever `L` and `T` are.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C)]
pub(crate) struct Lanes<const L: usize, const T: usize> {
    d: [[f64; L]; T],
    v: [f64; L],
}

/// One array from the lanes of others.
#[inline(always)]
fn each<const L: usize>(f: impl Fn(usize) -> f64) -> [f64; L] {
    let mut out = [0.0; L];
    for l in 0..L {
        out[l] = f(l);
    }
    out
}

#[allow(clippy::needless_range_loop)] // zipped iterators of arrays are not vectorised as well
impl<const L: usize, const T: usize> Lanes<L, T> {
    #[inline(always)]
    fn chain(self, v: [f64; L], slope: [f64; L]) -> Self {
        let mut d = [[0.0; L]; T];
        for k in 0..T {
            for l in 0..L {
                d[k][l] = slope[l] * self.d[k][l];
            }
        }
        Self { v, d }
    }

    #[inline(always)]
    fn chain2(self, other: Self, v: [f64; L], slope: [f64; L], other_slope: [f64; L]) -> Self {
        let mut d = [[0.0; L]; T];
        for k in 0..T {
            for l in 0..L {
                d[k][l] = slope[l] * self.d[k][l] + other_slope[l] * other.d[k][l];
            }
        }
        Self { v, d }
    }

    /// `self` where the test holds, else `other`.
    #[inline(always)]
    fn pick(self, test: [bool; L], other: Self) -> Self {
        let mut d = [[0.0; L]; T];
        for k in 0..T {
            for l in 0..L {
                d[k][l] = if test[l] { self.d[k][l] } else { other.d[k][l] };
            }
        }
        Self { v: each(|l| if test[l] { self.v[l] } else { other.v[l] }), d }
    }

    /// The values of all lanes.
    #[inline(always)]
    pub fn values(&self) -> &[f64; L] {
        &self.v
    }

    /// One lane by itself.
    pub fn lane(&self, lane: usize) -> Lanes<1, T> {
        let mut d = [[0.0]; T];
        for k in 0..T {
            d[k] = [self.d[k][lane]];
        }
        Lanes { v: [self.v[lane]], d }
    }

    /// Puts a number into a lane.
    pub fn set_lane(&mut self, lane: usize, from: Lanes<1, T>) {
        self.v[lane] = from.v[0];
        for k in 0..T {
            self.d[k][lane] = from.d[k][0];
        }
    }
}

fn finite(slope: f64) -> f64 {
    if slope.is_finite() { slope } else { 0.0 }
}

#[allow(clippy::needless_range_loop)] // as above
impl<const L: usize, const T: usize> Number for Lanes<L, T> {
    const WIDE: bool = L * T > 2 || L > 2;
    #[inline(always)]
    fn lift(v: f64) -> Self {
        Self { v: [v; L], d: [[0.0; L]; T] }
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        let mut d = [[0.0; L]; T];
        for k in 0..T {
            for l in 0..L {
                d[k][l] = self.d[k][l] + other.d[k][l];
            }
        }
        Self { v: each(|l| self.v[l] + other.v[l]), d }
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        let mut d = [[0.0; L]; T];
        for k in 0..T {
            for l in 0..L {
                d[k][l] = self.d[k][l] - other.d[k][l];
            }
        }
        Self { v: each(|l| self.v[l] - other.v[l]), d }
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.chain2(other, each(|l| self.v[l] * other.v[l]), other.v, self.v)
    }
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        let v = each(|l| self.v[l] / other.v[l]);
        if T == 0 {
            return Self { v, d: [[0.0; L]; T] };
        }
        let inverse = each(|l| 1.0 / other.v[l]);
        self.chain2(other, v, inverse, each(|l| -v[l] * inverse[l]))
    }
    #[inline(always)]
    fn neg(self) -> Self {
        self.chain(each(|l| -self.v[l]), [-1.0; L])
    }
    #[inline(always)]
    fn scale(self, factor: f64) -> Self {
        self.chain(each(|l| self.v[l] * factor), [factor; L])
    }
    fn call(self, function: Function) -> Self {
        if T == 0 {
            return Self { v: each(|l| value(function, self.v[l])), d: [[0.0; L]; T] };
        }
        let (mut v, mut slope) = ([0.0; L], [0.0; L]);
        for l in 0..L {
            (v[l], slope[l]) = value_and_slope(function, self.v[l]);
        }
        self.chain(v, slope)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        if T == 0 {
            return Self { v: each(|l| self.v[l].abs()), d: [[0.0; L]; T] };
        }
        self.chain(each(|l| self.v[l].abs()), each(|l| sign(self.v[l])))
    }
    #[inline(always)]
    fn powi(self, n: i32) -> Self {
        let v = each(|l| powi(self.v[l], n));
        if T == 0 {
            return Self { v, d: [[0.0; L]; T] };
        }
        self.chain(v, each(|l| finite(f64::from(n) * powi(self.v[l], n - 1))))
    }
    fn pow(self, exponent: Self) -> Self {
        let v = each(|l| self.v[l].powf(exponent.v[l]));
        if T == 0 {
            return Self { v, d: [[0.0; L]; T] };
        }
        let slope = each(|l| {
            let n = exponent.v[l];
            if n == 0.0 { 0.0 } else { finite(n * self.v[l].powf(n - 1.0)) }
        });
        let in_exponent = if exponent.d.iter().flatten().all(|d| *d == 0.0) {
            [0.0; L]
        } else {
            each(|l| if self.v[l] > 0.0 { finite(v[l] * self.v[l].ln()) } else { 0.0 })
        };
        self.chain2(exponent, v, slope, in_exponent)
    }
    fn atan2(self, other: Self) -> Self {
        let inverse: [f64; L] = each(|l| {
            let r2 = self.v[l] * self.v[l] + other.v[l] * other.v[l];
            if r2 > 0.0 { 1.0 / r2 } else { 0.0 }
        });
        let v = each(|l| self.v[l].atan2(other.v[l]));
        self.chain2(other, v, each(|l| other.v[l] * inverse[l]), each(|l| -self.v[l] * inverse[l]))
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        other.pick(std::array::from_fn(|l| other.v[l] < self.v[l]), self)
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        other.pick(std::array::from_fn(|l| other.v[l] > self.v[l]), self)
    }
    #[inline(always)]
    fn where_positive(self, test: Self, other: Self) -> Self {
        self.pick(std::array::from_fn(|l| test.v[l] > 0.0), other)
    }
    #[inline(always)]
    fn value_of(self, lane: usize) -> f64 {
        self.v.get(lane).copied().unwrap_or(f64::NAN)
    }
    #[inline(always)]
    fn tangent_of(self, lane: usize, k: usize) -> f64 {
        self.d.get(k).and_then(|d| d.get(lane)).copied().unwrap_or(0.0)
    }
    #[inline(always)]
    fn with_value(mut self, lane: usize, value: f64) -> Self {
        if let Some(v) = self.v.get_mut(lane) {
            *v = value;
        }
        self
    }
    #[inline(always)]
    fn add_tangent(mut self, k: usize, slope: f64) -> Self {
        if let Some(d) = self.d.get_mut(k) {
            d.iter_mut().for_each(|d| *d += slope);
        }
        self
    }
}
