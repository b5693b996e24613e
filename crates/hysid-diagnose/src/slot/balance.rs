//! Balances of forces that a number turns into another unit.
//!
//! `1000*(F - c*v - k*x)/m` is an acceleration in mm/s^2 where the forces are in N. What is missing there is missing among the forces: it should be told in
//! their unit, and each of them should be a term by itself.

use hysid_plant::{BinaryOp, Expr, Simulation};

/// The same simulation with such numbers in the mass: `(F - c*v - k*x)/(m/1000)`.
pub(crate) fn with_balances(simulation: &Simulation) -> Simulation {
    let mut out = simulation.clone();
    for state in &mut out.states {
        if let Some(balance) = balance(&state.derivative) {
            state.derivative = balance;
        }
    }
    out
}

/// Whether a number other than one is among the factors of a mass.
pub(super) fn is_scaled(mass: &Expr) -> bool {
    let mut factors = Factors::default();
    factors.collect(mass, false);
    factors.number != 1.0
}

/// The factors of a product.
#[derive(Default)]
struct Factors {
    above: Vec<Expr>,
    below: Vec<Expr>,
    number: f64,
    begun: bool,
}

impl Factors {
    fn collect(&mut self, product: &Expr, inverted: bool) {
        if !self.begun {
            (self.number, self.begun) = (1.0, true);
        }
        match product {
            Expr::Number(n) if inverted => self.number /= n,
            Expr::Number(n) => self.number *= n,
            Expr::Binary(BinaryOp::Mul, a, b) => {
                self.collect(a, inverted);
                self.collect(b, inverted);
            }
            Expr::Binary(BinaryOp::Div, a, b) => {
                self.collect(a, inverted);
                self.collect(b, !inverted);
            }
            other if inverted => self.below.push(other.clone()),
            other => self.above.push(other.clone()),
        }
    }
}

/// A sum of forces times a number over a mass as the sum over the mass in that number's unit; `None` for anything else, and where there is no number.
fn balance(derivative: &Expr) -> Option<Expr> {
    let mut factors = Factors::default();
    factors.collect(derivative, false);
    let Factors { above, below, number, .. } = factors;
    let [sum] = <[Expr; 1]>::try_from(above).ok()?;
    let mass = below.into_iter().reduce(|a, b| a * b)?;
    let is_sum = matches!(sum, Expr::Binary(BinaryOp::Add | BinaryOp::Sub, ..));
    // A minus before it all would make the mass negative.
    (is_sum && number > 0.0 && number.is_finite() && number != 1.0)
        .then(|| sum / if number < 1.0 { mass * (1.0 / number) } else { mass / number })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_before_a_balance_go_into_the_mass() {
        let check = |derivative: &str, expected: Option<&str>| {
            let found = balance(&Expr::parse(derivative).unwrap()).map(|e| e.to_string());
            assert_eq!(found.as_deref(), expected, "{derivative}");
        };
        let forces = "f - 0.001*c*v - k*x";
        for (before, after) in
            [("1000*(", ")/m"), ("(", ")/m*1000"), ("1000/m*(", ")"), ("(", ")*1000/m"), ("1e6*((", ")/(m*1000))")]
        {
            check(&format!("{before}{forces}{after}"), Some("(f - 0.001*c*v - k*x)/(m/1000)"));
        }
        check("0.25*(f - k*x)/m", Some("(f - k*x)/(m*4)"));
        for other in
            ["(f - k*x)/m", "-1000*(f - k*x)/m", "1000*(f - k*x)", "1000*k*(f - x)/m", "1000*f/m", "f - 1000*x/m"]
        {
            check(other, None);
        }
        let scaled = |mass: &str| is_scaled(&Expr::parse(mass).unwrap());
        assert!(scaled("m/1000") && scaled("2*m") && !scaled("m") && !scaled("m*n"));
    }
}
