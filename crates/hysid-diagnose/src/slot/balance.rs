//! Balances of forces that a number turns into another unit.
//!
//! `1000*(F - c*v - k*x)/m` is an acceleration in mm/s^2 where the forces are in N. What is missing there is missing among the forces: it should be told in
//! their unit, and each of them should be a term by itself.

use hysid_plant::{BinaryOp, Expr, Simulation};

use super::algebra::{Factors, product};

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
    Factors::of(mass.clone()).take_number().abs() != 1.0
}

/// A sum of forces times a number over a mass as the sum over the mass in that number's unit; `None` for anything else, and where there is no number.
fn balance(derivative: &Expr) -> Option<Expr> {
    let mut factors = Factors::of(derivative.clone());
    let number = factors.take_number();
    let [sum] = <[Expr; 1]>::try_from(factors.above).ok()?;
    let is_sum = matches!(sum, Expr::Binary(BinaryOp::Add | BinaryOp::Sub, ..));
    // A minus before it all would make the mass negative.
    if factors.below.is_empty() || !is_sum || !(number > 0.0 && number.is_finite()) || number == 1.0 {
        return None;
    }
    let mass = product(factors.below);
    Some(sum / if number < 1.0 { mass * (1.0 / number) } else { mass / number })
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
