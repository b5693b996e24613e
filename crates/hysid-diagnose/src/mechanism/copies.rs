//! Copies of a derivative elsewhere in the equations.
//!
//! An acceleration acts on what hangs from the part that has it: the trolley of a crane swings its load, and an engineer writes the trolley's
//! `(F - c*v)/M` into the load's equation once more. What is missing in the one is missing in the other.

use hysid_plant::{BinaryOp, Expr, Simulation};

/// Puts a derivative that was rewritten in the place of what it was before, wherever else it stands: in the other states' derivatives, and in the outputs
/// but for those columns. Also under factors, as in `cos(q)*(F - c*v)/(M*L)`.
pub(super) fn follow(simulation: &mut Simulation, state: &str, before: &Expr, after: &Expr, but: &[&str]) {
    let renew = |e: &Expr| e.clone().map(&mut |part| renewed(part, before, after));
    for other in simulation.states.iter_mut().filter(|s| s.name != state) {
        other.derivative = renew(&other.derivative);
    }
    for output in simulation.outputs.iter_mut().filter(|o| !but.contains(&o.column.as_str())) {
        output.expression = renew(&output.expression);
    }
}

/// What comes in the place of an expression that is `before`, or that times something.
pub(super) fn renewed(part: Expr, before: &Expr, after: &Expr) -> Expr {
    use Expr::Binary;
    if part == *before {
        return after.clone();
    }
    match (&part, before, after) {
        (Binary(BinaryOp::Div, a, b), Binary(BinaryOp::Div, one, below), _)
            if **one == Expr::Number(1.0) && b == below =>
        {
            (**a).clone() * after.clone()
        }
        (Binary(BinaryOp::Div, a, b), Binary(BinaryOp::Div, force, mass), Binary(BinaryOp::Div, forces, masses))
            if has_factor(a, force) && has_factor(b, mass) =>
        {
            with_factor(a, force, forces) / with_factor(b, mass, masses)
        }
        _ => part,
    }
}

/// Whether a product or quotient, of either sign, has this factor above its line.
fn has_factor(product: &Expr, factor: &Expr) -> bool {
    let within = |part: &Expr| has_factor(part, factor);
    match product {
        _ if product == factor => true,
        Expr::Binary(BinaryOp::Mul, a, b) => within(a) || within(b),
        Expr::Binary(BinaryOp::Div, a, _) | Expr::Neg(a) => within(a),
        _ => false,
    }
}

/// A product or quotient with another factor in the place of this one, which it has.
fn with_factor(product: &Expr, factor: &Expr, by: &Expr) -> Expr {
    match product {
        _ if product == factor => by.clone(),
        Expr::Binary(BinaryOp::Mul, a, b) if has_factor(a, factor) => with_factor(a, factor, by) * (**b).clone(),
        Expr::Binary(BinaryOp::Mul, a, b) => (**a).clone() * with_factor(b, factor, by),
        Expr::Binary(BinaryOp::Div, a, b) => with_factor(a, factor, by) / (**b).clone(),
        Expr::Neg(a) => -with_factor(a, factor, by),
        other => other.clone(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_acceleration_is_followed_wherever_it_stands() {
        let check = |before: &str, after: &str, load: &str, expected: &str| {
            let text = format!(
                "[time]\nperiod_s = 0.01\n[inputs]\nF = \"drive_N\"\n[parameters]\nM = {{ value = 2.0, min = 0.1 }}\nc = {{ value = 0.3, min = 0.0 }}\n\
                 L = {{ value = 1.0, min = 0.1 }}\n[states]\nv = {{ derivative = \"{before}\", initial = 0.0 }}\nq = {{ derivative = \"w\", initial = 0.0 }}\n\
                 w = {{ derivative = \"{load}\", initial = 0.0 }}\n[outputs]\nv_m_s = \"v\"\nangle_rad = \"q\"\nacc = \"{before}\"\nforce_N = \"M*({before})\"\n"
            );
            let mut simulation = Simulation::parse(&text, "test.sim.toml").unwrap();
            let [before, after] = [before, after].map(|e| Expr::parse(e).unwrap());
            follow(&mut simulation, "v", &before, &after, &["acc"]);
            let of = |name: &str| simulation.states.iter().find(|s| s.name == name).unwrap().derivative.to_string();
            assert_eq!(of("w"), expected);
            assert_eq!(of("v"), before.to_string());
            let column = |name: &str| simulation.outputs.iter().find(|o| o.column == name).unwrap().expression.clone();
            assert_eq!(column("acc"), before);
            assert_eq!(column("force_N"), (Expr::symbol("M") * after));
        };
        let (before, after) = ("(F - c*v)/M", "(F - c*v - h)/M");
        check(before, after, "-(9.81*q + (F - c*v)/M)/L", "-(9.81*q + (F - c*v - h)/M)/L");
        check(before, after, "-cos(q)*(F - c*v)/(M*L) - q", "-cos(q)*(F - c*v - h)/(M*L) - q");
        check(before, after, "-(F - c*v)/M/L - q", "-(F - c*v - h)/M/L - q");
        check(before, after, "q*(F - c*v)/L/M - q", "q*(F - c*v - h)/L/M - q");
        // The same sum over another mass is another force.
        check(before, after, "(F - c*v)/L - q", "(F - c*v)/L - q");
        check(before, "(F - c*v - h)/(M + m)", "(F - c*v)/(M*L)", "(F - c*v - h)/((M + m)*L)");
        check("F/M - c/M*v", "F/M - c/M*v - h/M", "-q - (F/M - c/M*v)/L", "-q - (F/M - c/M*v - h/M)/L");
    }
}
