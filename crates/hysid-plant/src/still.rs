//! Whether an expression changes with what it names: `x - x` names a state and is a constant.
//!
//! An expression of analytic functions whose derivative along a direction in which everything moves is exactly 0 at many points, of sizes
//! from 1e-15 to 1e6, is a constant. What has jumps or memory tells nothing by a derivative of 0 (`step(x - 1)`); it is taken for a quantity
//! of its own, the same wherever it is written the same.

use hysid_signal::mixed;

use crate::expr::{BinaryOp, Expr, Function};
use crate::number::{Lanes, Number};

/// Points that are tried.
const POINTS: u64 = 64;
/// Points at which value and derivative are finite, without which nothing is said.
const FEWEST: usize = 8;

/// Whether the expression has the same value wherever the symbols that move stand.
pub(crate) fn is_constant(expr: &Expr, moves: &dyn Fn(&str) -> bool) -> bool {
    let mut finite = 0;
    for point in 0..POINTS {
        let value = At { point, moves }.value(expr);
        let slope = value.tangent(0);
        if !(value.value().is_finite() && slope.is_finite()) {
            continue;
        }
        if slope != 0.0 {
            return false;
        }
        finite += 1;
    }
    finite >= FEWEST
}

/// One of the points.
struct At<'a> {
    point: u64,
    moves: &'a dyn Fn(&str) -> bool,
}

impl At<'_> {
    fn value(&self, expr: &Expr) -> Lanes<1, 1> {
        match expr {
            Expr::Number(x) => Lanes::lift(*x),
            Expr::Symbol(name) => self.quantity(name, (self.moves)(name)),
            Expr::Neg(a) => self.value(a).neg(),
            Expr::Binary(op, a, b) => {
                let (left, right) = (self.value(a), self.value(b));
                match (op, &**b) {
                    (BinaryOp::Add, _) => left.add(right),
                    (BinaryOp::Sub, _) => left.sub(right),
                    (BinaryOp::Mul, _) => left.mul(right),
                    (BinaryOp::Div, _) => left.div(right),
                    (BinaryOp::Pow, Expr::Number(n)) if n.fract() == 0.0 && n.abs() <= 64.0 => left.powi(*n as i32),
                    (BinaryOp::Pow, _) => left.pow(right),
                }
            }
            Expr::Call(Function::Sign | Function::Step | Function::Min | Function::Max, _) | Expr::Memory(..) => {
                self.quantity(&expr.to_string(), expr.symbols().iter().any(|s| (self.moves)(s)))
            }
            Expr::Call(function, arguments) => match (function, arguments.as_slice()) {
                (Function::Atan2, [a, b]) => self.value(a).atan2(self.value(b)),
                (Function::Abs, [a]) => self.value(a).abs(),
                (f, [a]) => self.value(a).call(*f),
                // The parser keeps arities.
                _ => Lanes::lift(f64::NAN),
            },
        }
    }

    /// A value for what is called so: of any size, half of them below 0 where it moves, and moving at a pace of its own.
    fn quantity(&self, name: &str, moves: bool) -> Lanes<1, 1> {
        if name == "pi" {
            return Lanes::lift(std::f64::consts::PI);
        }
        let mut state = name.bytes().fold(self.point, |hash, byte| mixed(hash ^ u64::from(byte)));
        let mut uniform = || {
            state = mixed(state);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        let size = 10_f64.powf(21.0 * uniform() - 15.0);
        if !moves {
            return Lanes::lift(size);
        }
        let value = if uniform() < 0.5 { -size } else { size };
        Lanes::lift(value).add_tangent(0, 0.5 + uniform())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn constant(text: &str) -> bool {
        is_constant(&Expr::parse(text).unwrap(), &|name| matches!(name, "x" | "v" | "u" | "t"))
    }

    #[test]
    fn what_cancels_is_a_constant() {
        for text in ["3", "2*m", "x - x", "2*x - x - x", "(x + m) - x", "0*u", "x^0", "v*u - u*v", "step(x) - step(x)"]
        {
            assert!(constant(text), "{text}");
        }
    }

    #[test]
    fn what_may_move_is_none() {
        for text in [
            "x",
            "x - v",
            "2*x - x",
            "step(x - 1e9)",
            "max(x, 1e9)",
            "min(x, u)",
            "sign(v)",
            "floor(x)",
            "tanh(1e9*x)",
            "exp(-1e6*x^2)",
            "sqrt(x - 100)",
            "atan2(x, v)",
            "asin(x)",
            "play(x, 0.1) - x",
            "relay(x, -1, 1)",
            "d(u)",
            "x^2.5",
            "1e-300*x",
            "t",
        ] {
            assert!(!constant(text), "{text}");
        }
    }
}
