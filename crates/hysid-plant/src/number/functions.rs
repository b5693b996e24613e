//! Functions of one argument on plain numbers, with their slopes as they are defined on purpose (see the module above).

use crate::expr::Function;

/// The slope, or 0 where it is infinite or undefined.
#[inline(always)]
pub(super) fn finite(slope: f64) -> f64 {
    if slope.is_finite() { slope } else { 0.0 }
}

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
pub(super) fn powi(a: f64, n: i32) -> f64 {
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
pub(super) fn value(function: Function, x: f64) -> f64 {
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
pub(super) fn value_and_slope(function: Function, x: f64) -> (f64, f64) {
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
        Function::Sign | Function::Step => 0.0,
        // The slope of its mean: see the module.
        Function::Floor => 1.0,
        Function::Atan2 | Function::Min | Function::Max => f64::NAN,
    };
    (y, slope)
}
