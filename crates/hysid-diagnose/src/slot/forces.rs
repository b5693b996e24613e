//! The slots at which forces stand: on a moving part, between two of them, at the output of a static force law.

use hysid_plant::{BinaryOp, Expr, State};

use super::algebra::{coefficient, has_free_constant, linear_coefficient, only_parameters, size};
use super::find::Finder;
use super::motion::{ForcePath, Kinematic, Motion, angle, force_path};
use super::{Place, Slot, Target};

impl Finder<'_> {
    /// Offers what every force slot has: the size of the forces, the mass, the linear stiffness and damping.
    pub(super) fn offer_force(&self, slot: &mut Slot, derivative: &Expr, x: Option<&str>, v: &str) {
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
        let quotient = matches!(force_path(simulation, derivative), ForcePath::Divided(_));
        let scaled = |e: Expr| match mass {
            Some(mass) if quotient => (mass.clone() * e).simplified(),
            _ => e,
        };
        if let Some(k) = x.and_then(|x| below(x, force)) {
            slot.offer(simulation, "k", scaled(k));
        }
        if let Some(c) = below(v, force) {
            slot.offer(simulation, "c", scaled(c));
        }
        if let Some(mass) = mass.filter(|m| only_parameters(simulation, m)) {
            slot.offer(simulation, "m", mass.clone());
        }
        if let Some(input) = simulation.inputs.iter().find(|i| force.uses(&i.symbol)) {
            slot.offer(simulation, "u", Expr::symbol(&input.symbol));
        }
        slot.constant = has_free_constant(simulation, force);
    }

    pub(super) fn motion_slot(&self, place: Place, label: String, motion: &Motion<'_>) -> Slot {
        let target = Target::Derivatives(vec![(motion.v.to_owned(), 1.0)]);
        let mut slot = Slot::new(place, label, format!("at {}", motion.name()), target);
        let v = Expr::symbol(motion.v);
        slot.loops = self.loops(&v);
        if let Some(control) = self.control(motion.derivative, &v) {
            slot.offer(self.simulation, "control", control);
        }
        slot.offer(self.simulation, "v", v);
        if let Some(x) = motion.x {
            slot.offer(self.simulation, "x", Expr::symbol(x));
            if let Some(rad) = self.simulation.unit_of(x).as_ref().and_then(angle) {
                slot.offer(self.simulation, "rad", rad);
            }
        }
        self.offer_force(&mut slot, motion.derivative, motion.x, motion.v);
        slot.context = vec![motion.derivative.clone()];
        slot
    }

    pub(super) fn forces(&self) -> Vec<Slot> {
        self.motions.iter().map(|m| self.motion_slot(Place::Force, format!("state:{}", m.v), m)).collect()
    }

    pub(super) fn connections(&self) -> Vec<Slot> {
        let mut slots = Vec::new();
        for (i, one) in self.motions.iter().enumerate() {
            for other in &self.motions[i + 1..] {
                let (Some(x1), Some(x2)) = (one.x, other.x) else { continue };
                let units = (self.simulation.unit_of(x1), self.simulation.unit_of(x2));
                let alike = match &units {
                    (Some(a), Some(b)) => a.same_dimension(b),
                    _ => true,
                };
                if alike && one.derivative.uses(x2) && other.derivative.uses(x1) {
                    let x = Expr::symbol(x1) - Expr::symbol(x2);
                    slots.push(self.connection(one, other, x, (x2, 1.0), format!("between {x1} and {x2}")));
                }
            }
        }
        slots.extend(self.twists());
        slots
    }

    /// Connections whose deflection is a state of its own, the velocity of one part less that of another: a shaft's twist.
    fn twists(&self) -> Vec<Slot> {
        let motion = |e: &Expr| self.motions.iter().find(|m| matches!(e, Expr::Symbol(s) if s == m.v));
        let twist = |state: &State| {
            let Expr::Binary(BinaryOp::Sub, a, b) = &state.derivative else { return None };
            let (one, other) = (motion(a)?, motion(b)?);
            let name = state.name.as_str();
            let pulls = one.derivative.uses(name) && other.derivative.uses(name);
            pulls.then(|| self.connection(one, other, Expr::symbol(name), (name, -1.0), format!("across {name}")))
        };
        let known = self.simulation.states.iter().filter(|s| self.original.state(&s.name).is_some());
        known.filter_map(twist).collect()
    }

    /// The force between two parts, over the deflection `x` of what connects them. It pulls at the first by the spring rate times the sign beside a
    /// symbol that it is linear in.
    fn connection(
        &self,
        one: &Motion<'_>,
        other: &Motion<'_>,
        x: Expr,
        (symbol, sign): (&str, f64),
        words: String,
    ) -> Slot {
        let target = Target::Derivatives(vec![(one.v.to_owned(), 1.0), (other.v.to_owned(), -1.0)]);
        let mut slot = Slot::new(Place::Connection, format!("state:{}", one.v), words, target);
        let v = Expr::symbol(one.v) - Expr::symbol(other.v);
        slot.loops = self.loops(&v);
        slot.offer(self.simulation, "x", x);
        slot.offer(self.simulation, "v", v);
        let (force, divided) = match force_path(self.simulation, one.derivative) {
            ForcePath::Quotient(force, _) => (force, None),
            ForcePath::Divided(mass) => (one.derivative, Some(mass)),
            ForcePath::Bare => (one.derivative, None),
        };
        let whole = |e: Expr| match divided {
            Some(mass) => (mass.clone() * e).simplified(),
            None => e,
        };
        let coupling = force.terms().into_iter().filter(|(_, t)| t.uses(symbol) || t.uses(other.v));
        if let Some(size) = coupling.map(|(_, t)| t.clone().abs()).reduce(|a, b| a + b) {
            slot.offer(self.simulation, "F", whole(size));
        }
        if let Some(k) = linear_coefficient(self.simulation, force, symbol) {
            slot.offer(self.simulation, "k", whole(if sign < 0.0 { (-k).simplified() } else { k }));
        }
        if let Some(c) = linear_coefficient(self.simulation, force, other.v) {
            slot.offer(self.simulation, "c", whole(c));
        }
        slot.context = vec![one.derivative.clone()];
        slot
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
                let mut slot = Slot::new(
                    Place::ForceLaw,
                    format!("output:{}", output.column),
                    format!("in {}", output.column),
                    Target::Output(output.column.clone()),
                );
                slot.loops = self.loops(&v);
                if let Some(control) = self.control(&output.expression, &v) {
                    slot.offer(self.simulation, "control", control);
                }
                if let Some(v) = velocities.get(i)
                    && let Some(c) = linear_coefficient(self.simulation, &output.expression, v)
                {
                    slot.offer(self.simulation, "c", c);
                }
                slot.offer(self.simulation, "v", v);
                if let Some(x) = x {
                    slot.offer(self.simulation, "x", Expr::symbol(x));
                    if let Some(k) = linear_coefficient(self.simulation, &output.expression, x) {
                        slot.offer(self.simulation, "k", k);
                    }
                    if let Some(rad) = self.simulation.unit_of(x).as_ref().and_then(angle) {
                        slot.offer(self.simulation, "rad", rad);
                    }
                }
                slot.offer(self.simulation, "F", output.expression.clone());
                self.name_unit(&mut slot, "F", &output.column);
                slot.context = self.equations();
                slot.constant = has_free_constant(self.simulation, &output.expression);
                slots.push(slot);
            }
        }
        slots
    }
}
