//! The little algebra that finds masses, stiffnesses and offsets in the equations.

use hysid_plant::{BinaryOp, Expr, Simulation};

/// The coefficient of `symbol` in an expression that is linear in it; `None` where it does not occur or not linearly.
pub(super) fn coefficient(expr: &Expr, symbol: &str) -> Option<Expr> {
    if !expr.uses(symbol) {
        return None;
    }
    match expr {
        Expr::Symbol(_) => Some(Expr::Number(1.0)),
        Expr::Neg(a) => coefficient(a, symbol).map(|c| -c),
        Expr::Binary(op, a, b) => match (op, a.uses(symbol), b.uses(symbol)) {
            (BinaryOp::Add | BinaryOp::Sub, true, false) => coefficient(a, symbol),
            (BinaryOp::Add, false, true) => coefficient(b, symbol),
            (BinaryOp::Sub, false, true) => coefficient(b, symbol).map(|c| -c),
            (BinaryOp::Add, true, true) => Some(coefficient(a, symbol)? + coefficient(b, symbol)?),
            (BinaryOp::Sub, true, true) => Some(coefficient(a, symbol)? - coefficient(b, symbol)?),
            (BinaryOp::Mul, true, false) => coefficient(a, symbol).map(|c| c * (**b).clone()),
            (BinaryOp::Mul, false, true) => coefficient(b, symbol).map(|c| (**a).clone() * c),
            (BinaryOp::Div, true, false) => coefficient(a, symbol).map(|c| c / (**b).clone()),
            _ => None,
        },
        Expr::Number(_) | Expr::Call(..) | Expr::Memory(..) => None,
    }
}

/// The coefficient of `symbol` in an expression that is linear in it, where it is made of parameters only.
pub(super) fn constant_coefficient(simulation: &Simulation, expr: &Expr, symbol: &str) -> Option<Expr> {
    let c = coefficient(expr, symbol)?.simplified();
    (!c.has_memory() && only_parameters(simulation, &c)).then_some(c)
}

/// A factor where it is not one.
pub(super) fn unless_one(factor: Expr) -> Option<Expr> {
    (factor != Expr::Number(1.0)).then_some(factor)
}

/// The sum of the constant coefficients of `symbol` over the terms of a sum; terms that are not linear in it are left out.
/// `None` where no term is linear in it with a coefficient of parameters only.
pub(crate) fn linear_coefficient(simulation: &Simulation, expr: &Expr, symbol: &str) -> Option<Expr> {
    let found = expr.terms().into_iter().filter_map(|(sign, term)| {
        let c = constant_coefficient(simulation, term, symbol)?;
        Some(if sign < 0.0 { -c } else { c })
    });
    found.reduce(|a, b| a + b).map(|c| c.simplified())
}

/// The factors of a product: those above the line and those below it, but for ones.
pub(super) struct Factors {
    pub above: Vec<Expr>,
    pub below: Vec<Expr>,
    pub positive: bool,
}

impl Factors {
    /// Of `above/below`.
    fn of_quotient(above: Expr, below: Expr) -> Self {
        let mut factors = Self { above: Vec::new(), below: Vec::new(), positive: true };
        factors.collect(above, false);
        factors.collect(below, true);
        factors
    }

    pub fn of(product: Expr) -> Self {
        Self::of_quotient(product, Expr::Number(1.0))
    }

    fn collect(&mut self, product: Expr, inverted: bool) {
        match product {
            Expr::Binary(BinaryOp::Mul, a, b) => {
                self.collect(*a, inverted);
                self.collect(*b, inverted);
            }
            Expr::Binary(BinaryOp::Div, a, b) => {
                self.collect(*a, inverted);
                self.collect(*b, !inverted);
            }
            Expr::Neg(a) => {
                self.positive = !self.positive;
                self.collect(*a, inverted);
            }
            Expr::Number(n) if n < 0.0 => {
                self.positive = !self.positive;
                self.collect(Expr::Number(-n), inverted);
            }
            Expr::Number(1.0) => {}
            other if inverted => self.below.push(other),
            other => self.above.push(other),
        }
    }

    /// The number that those of the factors make which are numbers, taken out of them. A zero stays.
    pub fn take_number(&mut self) -> f64 {
        let take = |factors: &mut Vec<Expr>| {
            let numbers = factors.extract_if(.., |e| matches!(e, Expr::Number(n) if *n != 0.0));
            numbers.map(|e| if let Expr::Number(n) = e { n } else { 1.0 }).product::<f64>()
        };
        let size = take(&mut self.above) / take(&mut self.below);
        if self.positive { size } else { -size }
    }
}

/// Whether an expression of positive symbols is below zero, term by term.
pub(super) fn is_negative(expr: &Expr) -> bool {
    expr.terms().into_iter().all(|(sign, term)| sign * Factors::of(term.clone()).take_number() < 0.0)
}

/// The product of these factors.
pub(super) fn product(factors: Vec<Expr>) -> Expr {
    factors.into_iter().reduce(|a, b| a * b).unwrap_or(Expr::Number(1.0))
}

/// `above/below` without the factors that both have.
pub(crate) fn quotient(above: Expr, below: Expr) -> Expr {
    let Factors { above: mut up, below: mut down, positive } = Factors::of_quotient(above, below);
    up.retain(|a| match down.iter().position(|b| a == b) {
        Some(at) => {
            down.remove(at);
            false
        }
        None => true,
    });
    let found = (product(up) / product(down)).simplified();
    if positive { found } else { -found }
}

/// The symbols that are no parameters (nor `pi`), in order.
pub(super) fn signals_in(simulation: &Simulation, expr: &Expr) -> impl Iterator<Item = String> {
    expr.symbols().into_iter().filter(|s| s != "pi" && simulation.parameter(s).is_none())
}

/// Whether every symbol is a parameter (or `pi`).
pub(crate) fn only_parameters(simulation: &Simulation, expr: &Expr) -> bool {
    signals_in(simulation, expr).next().is_none()
}

/// An expression for the size of a sum: the sum of the absolute values of its terms, also where the sum as a whole is multiplied or divided by
/// parameters.
///
/// A difference without a parameter of its own, as in `k*(x1 - x2)`, is one signal.
pub(crate) fn size(simulation: &Simulation, expr: &Expr) -> Expr {
    let constant = |e: &Expr| only_parameters(simulation, e);
    let within = |e: &Expr| size(simulation, e);
    match expr {
        Expr::Binary(BinaryOp::Mul, a, b) if constant(a) && is_a_sum(simulation, b) => a.clone().abs() * within(b),
        Expr::Binary(BinaryOp::Mul, a, b) if constant(b) && is_a_sum(simulation, a) => within(a) * b.clone().abs(),
        Expr::Binary(BinaryOp::Div, a, b) if constant(b) && is_a_sum(simulation, a) => within(a) / b.clone().abs(),
        _ => {
            let terms = expr.terms().into_iter().map(|(_, term)| term.clone().abs());
            terms.reduce(|a, b| a + b).unwrap_or(Expr::Number(0.0))
        }
    }
}

/// Whether an expression is a sum of several things, or that times parameters.
fn is_a_sum(simulation: &Simulation, expr: &Expr) -> bool {
    match expr {
        Expr::Binary(BinaryOp::Mul, a, b) if only_parameters(simulation, a) => is_a_sum(simulation, b),
        Expr::Binary(BinaryOp::Mul | BinaryOp::Div, a, b) if only_parameters(simulation, b) => is_a_sum(simulation, a),
        _ => {
            let terms = expr.terms();
            terms.len() > 1 && terms.iter().any(|(_, t)| t.symbols().iter().any(|s| simulation.parameter(s).is_some()))
        }
    }
}

/// Whether the equations are linear in the states, with coefficients of parameters only: two runs under the same inputs then differ by what a third
/// one does, wherever they are.
pub(crate) fn is_linear(simulation: &Simulation) -> bool {
    let linear = |e: &Expr| {
        let mut used = simulation.states.iter().filter(|s| e.uses(&s.name));
        used.all(|s| constant_coefficient(simulation, e, &s.name).is_some())
    };
    simulation.states.iter().all(|s| linear(&s.derivative)) && simulation.outputs.iter().all(|o| linear(&o.expression))
}

/// Whether a term of the sum is made of estimated parameters only: an offset that the fit already has.
pub(crate) fn has_free_constant(simulation: &Simulation, expr: &Expr) -> bool {
    let free = |name: &String| simulation.parameter(name).is_some_and(|p| !p.fixed);
    expr.terms().into_iter().any(|(_, term)| only_parameters(simulation, term) && term.symbols().iter().any(free))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn simulation() -> Simulation {
        Simulation::parse(include_str!("../mechanism/specimens/oscillator.sim.toml"), "oscillator").unwrap()
    }

    #[test]
    fn coefficients_are_collected_over_the_terms() {
        let check = |text: &str, expected: Option<&str>| {
            let found = linear_coefficient(&simulation(), &Expr::parse(text).unwrap(), "x").map(|e| e.to_string());
            assert_eq!(found.as_deref(), expected, "{text}");
        };
        check("u - k*x", Some("-k"));
        check("u - k*(x - v)", Some("-k"));
        check("u - k*x - c*x^3", Some("-k"));
        check("x*k/m + c*x", Some("k/m + c"));
        check("u - v*x", None);
        check("u", None);
    }

    #[test]
    fn what_multiplies_a_state_decides_whether_the_equations_are_linear() {
        let check = |force: &str, output: &str, expected: bool| {
            let text = format!(
                "[time]\nperiod_s = 0.01\n[inputs]\nu = \"u_N\"\n[parameters]\nk = {{ value = 9.0, min = 0.1 }}\n[states]\n\
                 x = {{ derivative = \"v\", initial = 0.0 }}\nv = {{ derivative = \"{force}\", initial = 0.0 }}\n[outputs]\nx_m = \"{output}\"\n"
            );
            let simulation = Simulation::parse(&text, "spring.sim.toml").unwrap();
            assert_eq!(is_linear(&simulation), expected, "{force}, {output}");
        };
        check("(u - k*(x - u^2) - 2*v)/k", "x - v/k + abs(u)", true);
        check("u - k*x - sign(v)", "x", false);
        check("u - k*x*u", "x", false);
        check("u - k*x - 0.1*x*v", "x", false);
        check("u - k*delay(x, 0.1)", "x", false);
        check("u - k*x", "abs(x)", false);
    }

    #[test]
    fn common_factors_cancel() {
        let check = |above: &str, below: &str, expected: &str| {
            let e = |text: &str| Expr::parse(text).unwrap();
            assert_eq!(quotient(e(above), e(below)).to_string(), expected, "{above} over {below}");
        };
        check("k^2*c", "k^2", "c");
        check("k", "k", "1");
        check("c*m", "k*m", "c/k");
        check("c", "k*m", "c/(k*m)");
        check("k*(-c)", "k", "-c");
        check("k*(-1)/n", "k/n^2", "-(n^2/n)");
        check("k/n*c", "c*(k/n)", "1");
    }

    #[test]
    fn the_size_of_a_sum_is_that_of_its_terms_also_under_a_factor() {
        let check = |text: &str, expected: &str| {
            assert_eq!(size(&simulation(), &Expr::parse(text).unwrap()).to_string(), expected, "{text}");
        };
        check("u - k*x", "abs(u) + abs(k*x)");
        check("1000*(u - k*x)", "abs(1000)*(abs(u) + abs(k*x))");
        check("k*(2*(u - c*v))/m", "abs(k)*(abs(2)*(abs(u) + abs(c*v)))/abs(m)");
        // One spring, not two forces.
        check("k*(x - v)", "abs(k*(x - v))");
        check("2*u*(x - c*v)", "abs(2*u*(x - c*v))");
    }

    #[test]
    fn an_offset_is_a_term_of_estimated_parameters() {
        let check = |text: &str, expected: bool| {
            assert_eq!(has_free_constant(&simulation(), &Expr::parse(text).unwrap()), expected, "{text}");
        };
        check("u - k*x - c", true);
        check("u - k*x - 3", false);
        check("u - k*x", false);
    }
}
