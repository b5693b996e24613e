//! Units of expressions: a clash is reported only where it is certain.
//!
//! A literal may carry a hidden unit (`9.81`), so it matches anything, and a product with one is unknown. Columns' names are
//! not used: only the units that the file declares for parameters and states. Scales (`mm` against `m`) are not compared.

use crate::document::Simulation;
use crate::expr::{BinaryOp, Expr, Function, Memory};
use crate::unit::Unit;

/// The unit of an expression where the file settles it, or the clash.
fn unit_of(simulation: &Simulation, expr: &Expr) -> Result<Option<Unit>, String> {
    let unit = |e: &Expr| unit_of(simulation, e);
    match expr {
        Expr::Number(_) => Ok(None),
        Expr::Symbol(name) => Ok(simulation.declared_unit(name)),
        Expr::Neg(a) => unit(a),
        Expr::Binary(op, a, b) => {
            let (left, right) = (unit(a)?, unit(b)?);
            Ok(match (op, left, right) {
                (BinaryOp::Add | BinaryOp::Sub, left, right) => same(expr, a, left, b, right)?,
                (BinaryOp::Mul, Some(l), Some(r)) => Some(l.times(&r)),
                (BinaryOp::Div, Some(l), Some(r)) => Some(l.per(&r)),
                (BinaryOp::Pow, left, right) => {
                    if let Some(r) = right.filter(|r| r.clashes(&Unit::none())) {
                        return Err(format!("the exponent `{b}` has the unit {r}; an exponent is a pure number"));
                    }
                    match (left, &**b) {
                        (Some(l), Expr::Number(n)) if n.fract() == 0.0 && n.abs() <= 12.0 => Some(l.power(*n as i32)),
                        (Some(l), Expr::Number(n)) if *n == 0.5 => l.root(),
                        (Some(l), _) if l.is_none() => Some(l),
                        _ => None,
                    }
                }
                _ => None,
            })
        }
        Expr::Call(function, arguments) => {
            let mut units = Vec::with_capacity(arguments.len());
            for argument in arguments {
                units.push(unit(argument)?);
            }
            let pure = |result: Option<Unit>| match (&units.first().cloned().flatten(), arguments.first()) {
                (Some(u), Some(a)) if u.clashes(&Unit::none()) => {
                    Err(format!("`{}` takes a pure number, but `{a}` has the unit {u}", function.name()))
                }
                _ => Ok(result),
            };
            match function {
                Function::Sin | Function::Cos | Function::Tan | Function::Sinh | Function::Cosh | Function::Tanh => {
                    pure(Some(Unit::none()))
                }
                Function::Exp | Function::Asin | Function::Acos | Function::Atan => pure(Some(Unit::none())),
                // A logarithm of a quantity is common in fitted laws: unknown, not wrong.
                Function::Ln | Function::Log10 => Ok(None),
                Function::Sqrt => Ok(units.first().cloned().flatten().and_then(|u| u.root())),
                Function::Abs | Function::Floor => Ok(units.first().cloned().flatten()),
                Function::Sign | Function::Step => Ok(Some(Unit::none())),
                Function::Atan2 | Function::Min | Function::Max => match arguments.as_slice() {
                    [a, b] => {
                        let (left, right) = (units.first().cloned().flatten(), units.get(1).cloned().flatten());
                        let common = same(expr, a, left, b, right)?;
                        Ok(if *function == Function::Atan2 { Some(Unit::none()) } else { common })
                    }
                    _ => Ok(None),
                },
            }
        }
        Expr::Memory(memory, arguments) => {
            let mut units = Vec::with_capacity(arguments.len());
            for argument in arguments {
                units.push((argument, unit(argument)?));
            }
            let Some(((first, first_unit), rest)) = units.split_first() else { return Ok(None) };
            let seconds = Unit::parse("s").unwrap_or_default();
            match memory {
                Memory::Play | Memory::Relay => {
                    for (argument, u) in rest {
                        same(expr, first, first_unit.clone(), argument, u.clone())?;
                    }
                    Ok(if *memory == Memory::Play { first_unit.clone() } else { Some(Unit::none()) })
                }
                Memory::Delay | Memory::Lag => match rest {
                    [(argument, Some(u))] if u.clashes(&seconds) => {
                        Err(format!("`{}` takes seconds, but `{argument}` has the unit {u}", memory.name()))
                    }
                    _ => Ok(first_unit.clone()),
                },
                Memory::Derivative => Ok(first_unit.as_ref().map(|u| u.per(&seconds))),
            }
        }
    }
}

/// The common unit of two operands; the left one's name is kept where both are known.
fn same(whole: &Expr, a: &Expr, left: Option<Unit>, b: &Expr, right: Option<Unit>) -> Result<Option<Unit>, String> {
    match (left, right) {
        (Some(l), Some(r)) if l.clashes(&r) => {
            Err(format!("`{a}` has the unit {l} and `{b}` the unit {r} in `{whole}`"))
        }
        (Some(l), Some(_)) => Ok(Some(l)),
        // `x + 1`: the literal takes the other's unit; an input's unit is not declared, so nothing is known for certain.
        (Some(one), None) => Ok(Some(beside_unknown(one, b))),
        (None, Some(one)) => Ok(Some(beside_unknown(one, a))),
        (None, None) => Ok(None),
    }
}

/// The unit of a sum of which only one side is known. An angle is a pure number with a name: a lift coefficient may hold `C_q*d(alpha)`, in radians, and is no
/// angle for that. What is told for each degree stays so.
fn beside_unknown(known: Unit, other: &Expr) -> Unit {
    let angle = known.same_dimension(&Unit::none()) && !known.is_for_each();
    if angle && !matches!(other, Expr::Number(_)) { Unit::none() } else { known }
}

/// The first clash: its key and what clashes.
pub(crate) fn first_clash(simulation: &Simulation) -> Option<(String, String)> {
    for (key, expr) in simulation.expressions() {
        let unit = match unit_of(simulation, expr) {
            Ok(unit) => unit,
            Err(message) => return Some((key, message)),
        };
        let Some(unit) = unit else { continue };
        for state in &simulation.states {
            let Some(own) = &state.unit else { continue };
            let expected = if key == format!("states.{}.derivative", state.name) {
                own.per(&Unit::parse("s").unwrap_or_default())
            } else if key == format!("states.{}.initial", state.name) {
                own.clone()
            } else {
                continue;
            };
            if unit.clashes(&expected) {
                return Some((key, format!("`{expr}` has the unit {unit}, but {expected} is needed")));
            }
        }
    }
    None
}

impl Simulation {
    /// Whether the declared units agree with each other.
    pub fn units_agree(&self) -> bool {
        first_clash(self).is_none()
    }

    /// The unit of an expression over this simulation's symbols, where the declared units settle it; inputs, and states of which nothing is declared,
    /// count with the unit that their column's name ends in.
    pub fn unit_of_expr(&self, expr: &Expr) -> Option<Unit> {
        let mut with_columns = self.clone();
        with_columns.states.iter_mut().for_each(|s| s.unit = self.unit_of(&s.name));
        // A parameter in the place of each input carries the unit of its column's name.
        let inputs = std::mem::take(&mut with_columns.inputs);
        for input in inputs {
            let mut stand_in = crate::document::Parameter::new(&input.symbol, 0.0);
            stand_in.unit = Unit::of_column(&input.column);
            with_columns.parameters.push(stand_in);
        }
        unit_of(&with_columns, expr).ok().flatten()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_units_that_are_not_known_may_be_right() {
        let text = |c: &str, k: &str| {
            format!(
                "[time]\nperiod_s = 0.1\n[inputs]\nu = \"u_N\"\n[parameters]\nm = {{ value = 1.0, fixed = true, unit = \"kg\" }}\n\
                 c = {{ value = 1.0, fixed = true, unit = \"{c}\" }}\nk = {{ value = 1.0, fixed = true, unit = \"{k}\" }}\n[states]\n\
                 x = {{ derivative = \"v\", initial = 0.0, unit = \"m\" }}\n\
                 v = {{ derivative = \"(u - c*v - k*x)/m\", initial = 0.0, unit = \"m/s\" }}\n[outputs]\nx_m = \"x\"\n"
            )
        };
        for (c, k) in [("N s/psi", "N/psi"), ("N s/psi", "N/m"), ("N s/blorb", "N/psi"), ("N s/m", "N/m")] {
            let read = Simulation::parse(&text(c, k), "units.sim.toml");
            assert!(read.is_ok(), "{c}, {k}: {}", read.unwrap_err());
        }
        let clash = Simulation::parse(&text("N s/psi", "N s/psi"), "units.sim.toml").unwrap_err().to_string();
        assert!(clash.contains("`u - c*v`") && clash.contains("`k*x`"), "{clash}");
    }

    #[test]
    fn an_angle_beside_what_is_unknown_is_a_number() {
        let text = "[time]\nperiod_s = 0.1\n[inputs]\na = \"alpha_rad\"\n[parameters]\nC = { value = 6.0, fixed = true, unit = \"1/rad\" }\nC_q = { value = 0.1, fixed = true, unit = \"s\" }\n\
                    g = { value = 2.0, fixed = true, unit = \"-\" }\n[outputs]\ncn = \"C*a\"\n";
        let simulation = Simulation::parse(text, "wing.sim.toml").unwrap();
        let unit = |e: &str| simulation.unit_of_expr(&Expr::parse(e).unwrap()).map(|u| u.to_string());
        assert_eq!(unit("C*sin(a)*((1 + sqrt(a))/2)^2 + C_q*d(a)").as_deref(), Some("-"));
        assert_eq!(unit("C_q*d(a) - C*sin(a)/2").as_deref(), Some("-"));
        // A literal takes the unit of what it is added to, as before, and what is no angle tells what it is.
        assert_eq!(unit("g*a + 0.1").as_deref(), Some("rad"));
        assert_eq!(unit("d(a) + a/2").as_deref(), Some("rad/s"));
        // A slope of which a part is unknown is one.
        assert_eq!(unit("a*(C + 0.5*C*(1 - tanh(a)))").as_deref(), Some("-"));
    }
}
