//! The power that a moving part dissipates: of the terms of its equation those that its own velocity makes, times that velocity; and the slip at which a damper
//! between two parts does.

use hysid_plant::{BinaryOp, Expr};

use super::Slot;
use super::algebra::{Factors, coefficient, only_parameters, product, signals_in};
use super::connections::signed;
use super::find::{Finder, has_unit};
use super::motion::{Kinematic, Motion, force_of};
use super::pattern::factors;

impl Finder<'_> {
    /// The difference of the velocities of two ends that a parameter multiplies, as `n_in - n` in `c*(n_in - n)`: what a coupling between them dissipates goes by
    /// that. `None` where the parameter multiplies none, or more than one.
    pub(super) fn slip(&self, parameter: &str) -> Option<Expr> {
        let moves =
            |name: &str| self.motions.iter().any(|m| m.v == name) || self.kinematic_input(name) == Kinematic::Velocity;
        let is_end = |term: &Expr| {
            let mut signals = signals_in(self.simulation, term);
            signals.next().is_some_and(|s| moves(&s)) && signals.next().is_none()
        };
        let is_slip =
            |e: &Expr| matches!(e.terms()[..], [(a, one), (b, other)] if a * b < 0.0 && is_end(one) && is_end(other));
        // In each equation it may multiply nothing else.
        let multiplied = |motion: &Motion<'_>| {
            let all = coefficient(motion.derivative, parameter)?;
            let (slips, others): (Vec<&Expr>, Vec<&Expr>) = factors(&all).into_iter().partition(|f| is_slip(f));
            let [slip] = slips[..] else { return None };
            others.into_iter().all(|f| only_parameters(self.simulation, f)).then(|| slip.clone())
        };
        let parts = self.motions.iter().filter(|m| m.derivative.uses(parameter));
        let found: Vec<Expr> = parts.map(multiplied).collect::<Option<_>>()?;
        // From either end it is the same.
        let ends = |e: &Expr| {
            let mut ends: Vec<String> = e.terms().into_iter().map(|(_, end)| end.to_string()).collect();
            ends.sort_unstable();
            ends
        };
        let first = found.first()?;
        found.iter().all(|e| ends(e) == ends(first)).then(|| first.clone())
    }

    /// The current through a resistance where it is no signal of the simulation.
    pub(super) fn resisted_current(&self, parameter: &str) -> Option<Expr> {
        let resists = has_unit(self.simulation.unit_of(parameter), &["Ohm"]);
        resists.then(|| self.driven_current(parameter).or_else(|| self.flux_current(parameter)))?
    }

    /// The current that a voltage drives through a resistance, as `(u - K*w)/R`, where it is the same in all equations.
    fn driven_current(&self, resistance: &str) -> Option<Expr> {
        let mut voltages = Vec::new();
        let mut uses = 0;
        for equation in self.equations() {
            self.over(&equation, resistance, &mut voltages);
            equation.visit(&mut |e| uses += usize::from(*e == Expr::symbol(resistance)));
        }
        let first = voltages.first()?;
        let same = voltages.len() == uses && voltages.iter().all(|v| v == first);
        (same && !only_parameters(self.simulation, first)).then(|| first.clone() / Expr::symbol(resistance))
    }

    /// The current that is told by a flux linkage and flows through a resistance, as `psi/L` in `u - R*psi/L`.
    fn flux_current(&self, resistance: &str) -> Option<Expr> {
        self.simulation.states.iter().find_map(|state| {
            let (_, current) = signed(coefficient(&state.derivative, resistance)?);
            has_unit(self.simulation.unit_of_expr(&current), &["A"]).then_some(current)
        })
    }

    /// Collects what is no parameter of each product that is divided by this one.
    fn over(&self, expr: &Expr, divisor: &str, found: &mut Vec<Expr>) {
        match expr {
            Expr::Binary(BinaryOp::Mul | BinaryOp::Div, ..) | Expr::Neg(_) => {
                let Factors { above, below, .. } = Factors::of(expr.clone());
                above.iter().chain(&below).for_each(|f| self.over(f, divisor, found));
                if below.contains(&Expr::symbol(divisor)) {
                    found.push(product(above.into_iter().filter(|f| !only_parameters(self.simulation, f)).collect()));
                }
            }
            Expr::Binary(_, a, b) => [a, b].iter().for_each(|e| self.over(e, divisor, found)),
            Expr::Call(_, all) | Expr::Memory(_, all) => all.iter().for_each(|e| self.over(e, divisor, found)),
            Expr::Number(_) | Expr::Symbol(_) => {}
        }
    }

    /// Offers what a part dissipates by all of its terms as `heat`; of one term alone nothing, since its power is the speed or its square. Nothing either where
    /// this parameter stands beside another velocity: what a damper between two parts dissipates is not told by one of them.
    pub(super) fn offer_heat(&self, slot: &mut Slot, motion: &Motion<'_>, parameter: &str) {
        let (force, _) = force_of(self.simulation, motion.derivative);
        let of_others = |term: &Expr| self.motions.iter().any(|m| m.v != motion.v && term.uses(m.v));
        let terms: Vec<_> = force.terms().into_iter().filter(|(_, term)| term.uses(motion.v)).collect();
        if terms.iter().any(|(_, term)| term.uses(parameter) && of_others(term)) {
            return;
        }
        let own = terms.into_iter().filter(|(_, term)| !of_others(term));
        let powers: Vec<Expr> =
            own.map(|(sign, term)| product(vec![Expr::Number(-sign), term.clone(), Expr::symbol(motion.v)])).collect();
        if powers.len() > 1
            && let Some(power) = powers.into_iter().reduce(|a, b| a + b)
        {
            slot.offer(self.simulation, "heat", power.simplified());
        }
    }
}

#[cfg(test)]
mod tests {
    use hysid_plant::Simulation;

    use crate::slot::{Place, Structure};

    #[test]
    fn what_a_part_dissipates_is_told_by_the_terms_of_its_velocity() {
        let check = |derivative: &str, expected: [Option<&str>; 3]| {
            let text = format!(
                "[time]\nperiod_s = 0.01\nhold = \"zero\"\n[inputs]\nu = \"u_Nm\"\n[parameters]\nJ = {{ value = 1.0, min = 0.1, max = 9.0, unit = \"kg m^2\" }}\n\
                 b = {{ value = 1.0, min = 0.1, max = 9.0, unit = \"N m s\" }}\nF = {{ value = 1.0, min = 0.1, max = 9.0, unit = \"N m\" }}\n[states]\n\
                 q = {{ derivative = \"w\", initial = 0.0, unit = \"rad\" }}\nw = {{ derivative = \"{derivative}\", initial = 0.0, unit = \"rad/s\" }}\n\
                 p = {{ derivative = \"r\", initial = 0.0, unit = \"rad\" }}\nr = {{ derivative = \"-b*(r - w)/J\", initial = 0.0, unit = \"rad/s\" }}\n[outputs]\n\
                 q_rad = \"q\"\np_rad = \"p\"\n"
            );
            let simulation = Simulation::parse(&text, "drive.sim.toml").unwrap();
            let slots = Structure::of(&simulation).slots;
            let found = ["J", "F", "b"].map(|name| {
                let at = |s: &&crate::slot::Slot| s.place == Place::Parameter && s.label == format!("parameter:{name}");
                slots.iter().find(at).unwrap().quantity("heat").map(|q| q.expression.to_string())
            });
            assert_eq!(found, expected.map(|e| e.map(str::to_owned)), "{derivative}");
        };
        let both = Some("b*w*w + F*sign(w)*w");
        check("(u - b*w - F*sign(w))/J", [both, both, both]);
        check("(u - F*sign(w))/J", [None; 3]);
        check("u/J - b/J*w - F/J*sign(w)", [Some("b/J*w*w + F/J*sign(w)*w"); 3]);
        // What the damper between the two dissipates is told by neither.
        check(
            "(u - b*(w - r) - 0.2*w*F - F*sign(w))/J",
            [Some("0.2*w*F*w + F*sign(w)*w"), Some("0.2*w*F*w + F*sign(w)*w"), None],
        );
    }

    #[test]
    fn a_coupling_is_heated_by_its_slip() {
        let rate = |unit: &str, clutch: &str, hub: &str| {
            let text = format!(
                "[time]\nperiod_s = 0.01\n[inputs]\nn_in = \"shaft_{unit}\"\n[parameters]\nJ = {{ value = 0.4, min = 0.1, unit = \"kg m^2\" }}\n\
                 c = {{ value = 0.3, min = 0.1, unit = \"N m s/rad\" }}\n[states]\n\
                 n = {{ derivative = \"(30/pi)*({clutch} - 0.1*n^2)/J\", initial = 0.0 }}\nr = {{ derivative = \"({hub} - 0.2*r)/J\", initial = 0.0 }}\n\
                 [outputs]\nfan_rpm = \"n\"\nhub_rad_s = \"r\"\n"
            );
            let slots = Structure::of(&Simulation::parse(&text, "clutch.sim.toml").unwrap()).slots;
            let slot = slots.iter().find(|s| s.label == "parameter:c").unwrap();
            slot.quantity("v").map(|q| q.expression.to_string())
        };
        assert_eq!(rate("rpm", "c*(n_in - n)*pi/30", "1").as_deref(), Some("n_in - n"));
        // Seen from the other end.
        assert_eq!(rate("rpm", "c*(r - n)", "c*(n - r)").as_deref(), Some("r - n"));
        // Two couplings of one parameter, one to a wall, what is no velocity.
        assert_eq!(rate("rpm", "c*(n_in - n)", "c*(n - r)").as_deref(), Some("n"));
        assert_eq!(rate("rpm", "c*(1 - n)", "1").as_deref(), Some("n"));
        assert_eq!(rate("bar", "c*(n_in - n)", "1").as_deref(), Some("n"));
    }

    #[test]
    fn a_winding_is_heated_by_its_current_and_not_by_what_it_moves() {
        let text = "[time]\nperiod_s = 0.01\n[inputs]\nu = \"u_V\"\n[parameters]\nL = { value = 0.01, min = 0.001, unit = \"H\" }\n\
                    R = { value = 1.0, min = 0.1, unit = \"ohm\" }\nK = { value = 0.05, min = 0.01, unit = \"N m/A\" }\nb = { value = 0.1, min = 0.01, unit = \"N m s/rad\" }\n\
                    J = { value = 0.1, min = 0.01, unit = \"kg m^2\" }\n[states]\nw = { derivative = \"(K*i - b*w)/J\", initial = 0.0, unit = \"rad/s\" }\n\
                    i = { derivative = \"(u - R*i - K*w)/L\", initial = 0.0, unit = \"A\" }\n[outputs]\nspeed_rad_s = \"w\"\ncurrent_A = \"i\"\n";
        let slots = Structure::of(&Simulation::parse(text, "motor.sim.toml").unwrap()).slots;
        let at = |name: &str| slots.iter().find(|s| s.label == format!("parameter:{name}")).unwrap();
        let rate = |name: &str| at(name).quantity("v").map(|q| q.expression.to_string());
        assert_eq!(["R", "b", "K"].map(rate), ["i", "w", "w"].map(|v| Some(v.to_owned())));
        assert!(at("R").dissipates());
    }

    #[test]
    fn a_coil_that_is_told_by_its_flux_linkage_is_heated_by_its_current() {
        let rate = |unit: &str, voltage: &str| {
            let text = format!(
                "[time]\nperiod_s = 1e-4\n[inputs]\nu = \"amp_V\"\n[parameters]\nL = {{ value = 3e-4, min = 1e-5, unit = \"H\" }}\n\
                 R = {{ value = 0.1, min = 0.01, unit = \"{unit}\" }}\nT = {{ value = 3e-3, min = 1e-4, unit = \"s\" }}\n[states]\n\
                 psi = {{ derivative = \"{voltage}\", initial = 0.0, unit = \"V s\" }}\ni = {{ derivative = \"(psi/L - i)/T\", initial = 0.0, unit = \"A\" }}\n\
                 [outputs]\ncoil_A = \"psi/L\"\neddy_A = \"i\"\n"
            );
            let slots = Structure::of(&Simulation::parse(&text, "coil.sim.toml").unwrap()).slots;
            let slot = slots.into_iter().find(|s| s.label == "parameter:R").unwrap();
            (slot.quantity("v").map(|q| q.expression.to_string()), slot.dissipates())
        };
        assert_eq!(rate("Ohm", "u - R*psi/L"), (Some("psi/L".to_owned()), true));
        assert_eq!(rate("Ohm", "u - R/L*psi"), (Some("psi/L".to_owned()), true));
        assert_eq!(rate("1/s", "u - R*psi"), (None, false));
    }

    #[test]
    fn a_winding_without_inductance_is_heated_by_its_current() {
        let rate = |unit: &str, derivative: &str, output: &str| {
            let text = format!(
                "[time]\nperiod_s = 0.01\n[inputs]\nu = \"u_V\"\n[parameters]\nR = {{ value = 1.0, min = 0.1, unit = \"{unit}\" }}\nK = {{ value = 0.05, min = 0.01 }}\n\
                 J = {{ value = 0.1, min = 0.01 }}\n[states]\nw = {{ derivative = \"{derivative}\", initial = 0.0, unit = \"rad/s\" }}\n[outputs]\ni_A = \"{output}\"\n"
            );
            let slots = Structure::of(&Simulation::parse(&text, "motor.sim.toml").unwrap()).slots;
            let slot = slots.into_iter().find(|s| s.label == "parameter:R").unwrap();
            (slot.quantity("v").map(|q| q.expression.to_string()), slot.dissipates())
        };
        let current = (Some("(u - K*w)/R".to_owned()), true);
        assert_eq!(rate("Ohm", "(K*(u - K*w)/R - 0.1*w)/J", "(u - K*w)/R"), current);
        assert_eq!(rate("Ohm", "K/R*(u - K*w)/J", "(u - K*w)/R"), current);
        // Of another unit, two voltages, and where it divides and multiplies.
        let turning = |found: (Option<String>, bool)| assert_eq!(found.0.as_deref(), Some("w"));
        turning(rate("K/W", "(K*(u - K*w)/R - 0.1*w)/J", "(u - K*w)/R"));
        turning(rate("Ohm", "(K*(u - K*w)/R - 0.1*w)/J", "(u - w)/R"));
        turning(rate("Ohm", "(K*(u - K*w)/R - 0.1*w)/J", "(u - w)*R"));
    }
}
