//! The power that a moving part dissipates: of the terms of its equation those that its own velocity makes, times that velocity.

use hysid_plant::Expr;

use super::Slot;
use super::algebra::{coefficient, product};
use super::find::Finder;
use super::motion::{Motion, force_of};

impl Finder<'_> {
    /// Offers what a part dissipates by what this parameter multiplies, as `heat`, and by the rest, as `heat_beside`, each where there is such a term; of one term alone
    /// nothing, since its power is the speed or its square. Nothing either where a term holds the parameter otherwise than as a factor, or another velocity: what a damper
    /// between two parts dissipates is not told by one of them.
    pub(super) fn offer_heat(&self, slot: &mut Slot, motion: &Motion<'_>, parameter: &str) {
        let (force, _) = force_of(self.simulation, motion.derivative);
        let others = |term: &Expr| self.motions.iter().any(|m| m.v != motion.v && term.uses(m.v));
        let (mut own, mut beside) = (Vec::new(), Vec::new());
        for (sign, term) in force.terms() {
            if !term.uses(motion.v) {
                continue;
            }
            let power = product(vec![Expr::Number(-sign), term.clone(), Expr::symbol(motion.v)]);
            match (term.uses(parameter), others(term)) {
                (true, false) if is_multiplied(term, parameter) => own.push(power),
                (true, _) => return,
                (false, false) => beside.push(power),
                (false, true) => {}
            }
        }
        if own.len() + beside.len() < 2 {
            return;
        }
        for (symbol, powers) in [("heat", own), ("heat_beside", beside)] {
            if let Some(power) = powers.into_iter().reduce(|a, b| a + b) {
                slot.offer(self.simulation, symbol, power.simplified());
            }
        }
    }
}

/// Whether a term is a multiple of a symbol.
fn is_multiplied(term: &Expr, symbol: &str) -> bool {
    let without = || term.replace(&Expr::symbol(symbol), &Expr::Number(0.0)).simplified();
    coefficient(term, symbol).is_some() && without() == Expr::Number(0.0)
}

#[cfg(test)]
mod tests {
    use hysid_plant::Simulation;

    use crate::slot::{Place, Slot, Structure};

    fn slots(derivative: &str) -> Vec<Slot> {
        let text = format!(
            "[time]\nperiod_s = 0.01\nhold = \"zero\"\n[inputs]\nu = \"u_Nm\"\n[parameters]\nJ = {{ value = 1.0, min = 0.1, max = 9.0, unit = \"kg m^2\" }}\n\
             b = {{ value = 1.0, min = 0.1, max = 9.0, unit = \"N m s\" }}\nF = {{ value = 1.0, min = 0.1, max = 9.0, unit = \"N m\" }}\n[states]\n\
             q = {{ derivative = \"w\", initial = 0.0, unit = \"rad\" }}\nw = {{ derivative = \"{derivative}\", initial = 0.0, unit = \"rad/s\" }}\n[outputs]\n\
             q_rad = \"q\"\n"
        );
        let simulation = Simulation::parse(&text, "drive.sim.toml").unwrap();
        Structure::of(&simulation).slots.into_iter().filter(|s| s.place == Place::Parameter).collect()
    }

    #[test]
    fn what_a_part_dissipates_is_told_by_the_terms_of_its_velocity() {
        let check = |derivative: &str, parameter: &str, expected: [Option<&str>; 2]| {
            let all = slots(derivative);
            let slot = all.iter().find(|s| s.label == format!("parameter:{parameter}")).unwrap();
            let power = |symbol: &str| slot.quantity(symbol).map(|q| q.expression.to_string());
            assert_eq!([power("heat"), power("heat_beside")], expected.map(|e| e.map(str::to_owned)), "{parameter}");
        };
        let friction = "(u - b*w - F*sign(w))/J";
        check(friction, "F", [Some("F*sign(w)*w"), Some("b*w*w")]);
        check(friction, "b", [Some("b*w*w"), Some("F*sign(w)*w")]);
        check(friction, "J", [None, Some("b*w*w + F*sign(w)*w")]);
        check("(u - b*w - F*q)/J", "b", [None, None]);
        check("u/J - b/J*w - F/J*sign(w)", "F", [Some("F/J*sign(w)*w"), Some("b/J*w*w")]);
        // A parameter that is no factor tells nothing of its share.
        check("(u - F*tanh(b*w/F) - F*sign(w))/J", "b", [None, None]);
    }
}
