//! Symbolic derivatives, for the rate of change of a switching surface and for the rate of an expression of inputs.
//!
//! Kinks and jumps have derivative 0 at the point itself, as in the forward derivatives of the tape.

use crate::expr::{BinaryOp, Expr, Function};

fn half_sign(e: Expr) -> Expr {
    e.sign() * 0.5
}

/// The derivative of `expr` by `symbol`; not simplified. An operator with memory counts as constant.
pub(super) fn derivative(expr: &Expr, symbol: &str) -> Expr {
    let d = |e: &Expr| derivative(e, symbol);
    if !expr.uses(symbol) {
        return Expr::Number(0.0);
    }
    match expr {
        Expr::Number(_) | Expr::Memory(..) => Expr::Number(0.0),
        Expr::Symbol(_) => Expr::Number(1.0),
        Expr::Neg(a) => -d(a),
        Expr::Binary(op, a, b) => {
            let (u, v) = ((**a).clone(), (**b).clone());
            match op {
                BinaryOp::Add => d(a) + d(b),
                BinaryOp::Sub => d(a) - d(b),
                BinaryOp::Mul => d(a) * v + u * d(b),
                BinaryOp::Div => d(a) / v.clone() - u * d(b) / v.pow(2.0),
                BinaryOp::Pow if !v.uses(symbol) => v.clone() * u.pow(v - 1.0) * d(a),
                BinaryOp::Pow => {
                    let whole = expr.clone();
                    whole * (d(b) * Expr::call(Function::Ln, u.clone()) + v * d(a) / u)
                }
            }
        }
        Expr::Call(f, arguments) => {
            let Some(a) = arguments.first() else { return Expr::Number(0.0) };
            let u = a.clone();
            let one = Expr::Number(1.0);
            let outer = match f {
                Function::Sin => Expr::call(Function::Cos, u),
                Function::Cos => -Expr::call(Function::Sin, u),
                Function::Tan => one + expr.clone().pow(2.0),
                Function::Asin => one.clone() / Expr::call(Function::Sqrt, one - u.pow(2.0)),
                Function::Acos => -(one.clone() / Expr::call(Function::Sqrt, one - u.pow(2.0))),
                Function::Atan => one.clone() / (one + u.pow(2.0)),
                Function::Sinh => Expr::call(Function::Cosh, u),
                Function::Cosh => Expr::call(Function::Sinh, u),
                Function::Tanh => one - expr.clone().pow(2.0),
                Function::Exp => expr.clone(),
                Function::Ln => one / u,
                Function::Log10 => one / (u * std::f64::consts::LN_10),
                Function::Sqrt => Expr::Number(0.5) / expr.clone(),
                Function::Abs => u.sign(),
                Function::Sign | Function::Step => return Expr::Number(0.0),
                // The slope of its mean, as in the evaluation.
                Function::Floor => one,
                Function::Atan2 | Function::Min | Function::Max => {
                    let Some(b) = arguments.get(1) else { return Expr::Number(0.0) };
                    let (w, da, db) = (b.clone(), d(a), d(b));
                    return match f {
                        Function::Atan2 => (da * w.clone() - db * u.clone()) / (u.pow(2.0) + w.pow(2.0)),
                        Function::Min => (da.clone() + db.clone()) * 0.5 - half_sign(u - w) * (da - db),
                        _ => (da.clone() + db.clone()) * 0.5 + half_sign(u - w) * (da - db),
                    };
                }
            };
            outer * d(a)
        }
    }
}
