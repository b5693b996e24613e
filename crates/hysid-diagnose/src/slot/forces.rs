//! The slots at which forces stand: on a moving part, at the output of a static force law.

use hysid_plant::{Expr, Output, State};

use super::algebra::{
    coefficient, has_free_constant, is_negative, linear_coefficient, only_parameters, product, quotient, size,
};
use super::balance::is_scaled;
use super::connections::forces_of;
use super::find::{Finder, has_unit, presses};
use super::motion::{ForcePath, Kinematic, Motion, angle, force_path};
use super::{Place, Pull, Slot, Target};

impl Finder<'_> {
    /// Offers what every force slot has: the size of the forces, the mass, the linear stiffness and damping. `scale` is what the rate of the
    /// displacement is for each unit of the velocity where that is not one.
    pub(super) fn offer_force(
        &self,
        slot: &mut Slot,
        derivative: &Expr,
        x: Option<&str>,
        v: &str,
        scale: Option<&Expr>,
    ) {
        let simulation = self.simulation;
        let below = |symbol: &str, force: &Expr| Some((-linear_coefficient(simulation, force, symbol)?).simplified());
        let (force, mass) = match force_path(simulation, derivative) {
            ForcePath::Quotient(force, mass) => {
                slot.offer(simulation, "F", size(simulation, force));
                (force, Some(mass))
            }
            ForcePath::Divided(mass) => {
                slot.offer(simulation, "F", mass.clone() * size(simulation, derivative));
                (derivative, Some(mass))
            }
            ForcePath::Bare => {
                slot.offer(simulation, "F", size(simulation, derivative));
                (derivative, None)
            }
        };
        let divided = matches!(force_path(simulation, derivative), ForcePath::Divided(_));
        let scaled = |e: Expr| match mass {
            Some(mass) if divided => (mass.clone() * e).simplified(),
            _ => e,
        };
        if let Some(k) = x.and_then(|x| below(x, force)) {
            slot.offer(simulation, "k", scaled(k));
        }
        if let Some(c) = below(v, force) {
            let c = scale.map_or(c.clone(), |scale| quotient(c, scale.clone()));
            slot.offer(simulation, "c", scaled(c));
        }
        if let Some(mass) = mass.filter(|m| only_parameters(simulation, m)) {
            slot.offer(simulation, "m", mass.clone());
            // A mass in the units of force, length and time of the equations, which may be none that has a name.
            if is_scaled(mass) {
                slot.forget_unit("m");
            }
        }
        if let Some(input) = simulation.inputs.iter().find(|i| force.uses(&i.symbol)) {
            slot.offer(simulation, "u", Expr::symbol(&input.symbol));
        }
        slot.constant = has_free_constant(simulation, force);
    }

    /// The force that other parts put on one: the terms that hold their motion, or what is wound up between them and it.
    pub(super) fn transmitted(&self, motion: &Motion<'_>) -> Option<Expr> {
        self.forces_on(motion, true)
    }

    /// The force on a part that does, or does not, come from others.
    pub(super) fn forces_on(&self, motion: &Motion<'_>, from_others: bool) -> Option<Expr> {
        let simulation = self.simulation;
        let others = || self.motions.iter().filter(|m| m.v != motion.v);
        let wound = |state: &&State| {
            let rate = &state.derivative;
            !self.moves(&state.name) && rate.uses(motion.v) && others().any(|m| rate.uses(m.v))
        };
        let wound: Vec<&State> = simulation.states.iter().filter(wound).collect();
        let passed = |term: &Expr| {
            others().any(|m| term.uses(m.v) || m.x.is_some_and(|x| term.uses(x)))
                || wound.iter().any(|s| term.uses(&s.name))
        };
        let terms = forces_of(simulation, motion).filter(|(_, term)| passed(term) == from_others);
        let sum = terms.map(|(sign, term)| product(vec![Expr::Number(sign), term.clone()])).reduce(|a, b| a + b)?;
        let load = match force_path(simulation, motion.derivative) {
            ForcePath::Divided(mass) => mass.clone() * sum,
            ForcePath::Quotient(..) | ForcePath::Bare => sum,
        };
        Some(load.simplified())
    }

    /// The inputs that press, by their unit or for all that is known, and that the simulation as the user wrote it makes no use of, as they are offered.
    pub(super) fn idle_loads(&self) -> Vec<String> {
        let idle = |symbol: &str| {
            !self.original.expressions().into_iter().any(|(_, e)| e.uses(symbol))
                && self.simulation.unit_of(symbol).is_none_or(|u| presses(&u))
                && self.kinematic_input(symbol) == Kinematic::Neither
        };
        let inputs = (1..).zip(&self.simulation.inputs);
        inputs.filter(|(_, i)| idle(&i.symbol)).map(|(i, _)| format!("u_{i}")).collect()
    }

    pub(super) fn motion_slot(&self, place: Place, label: String, motion: &Motion<'_>) -> Slot {
        let target = Target::Derivatives(vec![Pull::new(motion.state, 1.0)]);
        let mut slot = Slot::new(place, label, format!("at {}", motion.name()), target);
        let v = Expr::symbol(motion.v);
        slot.loops = self.loops(&v);
        if let Some(control) = self.control(motion.derivative, &v) {
            slot.offer(self.simulation, "control", control);
        }
        self.offer_motion(&mut slot, motion);
        if let Some(rad) = motion.x.and_then(|x| self.simulation.unit_of(x).as_ref().and_then(angle)) {
            slot.offer(self.simulation, "rad", rad);
        }
        if let Some(turn) = motion.turn.and_then(|turn| self.simulation.state(turn)) {
            let rad = linear_coefficient(self.simulation, &turn.derivative, motion.v);
            slot.offer(self.simulation, "rad", rad.unwrap_or(Expr::Number(1.0)));
        }
        self.offer_force(&mut slot, motion.derivative, motion.x, motion.v, motion.scale.as_ref());
        if let Some(load) = self.transmitted(motion) {
            // It is a term of the sum that the forces are.
            slot.offer(self.simulation, "load", load);
            slot.measure_alike("load", "F");
        }
        slot.context = vec![motion.derivative.clone()];
        slot.offer_own_sign(self.simulation);
        slot
    }

    pub(super) fn forces(&self) -> Vec<Slot> {
        self.motions.iter().map(|m| self.motion_slot(Place::Force, format!("state:{}", m.state), m)).collect()
    }

    /// The input by which a damping force is controlled, as the voltage of a magnetorheological damper: the coefficient of the velocity
    /// holds it, and it is itself no motion.
    fn control(&self, force: &Expr, v: &Expr) -> Option<Expr> {
        let Expr::Symbol(v) = v else { return None };
        let damping: Vec<Expr> = force.terms().into_iter().filter_map(|(_, term)| coefficient(term, v)).collect();
        let controls =
            |input: &str| self.kinematic_input(input) == Kinematic::Neither && damping.iter().any(|c| c.uses(input));
        let input = self.simulation.inputs.iter().find(|i| controls(&i.symbol))?;
        Some(Expr::symbol(&input.symbol))
    }

    pub(super) fn force_laws(&self) -> Vec<Slot> {
        if !self.is_force_law() {
            return Vec::new();
        }
        let of_kind = |kind: Kinematic| {
            let inputs = self.simulation.inputs.iter();
            inputs.map(|i| i.symbol.as_str()).filter(|s| self.kinematic_input(s) == kind).collect::<Vec<_>>()
        };
        let (displacements, velocities) = (of_kind(Kinematic::Displacement), of_kind(Kinematic::Velocity));
        let mut slots = Vec::new();
        for output in &self.simulation.outputs {
            for i in 0..displacements.len().max(velocities.len()) {
                let x = displacements.get(i).copied();
                let v = match (velocities.get(i), x) {
                    (Some(v), _) => Expr::symbol(*v),
                    (None, Some(x)) => Expr::symbol(x).derivative_of_input(),
                    (None, None) => continue,
                };
                let mut slot = self.force_law(output, x, v.clone());
                if let Some(control) = self.control(&output.expression, &v) {
                    slot.offer(self.simulation, "control", control);
                }
                slots.push(slot);
            }
        }
        slots
    }

    /// The windings whose current is measured: the output, and the flux linkage on which it depends.
    fn windings(&self) -> Vec<(&Output, &State)> {
        let flux =
            |s: &&State| has_unit(self.simulation.unit_of(&s.name), &["Wb"]) && self.original.state(&s.name).is_some();
        let fluxes: Vec<&State> = self.simulation.states.iter().filter(flux).collect();
        let currents = self.simulation.outputs.iter();
        let currents = currents.filter(|o| has_unit(self.unit_of_output(&o.column, &o.expression), &["A"]));
        currents.flat_map(|o| fluxes.iter().filter(|s| o.expression.uses(&s.name)).map(move |s| (o, *s))).collect()
    }

    /// The laws by which windings draw current: over the flux linkage as a force over a displacement, whose velocity is the voltage. Where that drops
    /// over a resistance by the current, it drops by the law's current too.
    pub(super) fn core_laws(&self) -> Vec<Slot> {
        let law = |(o, s): (&Output, &State)| Slot {
            feeds_back: self.feeds_back(o, s),
            ..self.force_law(o, Some(&s.name), s.derivative.clone())
        };
        self.windings().into_iter().map(law).collect()
    }

    /// Whether a law of a measured current acts on this state too.
    pub(super) fn feels_its_current(&self, state: &str) -> bool {
        self.windings().into_iter().any(|(o, s)| s.name == state && self.feeds_back(o, s).is_some())
    }

    /// How a state feels an output, where both hold it in proportion.
    fn feeds_back(&self, output: &Output, state: &State) -> Option<Pull> {
        let coefficient = |e: &Expr| linear_coefficient(self.simulation, e, &state.name);
        let times = quotient(coefficient(&state.derivative)?, coefficient(&output.expression)?);
        Some(Pull { lever: Some(times), ..Pull::new(&state.name, -1.0) })
    }

    /// The slot of a law that gives an output over a displacement and its velocity.
    fn force_law(&self, output: &Output, x: Option<&str>, v: Expr) -> Slot {
        let simulation = self.simulation;
        let mut slot = Slot::new(
            Place::ForceLaw,
            format!("output:{}", output.column),
            format!("in {}", output.column),
            Target::Output(output.column.clone()),
        );
        slot.loops = self.loops(&v);
        let c = linear_coefficient(simulation, &output.expression.replace(&v, &Expr::symbol("?v")), "?v");
        let k = x.and_then(|x| linear_coefficient(simulation, &output.expression, x));
        // A damper tells the direction; a spring may be soft.
        slot.pulls = c.as_ref().or(k.as_ref()).is_some_and(is_negative);
        let recorded = matches!(v, Expr::Symbol(_));
        for (symbol, own) in [("c", c.filter(|_| recorded)), ("k", k)] {
            if let Some(own) = own {
                slot.offer(simulation, symbol, if slot.pulls { (-own).simplified() } else { own });
            }
        }
        slot.offer(simulation, "v", v);
        if let Some(x) = x {
            slot.offer(simulation, "x", Expr::symbol(x));
            if let Some(rad) = simulation.unit_of(x).as_ref().and_then(angle) {
                slot.offer(simulation, "rad", rad);
            }
        }
        slot.offer(simulation, "F", output.expression.clone());
        self.name_unit(&mut slot, "F", &output.column);
        slot.context = self.equations();
        slot.offer_own_sign(simulation);
        slot.constant = has_free_constant(simulation, &output.expression);
        slot
    }
}

#[cfg(test)]
mod tests {
    use hysid_plant::Simulation;

    use super::super::Structure;
    use super::super::connections::tests::slots;
    use super::*;
    use crate::mechanism::Purpose;
    use crate::mechanism::conformance::example_signals;

    #[test]
    fn a_displacement_may_be_a_multiple_of_what_its_velocity_sums_up_to() {
        let check = |rate: &str, unit: &str, v: &str| {
            let found = slots(Place::Force, &[("x", rate, unit), ("w2", "(u - c*w2 - k*x)/J", "rad/s")]);
            assert_eq!(found[0][..3], [if v == "w2" { "" } else { "x" }, v, if v == "w2" { "" } else { "k" }]);
        };
        check("1000*w2", "mm", "1000*w2");
        check("w2/J", "m", "1/J*w2");
        check("w2*180/pi", "deg", "180/pi*w2");
        // A store that a flow fills, and what depends on more than a velocity, are no displacements.
        check("0.01*w2", "K", "w2");
        check("1000*(w2 - k*x)", "mm", "w2");
    }

    #[test]
    fn what_acts_behind_a_chain_of_integrators_depends_on_the_motion_at_its_end() {
        let chain = [("y", "w1", "mm"), ("w1", "w2", "mm/s"), ("w2", "k*(u - w1) - J*y - c*w2", "mm/s^2")];
        let found = slots(Place::Force, &chain);
        assert_eq!(found.len(), 1);
        assert_eq!(found[0][..2], ["y", "w1"]);
    }

    #[test]
    fn what_flows_behind_a_pump_is_no_force() {
        let places = |column: &str, unit: &str| {
            let text = format!(
                "[time]\nperiod_s = 0.05\n[inputs]\nn = \"speed_rpm\"\n[parameters]\na = {{ value = 1.5, min = 0.1 }}\n[states]\n\
                 q = {{ derivative = \"(n/1000)^2 - a*q*abs(q)\", initial = 0.0, unit = \"{unit}\" }}\n[outputs]\n{column} = \"q\"\n"
            );
            let slots = Structure::of(&Simulation::parse(&text, "line.sim.toml").unwrap()).slots;
            [Place::Input, Place::Prescribed, Place::ForceLaw].map(|place| slots.iter().any(|s| s.place == place))
        };
        assert_eq!(places("flow_l_min", "l/min"), [true, false, false]);
        assert_eq!(places("torque_Nm", "N m"), [false, true, true]);
    }

    #[test]
    fn what_a_volume_holds_is_no_force() {
        let places = |unit: &str, column: &str| {
            let text = format!(
                "[time]\nperiod_s = 0.05\n[inputs]\nq = \"pump_L_min\"\nz = \"valve_open\"\n[parameters]\na = {{ value = 1.5, min = 0.1 }}\n[states]\n\
                 P = {{ derivative = \"q/60 - a*z*P\", initial = 0.0, unit = \"{unit}\" }}\n[outputs]\n{column} = \"P\"\n"
            );
            let slots = Structure::of(&Simulation::parse(&text, "line.sim.toml").unwrap()).slots;
            [Place::Store, Place::ForceLaw].map(|place| slots.iter().any(|s| s.place == place))
        };
        assert_eq!(places("bar", "p_bar"), [true, false]);
        assert_eq!(places("N", "pull_N"), [false, true]);
    }

    #[test]
    fn what_presses_a_flow_through_resists_it_as_a_damper_a_velocity() {
        let law = |column: &str| {
            let text = format!(
                "[time]\nperiod_s = 0.05\n[inputs]\nq = \"flow_L_min\"\n[parameters]\na = {{ value = 1.5, min = 0.1 }}\n[outputs]\n{column} = \"-a*q\"\n"
            );
            let slots = Structure::of(&Simulation::parse(&text, "filter.sim.toml").unwrap()).slots;
            let law = slots.into_iter().find(|s| s.place == Place::ForceLaw);
            law.and_then(|s| Some(s.quantity("v")?.expression.to_string()))
        };
        assert_eq!(law("drop_mbar").as_deref(), Some("q"));
        assert_eq!(law("through_L_min"), None);
    }

    #[test]
    fn what_resists_a_pull_is_taken_from_it() {
        let check = |force: &str, k: &str, friction: &str| {
            let text = format!(
                "[time]\nperiod_s = 0.01\n[inputs]\nx = \"stroke_mm\"\np = \"pressure_bar\"\n[parameters]\na = {{ value = 180.0, min = 1.0 }}\n\
                 k = {{ value = 3.0, min = 0.1 }}\n[outputs]\nforce_N = \"{force}\"\n"
            );
            let simulation = Simulation::parse(&text, "muscle.sim.toml").unwrap();
            let slots = Structure::of(&simulation).slots;
            let slot = slots.iter().find(|s| s.place == Place::ForceLaw).unwrap();
            assert_eq!(slot.quantity("k").unwrap().expression.to_string(), k);
            let law = crate::mechanism::mechanism("coulomb_friction").unwrap();
            let written = law.rewrite(&simulation, slot, &example_signals(&simulation, slot), Purpose::Refit).unwrap();
            let own = written.simulation.outputs[0].expression.to_string();
            assert!(own.starts_with(&format!("{force}{friction}")), "{own}");
        };
        check("a*p - k*x", "k", " - F_c*sign");
        check("a*p + k*x", "k", " + F_c*sign");
        check("a*p - (k + 2)*x", "k + 2", " - F_c*sign");
        // A damper tells the direction, a spring may be soft.
        check("a*d(x) - k*x", "-k", " + F_c*sign");
        check("a*p + k*x - a*d(x)", "-k", " - F_c*sign");
    }

    /// The slots of a core's current, measured in this column as this, and its simulation.
    fn core(unit: &str, column: &str, current: &str) -> (Simulation, Vec<Slot>) {
        let text = format!(
            "[time]\nperiod_s = 1e-4\n[inputs]\ne = \"primary_V\"\n[parameters]\nR = {{ value = 2.0, min = 0.1, unit = \"ohm\" }}\nL = {{ value = 0.5, min = 0.1, unit = \"H\" }}\n\
             [states]\nlam = {{ derivative = \"e - R*lam/L\", initial = 0.0, unit = \"{unit}\" }}\n[outputs]\n{column} = \"{current}\"\n"
        );
        let simulation = Simulation::parse(&text, "core.sim.toml").unwrap();
        let slots = Structure::of(&simulation).slots.into_iter().filter(|s| s.place == Place::ForceLaw).collect();
        (simulation, slots)
    }

    #[test]
    fn what_a_core_draws_drops_over_the_resistance() {
        let times = |column: &str, current: &str| {
            let (_, slots) = core("Wb", column, current);
            slots[0].feeds_back.as_ref().and_then(|pull| Some(pull.lever.as_ref()?.to_string()))
        };
        assert_eq!(times("primary_A", "lam/L").as_deref(), Some("-R"));
        assert_eq!(times("primary_mA", "1000*lam/L").as_deref(), Some("-(R/1000)"));
        let (simulation, slots) = core("Wb", "primary_A", "lam/L");
        let law = crate::mechanism::mechanism("dahl_friction").unwrap();
        let signals = example_signals(&simulation, &slots[0]);
        let written = law.rewrite(&simulation, &slots[0], &signals, Purpose::Refit).unwrap();
        // The loop follows the voltage that is left, which is the flux's own rate.
        let own = &written.simulation.state("lam").unwrap().derivative;
        let added = written.simulation.state(&written.states[0]).unwrap();
        assert!(own.uses(&added.name) && own.uses("R"), "{own}");
        let held = |e: &Expr| {
            let mut found = false;
            e.visit(&mut |part| found |= part == own);
            found
        };
        assert!(held(&added.derivative), "{} beside {own}", added.derivative);
        // The law stands at the measured current and at no other place of the circuit.
        assert!(!Structure::of(&simulation).slots.iter().any(|s| s.place == Place::Circuit));
        // Measured the other way round the law is taken from the current, and the flux feels it the same.
        let (simulation, slots) = core("Wb", "primary_A", "-lam/L");
        let friction = crate::mechanism::mechanism("coulomb_friction").unwrap();
        let signals = example_signals(&simulation, &slots[0]);
        let written = friction.rewrite(&simulation, &slots[0], &signals, Purpose::Refit).unwrap().simulation;
        let (own, felt) = (written.outputs[0].expression.to_string(), written.states[0].derivative.to_string());
        assert!(own.contains(" - F_c*") && felt.contains(" - R*(F_c*"), "{own}; {felt}");
    }

    #[test]
    fn a_core_draws_its_current_over_the_flux_as_a_spring_its_force_over_the_displacement() {
        let of = |unit: &str, column: &str| {
            let laws = core(unit, column, "lam/L").1.into_iter();
            laws.map(|s| ["x", "v", "k"].map(|q| s.quantity(q).unwrap().expression.to_string())).collect::<Vec<_>>()
        };
        assert_eq!(of("Wb", "primary_A"), [["lam", "e - R*lam/L", "1/L"].map(str::to_owned)]);
        assert_eq!(of("V s", "primary_mA").len(), 1);
    }
}
