//! Balances of forces that stand in a derivative as a part of it.
//!
//! `1000*(F - c*v - k*x)/m` is an acceleration in mm/s^2 where the forces are in N, and in `(F - c*v - k*x)/m - a_g` the ground's acceleration stands beside
//! them. What is missing there is missing among the forces: it should be told in their unit, and each of them should be a term by itself.

use hysid_plant::{BinaryOp, Expr, Simulation};

use super::algebra::{Factors, only_parameters, product, quotient};
use super::find::has_unit;
use super::motion::{ForcePath, Motion, force_path, is_momentum, motions};
use super::turn::is_rate_of_turn;

/// The same simulation with such numbers in the mass, `(F - c*v - k*x)/(m/1000)`, and such accelerations among the forces, `(F - c*v - k*x - m*a_g)/m`.
pub(crate) fn with_balances(simulation: &Simulation) -> Simulation {
    let mut out = simulation.clone();
    for state in &mut out.states {
        if let Some(balance) = balance(&state.derivative) {
            state.derivative = balance;
        }
    }
    for motion in motions(simulation, simulation) {
        if let Some(balance) = gathered(simulation, &motion)
            && let Some(state) = out.state_mut(motion.state)
        {
            state.derivative = balance;
        }
    }
    out
}

/// Whether an expression is a sum.
fn is_sum(expr: &Expr) -> bool {
    matches!(expr, Expr::Binary(BinaryOp::Add | BinaryOp::Sub, ..))
}

/// A sum of which some terms are divided by a mass, as one sum of forces over the mass; `None` for anything else, where all terms are divided by the same
/// already, where several masses divide, and where the divisor may be no mass: a length has the unit of none, and where there are no units terms of the
/// motion stand beside it. What turns has the moment of inertia that its unit asks for.
fn gathered(simulation: &Simulation, motion: &Motion<'_>) -> Option<Expr> {
    let terms = motion.derivative.terms();
    // The rate of a momentum is a force as it is; what divides the momentum in it makes it a velocity.
    let momentum = simulation.state(motion.state).is_some_and(|state| is_momentum(simulation, state));
    if momentum || terms.len() < 2 || !matches!(force_path(simulation, motion.derivative), ForcePath::Bare) {
        return None;
    }
    let below: Vec<Vec<Expr>> = terms.iter().map(|(_, term)| Factors::of((*term).clone()).below).collect();
    let turns = simulation.unit_of(motion.v).is_some_and(|unit| is_rate_of_turn(&unit));
    let unit = if turns { "kg m^2" } else { "kg" };
    let is_inertia = |e: &Expr| only_parameters(simulation, e) && has_unit(simulation.unit_of_expr(e), &[unit]);
    // A factor, as in `k/(n*J)`, or all of them, as in `u/(m*L^2)`.
    let inertias = |below: &Vec<Expr>| -> Vec<Vec<Expr>> {
        let alone = below.iter().map(|e| vec![e.clone()]);
        alone.chain([below.clone()]).filter(|factors| is_inertia(&product(factors.clone()))).collect()
    };
    let divides = |mass: &[Expr], below: &[Expr]| mass.iter().all(|factor| below.contains(factor));
    let known: Vec<Vec<Vec<Expr>>> = below.iter().map(inertias).collect();
    let times = |mass: &Vec<Expr>| below.iter().filter(|below| divides(mass, below)).count();
    // Of those that divide as many terms the first, where `max_by_key` would take the last.
    let mass = match known.iter().flatten().rev().max_by_key(|mass| times(mass)) {
        Some(mass) => {
            let others = known.iter().zip(&below).any(|(known, below)| !known.is_empty() && !divides(mass, below));
            (!others).then(|| product(mass.clone()))?
        }
        None => unknown_mass(simulation, &terms, &below)?.clone(),
    };
    let forces = terms.iter().map(|(sign, term)| match quotient(mass.clone() * (*term).clone(), Expr::Number(1.0)) {
        Expr::Neg(force) => (-sign, *force),
        force => (*sign, force),
    });
    let joined = forces.fold(None, |sum: Option<Expr>, (sign, force)| {
        Some(match (sum, sign < 0.0) {
            (None, false) => force,
            (None, true) => -force,
            (Some(sum), false) => sum + force,
            (Some(sum), true) => sum - force,
        })
    });
    Some(joined? / mass)
}

/// What divides a sum, where its unit is not told and what stands beside the sum is none of the motion.
fn unknown_mass<'b>(simulation: &Simulation, terms: &[(f64, &Expr)], below: &'b [Vec<Expr>]) -> Option<&'b Expr> {
    let moves = |term: &Expr| term.symbols().iter().any(|s| simulation.state(s).is_some());
    let mut found = None;
    for ((_, term), below) in terms.iter().zip(below) {
        match (below.as_slice(), Factors::of((*term).clone()).above.as_slice()) {
            ([mass], [sum]) if is_sum(sum) && only_parameters(simulation, mass) => {
                if simulation.unit_of_expr(mass).is_some() || found.is_some_and(|known| known != mass) {
                    return None;
                }
                found = Some(mass);
            }
            _ if moves(term) => return None,
            _ => {}
        }
    }
    found
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
    let of_a_sum = matches!(&factors.above[..], [sum] if is_sum(sum));
    let size = number.abs();
    let is_a_unit = size.is_normal() && size != 1.0 && (of_a_sum || is_power_of_ten(size, 3.0));
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
    }

    /// What the equation of a mass becomes, whose unit is given or not, as is that of its speed.
    fn equation(derivative: &str, unit: &str, speed: &str) -> Option<String> {
        let text = format!(
            "[time]\nperiod_s = 0.01\n[inputs]\na = \"drive\"\n[parameters]\nk = {{ value = 9.0, min = 0.1 }}\nc = {{ value = 1.0, min = 0.1 }}\n\
             m = {{ value = 2.0, min = 0.1{unit} }}\n[states]\nx = {{ derivative = \"v\", initial = 0.0 }}\nv = {{ derivative = \"{derivative}\", initial = 0.0{speed} }}\n\
             [outputs]\nx_m = \"x\"\n"
        );
        let simulation = Simulation::parse(&text, "storey.sim.toml").unwrap();
        gathered(&simulation, &motions(&simulation, &simulation)[0]).map(|e| e.to_string())
    }

    #[test]
    fn accelerations_beside_a_balance_go_among_its_forces() {
        let check = |derivative: &str, unit: &str, expected: Option<&str>| {
            assert_eq!(equation(derivative, unit, "").as_deref(), expected, "{derivative}");
        };
        let kg = ", unit = \"kg\"";
        for unit in ["", kg] {
            check("(-k*x - c*v)/m - a", unit, Some("(-k*x - c*v - m*a)/m"));
            check("-a + 1/m*(-k*x - c*v)", unit, Some("(-(m*a) + (-k*x - c*v))/m"));
            check("9.81 - (k*x + c*v)/m", unit, Some("(m*9.81 - (k*x + c*v))/m"));
            for other in ["(-k*x - c*v)/m", "a/m - k*x/m", "(-k*x - c*v)/m - a/m", "-k*x - c*v - a"] {
                check(other, unit, None);
            }
        }
        // A length has no unit of a mass, and without units it may be one.
        let pendulum = "(-9.81*sin(x) - a)/m - c*v";
        check(pendulum, ", unit = \"m\"", None);
        check(pendulum, "", None);
        check("(-k*x - a)/m - c*v", kg, Some("(-k*x - a - m*c*v)/m"));
        check("-k/m*x - c/m*v - a", kg, Some("(-(k*x) - c*v - m*a)/m"));
        check("-k/m*x - c/m*v - a", "", None);
        check("(a - k*x)/m + (a - c*v)/k", "", None);
        // Behind a gear, and between two masses.
        check("(a - c*v)/m - k*(x/9 - a)/(9*m)", kg, Some("(a - c*v - k*(x/9 - a)/9)/m"));
        check("(a - c*v)/m - k*x/(k*m)", kg, Some("(a - c*v - x)/m"));
        // What turns has a moment of inertia.
        let turning = |unit: &str| equation("a/(m*9^2) - k*sin(x) - c*v", unit, ", unit = \"rad/s\"");
        assert_eq!(turning(kg), None);
        let inertia = turning(", unit = \"kg m^2\"");
        assert_eq!(inertia.as_deref(), Some("(a/81 - m*k*sin(x) - m*c*v)/m"));
        // The rate of a momentum is a force already.
        assert_eq!(equation("a - k*x - c*v/m", kg, ", unit = \"g*mm/ms\""), None);
        assert_eq!(equation("a - k*x - c*v/m", kg, "").as_deref(), Some("(m*a - m*k*x - c*v)/m"));
    }

    #[test]
    fn a_mass_may_hold_a_number() {
        let scaled = |mass: &str| is_scaled(&Expr::parse(mass).unwrap());
        assert!(scaled("m/1000") && scaled("2*m") && !scaled("m") && !scaled("m*n"));
    }
}
