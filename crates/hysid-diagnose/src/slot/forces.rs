//! The slots at which forces stand: on a moving part.

use hysid_plant::{Expr, State};

use super::algebra::{coefficient, has_free_constant, linear_coefficient, only_parameters, product, quotient, size};
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
        self.sum_of_forces(motion, &|term| passed(term) == from_others)
    }

    /// The force on a part by the terms of which this is true; `None` where there is none.
    pub(super) fn sum_of_forces(&self, motion: &Motion<'_>, counts: &dyn Fn(&Expr) -> bool) -> Option<Expr> {
        let terms = forces_of(self.simulation, motion).filter(|(_, term)| counts(term));
        let sum = terms.map(|(sign, term)| product(vec![Expr::Number(sign), term.clone()])).reduce(|a, b| a + b)?;
        let load = match force_path(self.simulation, motion.derivative) {
            ForcePath::Divided(mass) => mass.clone() * sum,
            ForcePath::Quotient(..) | ForcePath::Bare => sum,
        };
        Some(load.simplified())
    }

    /// The inputs that press, by their unit or for all that is known, and that move nothing in the simulation as the user wrote it, as they are offered.
    pub(super) fn idle_loads(&self) -> Vec<String> {
        // What a sensor shows of an input loads nothing: of a static relation the outputs are the equations.
        let moving: Vec<&Expr> = match self.original.is_static() {
            true => self.original.expressions().into_iter().map(|(_, e)| e).collect(),
            false => self.original.states.iter().map(|s| &s.derivative).collect(),
        };
        let idle = |symbol: &str| {
            !moving.iter().any(|e| e.uses(symbol))
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
        if let Some(rad) = motion.x.and_then(|x| self.radians(motion, x)) {
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

    /// What a coordinate is in radians for each unit of it, where it is an angle: by its unit, and where that is none by what an output shows of it
    /// (`180/pi*q` in degrees) or by a moment of inertia.
    fn radians(&self, motion: &Motion<'_>, x: &str) -> Option<Expr> {
        let simulation = self.simulation;
        let unit = simulation.unit_of(x);
        if let Some(rad) = unit.as_ref().and_then(angle) {
            return Some(rad);
        }
        if unit.is_some_and(|u| !u.is_none()) {
            return None;
        }
        let number = |e: &Expr| e.symbols().iter().all(|s| s == "pi");
        let shown = simulation.outputs.iter().find_map(|o| {
            let rad = self.unit_of_output(&o.column, &o.expression).as_ref().and_then(angle)?;
            let times = linear_coefficient(simulation, &o.expression, x).filter(number)?;
            Some(quotient(rad * times, Expr::Number(1.0)))
        });
        let mass = force_path(simulation, motion.derivative).mass().and_then(|mass| simulation.unit_of_expr(mass));
        shown.or_else(|| has_unit(mass, &["kg m^2"]).then_some(Expr::Number(1.0)))
    }

    pub(super) fn forces(&self) -> Vec<Slot> {
        self.motions.iter().map(|m| self.motion_slot(Place::Force, format!("state:{}", m.state), m)).collect()
    }

    /// The input by which a damping force is controlled, as the voltage of a magnetorheological damper: the coefficient of the velocity
    /// holds it, and it is itself neither a motion nor what presses, as a clamping force: that is a load.
    pub(super) fn control(&self, force: &Expr, v: &Expr) -> Option<Expr> {
        let Expr::Symbol(v) = v else { return None };
        let damping: Vec<Expr> = force.terms().into_iter().filter_map(|(_, term)| coefficient(term, v)).collect();
        let controls = |input: &str| {
            self.kinematic_input(input) == Kinematic::Neither
                && !self.simulation.unit_of(input).is_some_and(|u| presses(&u))
                && damping.iter().any(|c| c.uses(input))
        };
        let input = self.simulation.inputs.iter().find(|i| controls(&i.symbol))?;
        Some(Expr::symbol(&input.symbol))
    }
}

#[cfg(test)]
mod tests {
    use hysid_plant::Simulation;

    use super::super::Structure;
    use super::super::connections::tests::slots;
    use super::*;

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
    fn an_angle_without_a_unit_is_told_by_its_output_or_its_inertia() {
        let radians = |unit: &str, inertia: &str, output: &str| {
            let text = format!(
                "[time]\nperiod_s = 0.01\n[inputs]\nu = \"drive\"\n[parameters]\nJ = {{ value = 2.0, min = 0.1{inertia} }}\nk = {{ value = 9.0, min = 0.1 }}\n\
                 [states]\nbe = {{ derivative = \"w\", initial = 0.0{unit} }}\nw = {{ derivative = \"(u - k*be)/J\", initial = 0.0 }}\n[outputs]\n{output}\n"
            );
            let slots = Structure::of(&Simulation::parse(&text, "boom.sim.toml").unwrap()).slots;
            let force = slots.into_iter().find(|s| s.place == Place::Force).unwrap();
            force.quantity("rad").map(|q| q.expression.to_string())
        };
        let (none, metres, turning) = (", unit = \"-\"", ", unit = \"m\"", ", unit = \"kg m^2\"");
        assert_eq!(radians(none, "", "boom_deg = \"be*180/pi\"").as_deref(), Some("1"));
        assert_eq!(radians("", "", "boom_deg = \"be\"").as_deref(), Some("pi/180"));
        assert_eq!(radians(none, turning, "gauge_V = \"3*be\"").as_deref(), Some("1"));
        assert_eq!(radians(none, "", "gauge_V = \"3*be\""), None);
        assert_eq!(radians(metres, turning, "boom_deg = \"be*180/pi\""), None);
        assert_eq!(radians(", unit = \"deg\"", "", "gauge_V = \"3*be\"").as_deref(), Some("pi/180"));
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

    /// Of friction that grows with a load the catalogue has another law.
    #[test]
    fn what_presses_is_a_load_and_no_control() {
        let guide = |column: &str| {
            let text = format!(
                "[time]\nperiod_s = 0.01\n[inputs]\nf = \"drive_N\"\nq = \"{column}\"\n[parameters]\nc = {{ value = 2.0, min = 0.1 }}\n[states]\n\
                 x = {{ derivative = \"v\", initial = 0.0 }}\nv = {{ derivative = \"f - (c + 0.1*q)*v\", initial = 0.0 }}\n[outputs]\nx_m = \"x\"\n"
            );
            let simulation = Simulation::parse(&text, "guide.sim.toml").unwrap();
            Structure::of(&simulation).slots.iter().any(|s| s.has("control"))
        };
        assert!(guide("coil_V") && !guide("clamp_N"));
        // What moves nothing may load the guide, also where a sensor shows a share of it.
        let loads = |derivative: &str, output: &str| {
            let text = format!(
                "[time]\nperiod_s = 0.01\n[inputs]\nf = \"drive_N\"\nq = \"clamp_N\"\n[parameters]\nc = {{ value = 2.0, min = 0.1 }}\n[states]\n\
                 x = {{ derivative = \"v\", initial = 0.0 }}\nv = {{ derivative = \"{derivative}\", initial = 0.0 }}\n[outputs]\ncell_N = \"{output}\"\n"
            );
            let simulation = Simulation::parse(&text, "guide.sim.toml").unwrap();
            Structure::of(&simulation).slots.iter().find(|s| s.label == "state:v").unwrap().loads()
        };
        assert_eq!(loads("f - c*v", "90*x"), ["u_2", "u_1"]);
        assert_eq!(loads("f - c*v", "90*x + 0.02*q"), ["u_2", "u_1"]);
        assert_eq!(loads("f - q - c*v", "90*x"), ["u_1", "u_2"]);
    }
}
