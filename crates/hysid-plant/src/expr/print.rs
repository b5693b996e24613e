//! From expression to text, with the fewest parentheses that keep the tree.

use std::fmt::{self, Display, Formatter, Write};

use super::{BinaryOp, Expr};

/// How strongly the outermost operator binds: the larger, the fewer parentheses.
fn strength(expr: &Expr) -> u8 {
    match expr {
        Expr::Binary(BinaryOp::Add | BinaryOp::Sub, ..) => 1,
        Expr::Binary(BinaryOp::Mul | BinaryOp::Div, ..) => 3,
        Expr::Neg(_) => 5,
        Expr::Number(value) if value.is_sign_negative() => 5,
        Expr::Binary(BinaryOp::Pow, ..) => 7,
        Expr::Number(_) | Expr::Symbol(_) | Expr::Call(..) | Expr::Memory(..) => 9,
    }
}

/// The shortest decimal text that reads back as `value`.
pub(crate) fn number(value: f64) -> String {
    let size = value.abs();
    if size != 0.0 && !(1e-4..1e7).contains(&size) { format!("{value:e}") } else { format!("{value}") }
}

fn wrapped(f: &mut Formatter<'_>, expr: &Expr, least: u8) -> fmt::Result {
    if strength(expr) < least { write!(f, "({expr})") } else { write!(f, "{expr}") }
}

fn call(f: &mut Formatter<'_>, name: &str, arguments: &[Expr]) -> fmt::Result {
    f.write_str(name)?;
    f.write_char('(')?;
    for (i, argument) in arguments.iter().enumerate() {
        if i > 0 {
            f.write_str(", ")?;
        }
        write!(f, "{argument}")?;
    }
    f.write_char(')')
}

impl Display for Expr {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(value) => f.write_str(&number(*value)),
            Self::Symbol(name) => f.write_str(name),
            Self::Neg(a) => {
                f.write_char('-')?;
                // `-3` is a literal and `-3^2` the negative of a power: a literal under `Neg` needs its parentheses.
                let least = if matches!(**a, Self::Number(_)) { u8::MAX } else { 6 };
                wrapped(f, a, least)
            }
            Self::Binary(op, a, b) => {
                let (text, left, right) = match op {
                    BinaryOp::Add => (" + ", 1, 2),
                    BinaryOp::Sub => (" - ", 1, 2),
                    BinaryOp::Mul => ("*", 3, 4),
                    BinaryOp::Div => ("/", 3, 4),
                    BinaryOp::Pow => ("^", 8, 6),
                };
                wrapped(f, a, left)?;
                f.write_str(text)?;
                // A sign directly after an operator reads badly: `a*-b`.
                let signed = strength(b) == 5;
                wrapped(f, b, if signed { u8::MAX } else { right })
            }
            Self::Call(function, arguments) => call(f, function.name(), arguments),
            Self::Memory(memory, arguments) => call(f, memory.name(), arguments),
        }
    }
}
