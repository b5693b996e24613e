//! Expressions of a simulation file: the abstract syntax tree, its builders and its rewriting.
//!
//! An [`Expr`] is what the equations of a simulation are made of. It is public and plain, because a mechanism of the
//! diagnosis is a rewriting of these trees. It knows nothing of values: see [`crate::Compiled`] for evaluation.
//!
//! `Expr::parse(e.to_string()) == e` for every tree of finite numbers and legal symbols.

mod parse;
mod print;
mod rewrite;

use std::ops::{Add, Div, Mul, Neg, Sub};

pub use parse::ExprError;
pub(crate) use parse::place_of_use;
pub(crate) use print::number;

/// An expression over numbers and symbols.
///
/// The symbols `t` (time in seconds) and `pi` are predefined; all others are inputs, parameters or states.
#[derive(Debug, Clone, PartialEq)]
pub enum Expr {
    /// A finite literal; may be negative.
    Number(f64),
    /// An input, parameter, state, `t` or `pi`.
    Symbol(String),
    /// `-a`.
    Neg(Box<Expr>),
    /// `a op b`.
    Binary(BinaryOp, Box<Expr>, Box<Expr>),
    /// A function without memory; the number of arguments is [`Function::arity`].
    Call(Function, Vec<Expr>),
    /// An operator with memory; the number of arguments is [`Memory::arity`].
    Memory(Memory, Vec<Expr>),
}

/// The binary operators, `^` being right associative and the strongest.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum BinaryOp {
    /// `a + b`
    Add,
    /// `a - b`
    Sub,
    /// `a * b`
    Mul,
    /// `a / b`
    Div,
    /// `a ^ b`
    Pow,
}

/// Functions without memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[allow(missing_docs)] // the names are those of the file format
pub enum Function {
    Sin,
    Cos,
    Tan,
    Asin,
    Acos,
    Atan,
    Atan2,
    Sinh,
    Cosh,
    Tanh,
    Exp,
    Ln,
    Log10,
    Sqrt,
    Abs,
    /// -1, 0 or 1.
    Sign,
    Min,
    Max,
    Floor,
    /// 1 where the argument is positive, else 0.
    Step,
}

impl Function {
    /// Every function, with its name in the file.
    pub const ALL: [(Self, &'static str); 20] = [
        (Self::Sin, "sin"),
        (Self::Cos, "cos"),
        (Self::Tan, "tan"),
        (Self::Asin, "asin"),
        (Self::Acos, "acos"),
        (Self::Atan, "atan"),
        (Self::Atan2, "atan2"),
        (Self::Sinh, "sinh"),
        (Self::Cosh, "cosh"),
        (Self::Tanh, "tanh"),
        (Self::Exp, "exp"),
        (Self::Ln, "ln"),
        (Self::Log10, "log10"),
        (Self::Sqrt, "sqrt"),
        (Self::Abs, "abs"),
        (Self::Sign, "sign"),
        (Self::Min, "min"),
        (Self::Max, "max"),
        (Self::Floor, "floor"),
        (Self::Step, "step"),
    ];

    /// The name in the file.
    pub fn name(self) -> &'static str {
        Self::ALL.iter().find(|(f, _)| *f == self).map_or("", |(_, name)| name)
    }

    /// The function of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.iter().find(|(_, n)| *n == name).map(|(f, _)| *f)
    }

    /// The number of arguments.
    pub fn arity(self) -> usize {
        match self {
            Self::Atan2 | Self::Min | Self::Max => 2,
            _ => 1,
        }
    }
}

/// Operators with memory. Each starts at rest at the first sample (see the documentation of simulation files).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Memory {
    /// `play(w, r)`: backlash of half-width `r`.
    Play,
    /// `relay(w, lower, upper)`: -1 or 1; rises when `w` exceeds `upper`, falls when it is below `lower`.
    Relay,
    /// `delay(w, seconds)`.
    Delay,
    /// `lag(w, tau)`: first order, unity gain.
    Lag,
    /// `d(w)`: the time derivative of an input, by central difference.
    Derivative,
}

impl Memory {
    /// Every operator, with its name in the file.
    pub const ALL: [(Self, &'static str); 5] = [
        (Self::Play, "play"),
        (Self::Relay, "relay"),
        (Self::Delay, "delay"),
        (Self::Lag, "lag"),
        (Self::Derivative, "d"),
    ];

    /// The name in the file.
    pub fn name(self) -> &'static str {
        Self::ALL.iter().find(|(m, _)| *m == self).map_or("", |(_, name)| name)
    }

    /// The operator of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.iter().find(|(_, n)| *n == name).map(|(m, _)| *m)
    }

    /// The number of arguments.
    pub fn arity(self) -> usize {
        match self {
            Self::Relay => 3,
            Self::Derivative => 1,
            Self::Play | Self::Delay | Self::Lag => 2,
        }
    }
}

/// Whether `name` is a legal symbol: a letter followed by letters, digits or `_`, and not the name of a function, of an
/// operator with memory, `t` or `pi`. (`d` alone is legal: `d*v` and `d(w)` cannot be confused.)
pub fn is_legal_symbol(name: &str) -> bool {
    is_identifier(name) && !is_reserved(name)
}

pub(crate) fn is_identifier(name: &str) -> bool {
    let mut chars = name.chars();
    chars.next().is_some_and(|c| c.is_ascii_alphabetic()) && chars.all(|c| c.is_ascii_alphanumeric() || c == '_')
}

pub(crate) fn is_reserved(name: &str) -> bool {
    matches!(name, "t" | "pi" | "free")
        || Function::from_name(name).is_some()
        || Memory::from_name(name).is_some_and(|m| m != Memory::Derivative)
}

impl Expr {
    /// The symbol `name`.
    pub fn symbol(name: impl Into<String>) -> Self {
        Self::Symbol(name.into())
    }

    /// A function of one argument.
    pub fn call(function: Function, argument: impl Into<Expr>) -> Self {
        Self::Call(function, vec![argument.into()])
    }

    /// A function of two arguments.
    pub fn call2(function: Function, a: impl Into<Expr>, b: impl Into<Expr>) -> Self {
        Self::Call(function, vec![a.into(), b.into()])
    }

    /// `self ^ exponent`.
    pub fn pow(self, exponent: impl Into<Expr>) -> Self {
        Self::binary(BinaryOp::Pow, self, exponent.into())
    }

    /// `abs(self)`.
    pub fn abs(self) -> Self {
        Self::call(Function::Abs, self)
    }

    /// `sign(self)`.
    pub fn sign(self) -> Self {
        Self::call(Function::Sign, self)
    }

    /// `step(self)`: 1 where positive, else 0.
    pub fn step(self) -> Self {
        Self::call(Function::Step, self)
    }

    /// `min(self, other)`.
    pub fn min(self, other: impl Into<Expr>) -> Self {
        Self::call2(Function::Min, self, other)
    }

    /// `max(self, other)`.
    pub fn max(self, other: impl Into<Expr>) -> Self {
        Self::call2(Function::Max, self, other)
    }

    /// `play(self, r)`: backlash of half-width `r`.
    pub fn play(self, r: impl Into<Expr>) -> Self {
        Self::Memory(Memory::Play, vec![self, r.into()])
    }

    /// `relay(self, lower, upper)`.
    pub fn relay(self, lower: impl Into<Expr>, upper: impl Into<Expr>) -> Self {
        Self::Memory(Memory::Relay, vec![self, lower.into(), upper.into()])
    }

    /// `delay(self, seconds)`.
    pub fn delay(self, seconds: impl Into<Expr>) -> Self {
        Self::Memory(Memory::Delay, vec![self, seconds.into()])
    }

    /// `lag(self, tau)`.
    pub fn lag(self, tau: impl Into<Expr>) -> Self {
        Self::Memory(Memory::Lag, vec![self, tau.into()])
    }

    /// `d(self)`: the time derivative of an input.
    pub fn derivative_of_input(self) -> Self {
        Self::Memory(Memory::Derivative, vec![self])
    }

    pub(crate) fn binary(op: BinaryOp, a: Expr, b: Expr) -> Self {
        Self::Binary(op, Box::new(a), Box::new(b))
    }
}

impl From<f64> for Expr {
    fn from(value: f64) -> Self {
        Self::Number(value)
    }
}

impl From<&str> for Expr {
    /// The symbol of that name (not parsed: see [`Expr::parse`]).
    fn from(name: &str) -> Self {
        Self::Symbol(name.to_owned())
    }
}

macro_rules! binary_operator {
    ($($trait:ident $method:ident),*) => {$(
        impl<T: Into<Expr>> $trait<T> for Expr {
            type Output = Expr;
            fn $method(self, other: T) -> Expr {
                Expr::binary(BinaryOp::$trait, self, other.into())
            }
        }
    )*};
}
binary_operator!(Add add, Sub sub, Mul mul, Div div);

impl Neg for Expr {
    type Output = Expr;
    fn neg(self) -> Expr {
        Expr::Neg(Box::new(self))
    }
}
