//! The slots of a simulation, found from its equations.

use hysid_plant::{BinaryOp, Expr, Function, Memory, Simulation, Unit};

use super::algebra::{has_free_constant, linear_coefficient, only_parameters, size};
use super::{Place, Slot, Target};

/// What a simulation is made of, as far as mechanisms care.
#[derive(Debug, Clone, PartialEq)]
pub struct Structure {
    /// Every place at which something can be missing.
    pub slots: Vec<Slot>,
}

/// How forces enter the derivative of a velocity.
pub(crate) enum ForcePath<'a> {
    /// `(force)/mass`.
    Quotient(&'a Expr, &'a Expr),
    /// A sum of terms that are all divided by the same mass.
    Divided(&'a Expr),
    /// No mass in sight: a force has the unit of the derivative.
    Bare,
}

/// The force path of a derivative.
pub(crate) fn force_path<'a>(simulation: &Simulation, derivative: &'a Expr) -> ForcePath<'a> {
    fn divisor(term: &Expr) -> Option<&Expr> {
        match term {
            Expr::Binary(BinaryOp::Div, _, below) => Some(below),
            Expr::Binary(BinaryOp::Mul, a, b) => divisor(a).or_else(|| divisor(b)),
            Expr::Neg(a) => divisor(a),
            _ => None,
        }
    }
    if let Expr::Binary(BinaryOp::Div, above, below) = derivative {
        return ForcePath::Quotient(above, below);
    }
    let mut divisors = derivative.terms().into_iter().map(|(_, term)| divisor(term));
    match divisors.next().flatten() {
        Some(mass) if only_parameters(simulation, mass) && divisors.all(|d| d == Some(mass)) => {
            ForcePath::Divided(mass)
        }
        _ => ForcePath::Bare,
    }
}

/// A moving part: a velocity, mostly with its displacement.
struct Motion<'a> {
    x: Option<&'a str>,
    v: &'a str,
    derivative: &'a Expr,
}

impl Motion<'_> {
    fn name(&self) -> &str {
        self.x.unwrap_or(self.v)
    }
}

/// What a quantity is by its unit, else by its name.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kinematic {
    Displacement,
    Velocity,
    Neither,
}

fn kinematic(unit: Option<&Unit>, name: &str) -> Kinematic {
    let Some(unit) = unit else {
        return match name.to_ascii_lowercase().as_str() {
            "x" | "q" | "z" | "disp" | "displacement" | "pos" | "position" | "theta" | "phi" | "alpha" | "angle" => {
                Kinematic::Displacement
            }
            "v" | "vel" | "velocity" | "speed" | "omega" | "xdot" | "dx" | "x_dot" => Kinematic::Velocity,
            _ => Kinematic::Neither,
        };
    };
    let like = |text: &str| Unit::parse(text).is_ok_and(|u| unit.same_dimension(&u));
    if like("m") || angle(unit).is_some() {
        Kinematic::Displacement
    } else if like("m/s") || matches!(unit.to_string().as_str(), "rad/s" | "deg/s" | "rev/s" | "rpm") {
        Kinematic::Velocity
    } else {
        Kinematic::Neither
    }
}

/// The factor that turns a unit of angle into radians.
fn angle(unit: &Unit) -> Option<Expr> {
    match unit.to_string().as_str() {
        "rad" => Some(Expr::Number(1.0)),
        "mrad" => Some(Expr::Number(1e-3)),
        "deg" => Some(Expr::symbol("pi") / 180.0),
        "rev" | "turn" => Some(Expr::symbol("pi") * 2.0),
        _ => None,
    }
}

impl Structure {
    /// The slots of a simulation as the user wrote it.
    pub fn of(simulation: &Simulation) -> Self {
        Self::within(simulation, simulation)
    }

    /// The slots of a simulation that effects have been written into: those of the `original`, with what stands there now.
    pub fn within(simulation: &Simulation, original: &Simulation) -> Self {
        let finder = Finder { simulation, original, motions: motions(simulation, original) };
        let mut slots = Vec::new();
        slots.extend(finder.inputs());
        slots.extend(finder.cascades());
        slots.extend(finder.forces());
        slots.extend(finder.connections());
        slots.extend(finder.force_laws());
        slots.extend(finder.stores());
        slots.extend(finder.sensors());
        slots.extend(finder.parameters());
        slots.extend(finder.disturbances());
        for slot in &mut slots {
            for (i, input) in (1..).zip(&simulation.inputs) {
                slot.offer(simulation, &format!("u_{i}"), Expr::symbol(&input.symbol));
                if i == 1 && !slot.has("u") {
                    slot.offer(simulation, "u", Expr::symbol(&input.symbol));
                }
            }
            slot.inputs = simulation.inputs.len();
        }
        Self { slots }
    }
}

fn motions<'a>(simulation: &'a Simulation, original: &Simulation) -> Vec<Motion<'a>> {
    let known = || simulation.states.iter().filter(|s| original.state(&s.name).is_some());
    let mut found = Vec::new();
    for velocity in known() {
        let position = known().find(|s| s.derivative == Expr::symbol(&velocity.name));
        // A chain x' = v, v' = a, a' = ...: v is then a displacement's velocity only, not one with a force.
        let passes_on = matches!(&velocity.derivative, Expr::Symbol(s) if original.state(s).is_some());
        let alone = kinematic(velocity.unit.as_ref(), &velocity.name) == Kinematic::Velocity;
        if !passes_on && (position.is_some() || alone) {
            found.push(Motion {
                x: position.map(|s| s.name.as_str()),
                v: &velocity.name,
                derivative: &velocity.derivative,
            });
        }
    }
    found
}

struct Finder<'a> {
    simulation: &'a Simulation,
    original: &'a Simulation,
    motions: Vec<Motion<'a>>,
}

impl Finder<'_> {
    fn unit_of_output(&self, column: &str, expression: &Expr) -> Option<Unit> {
        Unit::of_column(column).or_else(|| self.simulation.unit_of_expr(expression))
    }

    fn kinematic_input(&self, symbol: &str) -> Kinematic {
        kinematic(self.simulation.unit_of(symbol).as_ref(), symbol)
    }

    /// Whether the outputs are forces over the motion that the inputs prescribe.
    fn is_force_law(&self) -> bool {
        let prescribed = self.simulation.inputs.iter().any(|i| self.kinematic_input(&i.symbol) != Kinematic::Neither);
        let moves = |column: &str, e: &Expr| {
            self.unit_of_output(column, e).is_some_and(|u| kinematic(Some(&u), "") != Kinematic::Neither)
        };
        self.motions.is_empty()
            && prescribed
            && !self.simulation.outputs.iter().any(|o| moves(&o.column, &o.expression))
    }

    fn equations(&self) -> Vec<Expr> {
        self.simulation.expressions().into_iter().map(|(_, e)| e.clone()).collect()
    }

    /// Whether a state besides the motions has a loop in this velocity.
    fn loops(&self, v: &Expr) -> bool {
        let moving = |name: &str| self.motions.iter().any(|m| m.v == name || m.x == Some(name));
        let mut found = false;
        for state in self.simulation.states.iter().filter(|s| !moving(&s.name)) {
            state.derivative.visit(&mut |e| found |= matches!(e, Expr::Call(Function::Abs, a) if a.first() == Some(v)));
        }
        found
    }

    fn inputs(&self) -> Vec<Slot> {
        let differentiated = |symbol: &str| {
            let mut found = false;
            for e in self.equations() {
                e.visit(&mut |e| found |= matches!(e, Expr::Memory(Memory::Derivative, _)) && e.uses(symbol));
            }
            found
        };
        let law = self.is_force_law();
        let mut slots = Vec::new();
        for input in &self.simulation.inputs {
            let symbol = &input.symbol;
            let used = self.equations().iter().any(|e| e.uses(symbol));
            if !used || differentiated(symbol) || (law && self.kinematic_input(symbol) != Kinematic::Neither) {
                continue;
            }
            let mut slot = Slot::new(
                Place::Input,
                format!("input:{symbol}"),
                format!("at the input {symbol}"),
                Target::Symbol(symbol.clone()),
            );
            slot.offer(self.simulation, "u", Expr::symbol(symbol));
            slot.context = self.equations();
            let driven = self.motions.iter().find(|m| m.derivative.uses(symbol));
            if let Some(motion) = driven {
                slot.offer(self.simulation, "v", Expr::symbol(motion.v));
                if let Some(x) = motion.x {
                    slot.offer(self.simulation, "x", Expr::symbol(x));
                }
            }
            let into = self.simulation.states.iter().filter(|s| s.derivative.uses(symbol));
            slot.constant = into.into_iter().any(|s| match force_path(self.simulation, &s.derivative) {
                ForcePath::Quotient(force, _) => has_free_constant(self.simulation, force),
                _ => has_free_constant(self.simulation, &s.derivative),
            }) || self
                .simulation
                .outputs
                .iter()
                .any(|o| o.expression.uses(symbol) && has_free_constant(self.simulation, &o.expression));
            slots.push(slot);
        }
        slots
    }

    /// Whether the state `one` has any influence on the state `other`.
    fn reaches(&self, one: &str, other: &str) -> bool {
        let mut reached = vec![one];
        let mut next = 0;
        while let Some(from) = reached.get(next).copied() {
            for state in &self.simulation.states {
                if state.derivative.uses(from) && !reached.contains(&state.name.as_str()) {
                    reached.push(&state.name);
                }
            }
            next += 1;
        }
        reached.iter().skip(1).any(|s| *s == other)
    }

    fn cascades(&self) -> Vec<Slot> {
        let mut slots = Vec::new();
        let known = |name: &str| self.original.state(name).is_some();
        for source in self.simulation.states.iter().filter(|s| known(&s.name)) {
            let integrates = |name: &str| self.motions.iter().any(|m| m.v == source.name && m.x == Some(name));
            let driven: Vec<String> = self
                .simulation
                .states
                .iter()
                .filter(|s| known(&s.name) && s.name != source.name && s.derivative.uses(&source.name))
                .filter(|s| !integrates(&s.name) && !self.reaches(&s.name, &source.name))
                .map(|s| s.name.clone())
                .collect();
            let Some(first) = driven.first() else { continue };
            let mut slot = Slot::new(
                Place::Between,
                format!("state:{first}"),
                format!("where {} drives {first}", source.name),
                Target::SymbolIn(source.name.clone(), driven.clone()),
            );
            slot.offer(self.simulation, "u", Expr::symbol(&source.name));
            slot.context =
                driven.iter().filter_map(|d| self.simulation.state(d)).map(|s| s.derivative.clone()).collect();
            slots.push(slot);
        }
        slots
    }

    /// Offers what every force slot has: the size of the forces, the mass, the linear stiffness and damping.
    fn offer_force(&self, slot: &mut Slot, derivative: &Expr, x: Option<&str>, v: &str) {
        let simulation = self.simulation;
        let below = |symbol: &str, force: &Expr| Some((-linear_coefficient(simulation, force, symbol)?).simplified());
        let (force, mass) = match force_path(simulation, derivative) {
            ForcePath::Quotient(force, mass) => {
                slot.offer(simulation, "F", size(force));
                (force, Some(mass))
            }
            ForcePath::Divided(mass) => {
                slot.offer(simulation, "F", mass.clone() * size(derivative));
                (derivative, Some(mass))
            }
            ForcePath::Bare => {
                slot.offer(simulation, "F", size(derivative));
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

    fn motion_slot(&self, place: Place, label: String, motion: &Motion<'_>) -> Slot {
        let target = Target::Derivatives(vec![(motion.v.to_owned(), 1.0)]);
        let mut slot = Slot::new(place, label, format!("at {}", motion.name()), target);
        let v = Expr::symbol(motion.v);
        slot.loops = self.loops(&v);
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

    fn forces(&self) -> Vec<Slot> {
        self.motions.iter().map(|m| self.motion_slot(Place::Force, format!("state:{}", m.v), m)).collect()
    }

    fn connections(&self) -> Vec<Slot> {
        let mut slots = Vec::new();
        for (i, one) in self.motions.iter().enumerate() {
            for other in &self.motions[i + 1..] {
                let (Some(x1), Some(x2)) = (one.x, other.x) else { continue };
                let units = (self.simulation.unit_of(x1), self.simulation.unit_of(x2));
                let alike = match &units {
                    (Some(a), Some(b)) => a.same_dimension(b),
                    _ => true,
                };
                if !(alike && one.derivative.uses(x2) && other.derivative.uses(x1)) {
                    continue;
                }
                let target = Target::Derivatives(vec![(one.v.to_owned(), 1.0), (other.v.to_owned(), -1.0)]);
                let mut slot =
                    Slot::new(Place::Connection, format!("state:{}", one.v), format!("between {x1} and {x2}"), target);
                let v = Expr::symbol(one.v) - Expr::symbol(other.v);
                slot.loops = self.loops(&v);
                slot.offer(self.simulation, "x", Expr::symbol(x1) - Expr::symbol(x2));
                slot.offer(self.simulation, "v", v);
                let force = match force_path(self.simulation, one.derivative) {
                    ForcePath::Quotient(force, _) => force,
                    _ => one.derivative,
                };
                let divided = match force_path(self.simulation, one.derivative) {
                    ForcePath::Divided(mass) => Some(mass.clone()),
                    _ => None,
                };
                let whole = |e: Expr| match &divided {
                    Some(mass) => (mass.clone() * e).simplified(),
                    None => e,
                };
                let coupling = force.terms().into_iter().filter(|(_, t)| t.uses(x2) || t.uses(other.v));
                if let Some(size) = coupling.map(|(_, t)| t.clone().abs()).reduce(|a, b| a + b) {
                    slot.offer(self.simulation, "F", whole(size));
                }
                if let Some(k) = linear_coefficient(self.simulation, force, x2) {
                    slot.offer(self.simulation, "k", whole(k));
                }
                if let Some(c) = linear_coefficient(self.simulation, force, other.v) {
                    slot.offer(self.simulation, "c", whole(c));
                }
                slot.context = vec![one.derivative.clone()];
                slots.push(slot);
            }
        }
        slots
    }

    fn force_laws(&self) -> Vec<Slot> {
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
                if let Some(v) = velocities.get(i) {
                    if let Some(c) = linear_coefficient(self.simulation, &output.expression, v) {
                        slot.offer(self.simulation, "c", c);
                    }
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

    /// A measured quantity has the unit that its column's name ends in.
    fn name_unit(&self, slot: &mut Slot, symbol: &str, column: &str) {
        if let (Some(unit), Some(quantity)) = (Unit::of_column(column), slot.symbols.get_mut(symbol)) {
            quantity.unit = Some(unit);
        }
    }

    fn store_slot(&self, place: Place, label: String, name: &str, derivative: &Expr) -> Slot {
        let target = Target::Derivatives(vec![(name.to_owned(), 1.0)]);
        let mut slot = Slot::new(place, label, name.to_owned(), target);
        slot.offer(self.simulation, "s", Expr::symbol(name));
        self.offer_force(&mut slot, derivative, Some(name), name);
        slot.context = vec![derivative.clone()];
        slot
    }

    fn stores(&self) -> Vec<Slot> {
        if !self.motions.is_empty() || self.is_force_law() {
            return Vec::new();
        }
        let states = self.simulation.states.iter().filter(|s| self.original.state(&s.name).is_some());
        states.map(|s| self.store_slot(Place::Store, format!("state:{}", s.name), &s.name, &s.derivative)).collect()
    }

    fn sensors(&self) -> Vec<Slot> {
        let mut slots = Vec::new();
        for output in &self.simulation.outputs {
            let mut slot = Slot::new(
                Place::Sensor,
                format!("output:{}", output.column),
                format!("at {}", output.column),
                Target::Output(output.column.clone()),
            );
            slot.offer(self.simulation, "y", output.expression.clone());
            self.name_unit(&mut slot, "y", &output.column);
            slot.context = vec![output.expression.clone()];
            slot.constant = has_free_constant(self.simulation, &output.expression);
            slots.push(slot);
        }
        slots
    }

    fn parameters(&self) -> Vec<Slot> {
        let mut slots = Vec::new();
        for parameter in self.original.parameters.iter().filter(|p| !p.fixed) {
            let name = &parameter.name;
            let mut used = false;
            let mut shapes_memory = false;
            for state in &self.simulation.states {
                used |= state.derivative.uses(name);
            }
            for output in &self.simulation.outputs {
                // An offset of the sensor that drifts is a drift of the sensor.
                used |= output.expression.terms().iter().any(|(_, t)| t.uses(name) && **t != Expr::symbol(name));
            }
            for e in self.equations() {
                e.visit(&mut |e| {
                    if let Expr::Memory(_, arguments) = e {
                        shapes_memory |= arguments.iter().skip(1).any(|a| a.uses(name));
                    }
                });
            }
            if !used || shapes_memory {
                continue;
            }
            let mut slot =
                Slot::new(Place::Parameter, format!("parameter:{name}"), name.clone(), Target::Symbol(name.clone()));
            slot.offer(self.simulation, "p", Expr::symbol(name));
            slot.mass = self.motions.iter().any(|m| match force_path(self.simulation, m.derivative) {
                ForcePath::Quotient(_, mass) | ForcePath::Divided(mass) => mass.uses(name),
                ForcePath::Bare => false,
            });
            if let Some(output) = self.simulation.outputs.first() {
                slot.offer(self.simulation, "y", output.expression.clone());
            }
            let moved = self.motions.iter().find(|m| m.derivative.uses(name)).or(self.motions.first());
            if let Some(motion) = moved {
                slot.offer(self.simulation, "v", Expr::symbol(motion.v));
            } else if let Some(law) = self.force_laws().first() {
                if let Some(v) = law.quantity("v") {
                    slot.offer(self.simulation, "v", v.expression.clone());
                }
            }
            slot.context = self.equations();
            slots.push(slot);
        }
        slots
    }

    fn disturbances(&self) -> Vec<Slot> {
        let label = || "disturbance".to_owned();
        let moving = self.motions.iter().map(|m| self.motion_slot(Place::Disturbance, label(), m));
        let stores = self.stores();
        let stored = stores.iter().filter_map(|store| match &store.target {
            Target::Derivatives(states) => states.first(),
            _ => None,
        });
        let stored = stored
            .filter_map(|(name, _)| self.simulation.state(name))
            .map(|s| self.store_slot(Place::Disturbance, label(), &s.name, &s.derivative));
        let mut slots: Vec<Slot> = moving.chain(stored).collect();
        if slots.is_empty() {
            for output in &self.simulation.outputs {
                let target = Target::Output(output.column.clone());
                let mut slot = Slot::new(Place::Disturbance, label(), format!("in {}", output.column), target);
                slot.offer(self.simulation, "F", output.expression.clone());
                self.name_unit(&mut slot, "F", &output.column);
                slot.context = vec![output.expression.clone()];
                slots.push(slot);
            }
        }
        slots
    }
}
