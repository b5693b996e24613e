//! The slots of laws that give an output over a motion: a force over what is prescribed, a winding's current over its flux linkage.

use hysid_plant::{BinaryOp, Expr, Memory, Output, State};

use super::algebra::{constant_coefficient, has_free_constant, is_negative, linear_coefficient, quotient};
use super::find::{Finder, has_unit};
use super::motion::{Kinematic, angle};
use super::{Place, Pull, Slot, Target};

impl Finder<'_> {
    /// The laws of forces over the motion that inputs prescribe.
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
            let force = &output.expression;
            let motions = match between(force, &displacements, &velocities) {
                Some(motion) => vec![motion],
                None => (0..displacements.len().max(velocities.len()))
                    .filter_map(|i| {
                        let x = displacements.get(i).map(|x| Expr::symbol(*x));
                        let v = velocities.get(i).map(|v| Expr::symbol(*v));
                        let v = v.or_else(|| Some(x.clone()?.derivative_of_input()))?;
                        Some((x, v))
                    })
                    .collect(),
            };
            for (x, v) in motions {
                let mut slot = self.force_law(output, x, v.clone());
                if let Some(control) = self.control(force, &v) {
                    slot.offer(self.simulation, "control", control);
                }
                slots.push(slot);
            }
        }
        slots
    }

    /// The outputs of a static relation that follow along a curve an input which is no motion. What follows a straight line may as well be behind what
    /// stands at the input.
    pub(super) fn curves(&self) -> Vec<Slot> {
        let simulation = self.simulation;
        if !simulation.is_static() {
            return Vec::new();
        }
        let is_bent = |output: &Output, symbol: &str| {
            let mut terms = output.expression.terms().into_iter().filter(|(_, term)| term.uses(symbol));
            terms.any(|(_, term)| constant_coefficient(simulation, term, symbol).is_none())
        };
        let mut slots = Vec::new();
        for output in &simulation.outputs {
            let inputs = simulation.inputs.iter().map(|i| i.symbol.as_str());
            for symbol in inputs.filter(|s| self.kinematic_input(s) == Kinematic::Neither && is_bent(output, s)) {
                let mut slot = Slot::new(
                    Place::Curve,
                    format!("output:{}", output.column),
                    format!("in {} over {symbol}", output.column),
                    Target::Output(output.column.clone()),
                );
                slot.offer(simulation, "u", Expr::symbol(symbol));
                slot.offer(simulation, "y", output.expression.clone());
                self.name_unit(&mut slot, "y", &output.column);
                slot.context = vec![output.expression.clone()];
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
            ..self.force_law(o, Some(Expr::symbol(&s.name)), s.derivative.clone())
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
    fn force_law(&self, output: &Output, x: Option<Expr>, v: Expr) -> Slot {
        let simulation = self.simulation;
        let mut slot = Slot::new(
            Place::ForceLaw,
            format!("output:{}", output.column),
            format!("in {}", output.column),
            Target::Output(output.column.clone()),
        );
        slot.loops = self.loops(&v);
        let times =
            |part: &Expr| linear_coefficient(simulation, &output.expression.replace(part, &Expr::symbol("?")), "?");
        let (c, k) = (times(&v), x.as_ref().and_then(times));
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
            if let Some(rad) = simulation.unit_of_expr(&x).as_ref().and_then(angle) {
                slot.offer(simulation, "rad", rad);
            }
            slot.offer(simulation, "x", x);
        }
        slot.offer(simulation, "F", output.expression.clone());
        self.name_unit(&mut slot, "F", &output.column);
        slot.context = self.equations();
        slot.offer_own_sign(simulation);
        slot.constant = has_free_constant(simulation, &output.expression);
        slot
    }
}

/// The displacement (where it is recorded) and the velocity between two ends whose motion is prescribed, where the force depends on nothing else of it.
fn between(force: &Expr, displacements: &[&str], velocities: &[&str]) -> Option<(Option<Expr>, Expr)> {
    let find = |end: &dyn Fn(&Expr) -> bool| {
        let mut found = None;
        force.visit(&mut |e| match e {
            Expr::Binary(BinaryOp::Sub, a, b) if end(a) && end(b) => found = Some(e.clone()),
            _ => {}
        });
        found
    };
    let one_of = |e: &Expr, symbols: &[&str]| matches!(e, Expr::Symbol(s) if symbols.contains(&s.as_str()));
    let is_rate =
        |e: &Expr| matches!(e, Expr::Memory(Memory::Derivative, of) if of.iter().all(|x| one_of(x, displacements)));
    let x = find(&|e| one_of(e, displacements));
    let v = find(&|e| one_of(e, velocities)).or_else(|| find(&is_rate));
    let v = v.or_else(|| Some(x.clone()?.derivative_of_input()))?;
    let other = Expr::Number(0.0);
    let rest = force.replace(&v, &other);
    let rest = x.iter().fold(rest, |rest, x| rest.replace(x, &other));
    (!displacements.iter().chain(velocities).any(|s| rest.uses(s))).then_some((x, v))
}

#[cfg(test)]
mod tests {
    use hysid_plant::Simulation;

    use super::super::Structure;
    use super::*;
    use crate::mechanism::Purpose;
    use crate::mechanism::conformance::example_signals;

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
    fn what_strains_a_specimen_is_a_displacement() {
        let over = |input: &str, output: &str, law: &str| {
            let text = format!(
                "[time]\nperiod_s = 0.1\n[inputs]\nel = \"{input}\"\n[parameters]\nk = {{ value = 6.0, min = 0.1 }}\nc = {{ value = 0.7, min = 0.1 }}\n[outputs]\n{output} = \"{law}\"\n"
            );
            let slots = Structure::of(&Simulation::parse(&text, "wire.sim.toml").unwrap()).slots;
            let law = slots.into_iter().find(|s| s.place == Place::ForceLaw);
            law.map(|s| ["x", "v"].map(|n| s.quantity(n).map(|q| q.expression.to_string())))
        };
        let motion = Some(["el", "d(el)"].map(|text| Some(text.to_owned())));
        for input in ["strain_pct", "strain_percent"] {
            assert_eq!(over(input, "pull_N", "k*el + c*d(el)"), motion, "{input}");
        }
        assert_eq!(over("strain_pct", "stress_MPa", "k*el + c*d(el)"), motion);
        // Without a rate it may be the opening of a valve; nor does it strain what is no force, and what is measured in volts strains nothing.
        assert_eq!(over("opening_pct", "pull_N", "k*el + c"), None);
        assert_eq!(over("strain_pct", "drop_V", "k*el + c*d(el)"), None);
        assert_eq!(over("drive_V", "pull_N", "k*el + c*d(el)"), None);
    }

    #[test]
    fn what_bends_an_output_over_an_input_is_a_curve() {
        let curves = |input: &str, output: &str| {
            let text = format!(
                "[time]\nperiod_s = 0.05\n[inputs]\nh = \"{input}\"\nw = \"bias_V\"\n[parameters]\na = {{ value = 1.5, min = 0.1 }}\n[outputs]\nflux_T = \"{output}\"\n"
            );
            let slots = Structure::of(&Simulation::parse(&text, "core.sim.toml").unwrap()).slots;
            let curves = slots.into_iter().filter(|s| s.place == Place::Curve);
            curves.map(|s| s.quantity("u").unwrap().expression.to_string()).collect::<Vec<_>>()
        };
        assert_eq!(curves("field_A_per_m", "a*h/(20 + abs(h)) + 2*h + w"), ["h"]);
        assert_eq!(curves("field_A_per_m", "a*h + w^2"), ["w"]);
        assert!(curves("field_A_per_m", "a*h/20 + w - 3").is_empty());
        // Over a displacement it is a force law.
        assert_eq!(curves("stroke_mm", "a*h^3 + tanh(w)"), ["w"]);
    }

    #[test]
    fn between_two_ends_that_are_moved_their_difference_counts() {
        let motion = |inputs: &str, force: &str| {
            let text = format!(
                "[time]\nperiod_s = 0.01\n[inputs]\n{inputs}[parameters]\nk = {{ value = 3.0, min = 0.1 }}\n[outputs]\nforce_N = \"{force}\"\n"
            );
            let slots = Structure::of(&Simulation::parse(&text, "mount.sim.toml").unwrap()).slots;
            let laws = slots.iter().filter(|s| s.place == Place::ForceLaw);
            let told = |s: &Slot, symbol: &str| s.quantity(symbol).map_or("-".to_owned(), |q| q.expression.to_string());
            laws.map(|s| format!("{} {} {}", told(s, "x"), told(s, "v"), s.pulls)).collect::<Vec<_>>()
        };
        let places = "a = \"top_mm\"\nb = \"bottom_mm\"\n";
        assert_eq!(motion(places, "-(k*(a - b) + 2*(d(a) - d(b)))"), ["a - b d(a) - d(b) true"]);
        assert_eq!(motion(places, "k*(b - a)"), ["b - a d(b - a) false"]);
        let speeds = "v = \"top_mm_s\"\nw = \"bottom_mm_s\"\n";
        assert_eq!(motion(speeds, "k*(v - w)"), ["- v - w false"]);
        // An end that counts by itself too.
        assert_eq!(motion(places, "k*(a - b) - 2*b"), ["a d(a) false", "b d(b) true"]);
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
