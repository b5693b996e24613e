//! Numbers in lanes: values of several runs with their tangents.

use super::functions::{finite, powi, sign, value, value_and_slope};
use super::{Number, Single};
use crate::expr::Function;

impl<const T: usize> Single for Lanes<1, T> {}

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
