//! What the operators with memory can be given.

use std::f64::consts::PI;

use hysid_signal::tell::digits;

use super::Simulation;
use super::validate::Fault;
use crate::error::ErrorKind;
use crate::expr::{BinaryOp, Expr, Function, Memory};
use crate::number::{Lanes, Number};

/// A number without derivatives.
type Plain = Lanes<1, 0>;

/// The value of an expression of numbers only; `None` where it holds a symbol or an operator with memory.
fn constant(expr: &Expr) -> Option<Plain> {
    Some(match expr {
        Expr::Number(value) => Plain::lift(*value),
        Expr::Symbol(name) if name == "pi" => Plain::lift(PI),
        Expr::Symbol(_) | Expr::Memory(..) => return None,
        Expr::Neg(a) => constant(a)?.neg(),
        Expr::Binary(op, a, b) => {
            let (a, b) = (constant(a)?, constant(b)?);
            match op {
                BinaryOp::Add => a.add(b),
                BinaryOp::Sub => a.sub(b),
                BinaryOp::Mul => a.mul(b),
                BinaryOp::Div => a.div(b),
                BinaryOp::Pow => a.pow(b),
            }
        }
        Expr::Call(function, arguments) => match arguments.as_slice() {
            [a] => constant(a)?.call(*function),
            [a, b] => {
                let (a, b) = (constant(a)?, constant(b)?);
                match function {
                    Function::Atan2 => a.atan2(b),
                    Function::Min => a.min(b),
                    Function::Max => a.max(b),
                    _ => return None,
                }
            }
            _ => return None,
        },
    })
}

/// What makes no sense in the numbers that an operator is given. Parameters are free to be what they are: a search moves them.
fn senseless(memory: Memory, arguments: &[Expr]) -> Option<String> {
    let given: Vec<Option<f64>> = arguments.iter().skip(1).map(|a| constant(a).map(Number::value)).collect();
    let told = |what: &str, value: f64, allowed: &str| {
        Some(format!("the {what} of `{}` is {}; {allowed}", memory.name(), digits(value, 4)))
    };
    let what = match memory {
        Memory::Play => "half-width",
        Memory::Relay => "threshold",
        Memory::Delay => "delay",
        Memory::Lag => "time constant",
        Memory::Derivative => return None,
    };
    if let Some(value) = given.iter().flatten().find(|v| !v.is_finite()) {
        return told(what, *value, "a finite number is needed");
    }
    match (memory, given.as_slice()) {
        (Memory::Relay, [Some(lower), Some(upper)]) if lower > upper => {
            told("lower threshold", *lower, &format!("it must not be above the upper one, {}", digits(*upper, 4)))
        }
        (Memory::Play | Memory::Delay | Memory::Lag, [Some(value)]) if *value < 0.0 => {
            told(what, *value, "it must not be below 0")
        }
        _ => None,
    }
}

impl Simulation {
    /// The first operator with memory that is given what it cannot take.
    pub(super) fn fault_in_memory(&self) -> Option<Fault> {
        for (key, expr) in self.expressions() {
            let mut fault = None;
            let mut seen: Vec<Memory> = Vec::new();
            // Operators are visited in the order in which they stand in the text.
            expr.visit(&mut |e| {
                let Expr::Memory(memory, arguments) = e else { return };
                let number = seen.iter().filter(|m| *m == memory).count();
                seen.push(*memory);
                let mut message = senseless(*memory, arguments);
                let constant =
                    |a: &Expr| !a.has_memory() && a.symbols().iter().all(|s| s == "pi" || self.parameter(s).is_some());
                let nested = |a: &Expr| {
                    let mut found = false;
                    let rests = |m: &Memory| matches!(m, Memory::Derivative | Memory::Delay);
                    a.visit(&mut |e| found |= matches!(e, Expr::Memory(memory, _) if !rests(memory)));
                    found
                };
                match memory {
                    Memory::Derivative => {
                        let of_inputs = arguments.iter().all(|a| {
                            !a.has_memory()
                                && a.symbols().iter().all(|s| self.state(s).is_none())
                                && a.symbols().iter().any(|s| self.input(s).is_some())
                        });
                        if !of_inputs {
                            message = Some(
                                "`d(w)` is the time derivative of an input: w must be made of inputs and parameters"
                                    .to_owned(),
                            );
                        }
                    }
                    // A half-width may widen with the rate of an input, or with what it was before; it must not rest on what moves with the play.
                    Memory::Play => {
                        if arguments
                            .iter()
                            .skip(1)
                            .any(|a| a.symbols().iter().any(|s| self.state(s).is_some()) || nested(a))
                        {
                            message = Some(
                                "the half-width of `play` must be made of parameters, numbers, inputs, their derivatives and delayed inputs only"
                                    .to_owned(),
                            );
                        }
                    }
                    Memory::Delay | Memory::Lag | Memory::Relay => {
                        if !arguments.iter().skip(1).all(constant) {
                            let name = memory.name();
                            let what = match memory {
                                Memory::Relay => "thresholds",
                                Memory::Delay => "delay",
                                _ => "time constant",
                            };
                            message =
                                Some(format!("the {what} of `{name}` must be made of parameters and numbers only"));
                        }
                    }
                }
                if fault.is_none() {
                    fault = message.map(|m| Fault::at_use(&key, memory.name(), number, ErrorKind::Memory(m)));
                }
            });
            if fault.is_some() {
                return fault;
            }
        }
        None
    }
}
