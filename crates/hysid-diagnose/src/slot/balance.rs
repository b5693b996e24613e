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

/// A force times a number over a mass as the force over the mass in that number's unit; `None` for anything else, and where there is no number.
///
/// Before a sum any number stands for a unit; before a single force it does where it is a power of a thousand, since two springs are `2*k*x`.
fn balance(derivative: &Expr) -> Option<Expr> {
    let mut factors = Factors::of(derivative.clone());
    let number = factors.take_number();
    let is_sum = matches!(&factors.above[..], [Expr::Binary(BinaryOp::Add | BinaryOp::Sub, ..)]);
    let size = number.abs();
    let is_a_unit = size.is_normal() && size != 1.0 && (is_sum || is_power_of_ten(size, 3.0));
    if factors.below.is_empty() || factors.above.is_empty() || !is_a_unit {
        return None;
    }
    let (force, mass) = (product(factors.above), product(factors.below));
    // A minus before it all stays with the force: no mass is negative.
    let force = if number < 0.0 { -force } else { force };
    Some(force / if size < 1.0 { mass * (1.0 / size) } else { mass / size })
}

/// Whether a number is a whole power of ten to the `decades`, but for its sign: it may be nothing but a change of the unit.
pub(super) fn is_power_of_ten(number: f64, decades: f64) -> bool {
    let times = number.abs().log10() / decades;
    (times - times.round()).abs() < 1e-9
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
        check("-1000*(c*v + k*x)/m", Some("-(c*v + k*x)/(m/1000)"));
        check("-1000*k*x/m", Some("-(k*x)/(m/1000)"));
        check("1000*f/m", Some("f/(m/1000)"));
        for other in ["(f - k*x)/m", "-(f - k*x)/m", "1000*(f - k*x)", "2*k*(f - x)/m", "1000/m", "f - 1000*x/m"] {
            check(other, None);
        }
        let scaled = |mass: &str| is_scaled(&Expr::parse(mass).unwrap());
        assert!(scaled("m/1000") && scaled("2*m") && !scaled("m") && !scaled("m*n"));
    }
}
