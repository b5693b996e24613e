//! The slots of a simulation, found from its equations.

use hysid_plant::{Expr, Memory, Output, Simulation, State, Unit};

use super::algebra::{has_free_constant, linear_coefficient};
use super::motion::{Kinematic, Motion, force_of, force_path, kinematic, motions};
use super::{OWN_VELOCITY, Place, Sensed, Slot, Target, sensed};

/// What a simulation is made of, as far as mechanisms care.
#[derive(Debug, Clone, PartialEq)]
pub struct Structure {
    /// Every place at which something can be missing.
    pub slots: Vec<Slot>,
}

impl Structure {
    /// The slots of a simulation as the user wrote it.
    pub fn of(simulation: &Simulation) -> Self {
        Self::within(simulation, simulation)
    }

    /// The slots of a simulation that effects have been written into: those of the `original`, with what stands there now.
    pub fn within(simulation: &Simulation, original: &Simulation) -> Self {
        let finder = Finder { simulation, original, motions: motions(simulation, original) };
        let sensed = sensed(original);
        let mut slots = Vec::new();
        slots.extend(finder.inputs());
        slots.extend(finder.cascades());
        slots.extend(finder.commands());
        slots.extend(finder.forces());
        slots.extend(finder.connections());
        slots.extend(finder.force_laws());
        slots.extend(finder.core_laws());
        slots.extend(finder.curves());
        slots.extend(finder.own_loops());
        slots.extend(finder.own_plays());
        slots.extend(finder.stores());
        slots.extend(finder.circuits());
        slots.extend(finder.sensors());
        slots.extend(finder.sensors_together(&sensed));
        slots.extend(finder.parameters());
        slots.extend(finder.disturbances());
        for slot in &mut slots {
            // What an element is felt by was told with it.
            if let (Target::Derivatives(states), true) = (&slot.target, slot.sensed.is_empty()) {
                let here = |s: &&Sensed| states.iter().any(|pull| pull.state == s.state);
                slot.sensed = sensed.iter().filter(here).cloned().collect();
            }
        }
        slots.extend(finder.in_load_cells(&slots));
        let idle_loads = finder.idle_loads();
        for slot in &mut slots {
            for (i, input) in (1..).zip(&simulation.inputs) {
                slot.offer(simulation, &format!("u_{i}"), Expr::symbol(&input.symbol));
                if i == 1 && !slot.has("u") {
                    slot.offer(simulation, "u", Expr::symbol(&input.symbol));
                }
            }
            slot.inputs = simulation.inputs.len();
            slot.idle_loads.clone_from(&idle_loads);
        }
        Self { slots }
    }
}

/// Whether a unit measures the same as one of these.
pub(super) fn is_one_of(unit: &Unit, names: &[&str]) -> bool {
    names.iter().filter_map(|name| Unit::parse(name).ok()).any(|u| u.same_dimension(unit))
}

/// Whether what has this unit presses upon something: a force, a moment, a pressure.
pub(super) fn presses(unit: &Unit) -> bool {
    is_one_of(unit, &["N", "N m", "Pa"])
}

/// Whether what has this unit may be what a drive is fed with: no motion, no flow, no temperature.
pub(crate) fn feeds(unit: &Unit) -> bool {
    let others = ["m/s^2", "1/s", "1/s^2", "m3", "m3/s", "kg", "kg/s", "K"];
    kinematic(Some(unit), "") == Kinematic::Neither && !is_one_of(unit, &others)
}

/// Whether a unit is known and measures the same as one of these.
pub(super) fn has_unit(unit: Option<Unit>, names: &[&str]) -> bool {
    unit.is_some_and(|u| is_one_of(&u, names))
}

/// Looks for the slots of each kind.
pub(super) struct Finder<'a> {
    pub simulation: &'a Simulation,
    pub original: &'a Simulation,
    pub motions: Vec<Motion<'a>>,
}

impl Finder<'_> {
    pub(super) fn unit_of_output(&self, column: &str, expression: &Expr) -> Option<Unit> {
        Unit::of_column(column).or_else(|| self.simulation.unit_of_expr(expression))
    }

    /// What an input is as a motion. Where pressures over a flow are all that is simulated, the flow is the velocity of what is pressed through.
    pub(super) fn kinematic_input(&self, symbol: &str) -> Kinematic {
        let unit = self.simulation.unit_of(symbol);
        match kinematic(unit.as_ref(), symbol) {
            Kinematic::Neither
                if unit.as_ref().is_none_or(|u| is_one_of(u, &["percent"])) && self.is_strained(symbol) =>
            {
                Kinematic::Displacement
            }
            Kinematic::Neither if self.is_pressure_law() => match unit {
                Some(u) if is_one_of(&u, &["m3/s"]) => Kinematic::Velocity,
                Some(u) if is_one_of(&u, &["m3"]) => Kinematic::Displacement,
                _ => Kinematic::Neither,
            },
            kind => kind,
        }
    }

    /// Whether an input without dimension is the strain of a specimen: forces or stresses are all that is simulated, and its rate is in them.
    fn is_strained(&self, symbol: &str) -> bool {
        let presses = |o: &Output| self.unit_of_output(&o.column, &o.expression).is_some_and(|u| presses(&u));
        let rate = Expr::symbol(symbol).derivative_of_input();
        let strained = |o: &Output| presses(o) && o.expression.replace(&rate, &Expr::Number(0.0)) != o.expression;
        self.simulation.is_static()
            && self.simulation.outputs.iter().all(presses)
            && self.simulation.outputs.iter().any(strained)
    }

    fn is_pressure_law(&self) -> bool {
        let pressed = |o: &Output| has_unit(self.unit_of_output(&o.column, &o.expression), &["Pa"]);
        self.simulation.is_static() && self.simulation.outputs.iter().all(pressed)
    }

    /// Whether the outputs are forces over the motion that the inputs prescribe.
    pub(super) fn is_force_law(&self) -> bool {
        let prescribed = self.simulation.inputs.iter().any(|i| self.kinematic_input(&i.symbol) != Kinematic::Neither);
        // A motion, and what flows or is warm (behind a pump, of which the speed is prescribed), is no force. Nor is a pressure in a
        // simulation with states: a volume holds it.
        let is_none = |column: &str, e: &Expr| {
            self.unit_of_output(column, e).is_some_and(|u| {
                kinematic(Some(&u), "") != Kinematic::Neither
                    || is_one_of(&u, &["m3", "m3/s", "kg/s", "K"])
                    || (!self.simulation.is_static() && is_one_of(&u, &["Pa"]))
            })
        };
        self.motions.is_empty()
            && prescribed
            && !self.simulation.outputs.iter().any(|o| is_none(&o.column, &o.expression))
    }

    /// The derivatives of these states.
    pub(super) fn derivatives_of(&self, states: &[String]) -> Vec<Expr> {
        states.iter().filter_map(|s| self.simulation.state(s)).map(|s| s.derivative.clone()).collect()
    }

    pub(super) fn equations(&self) -> Vec<Expr> {
        self.simulation.expressions().into_iter().map(|(_, e)| e.clone()).collect()
    }

    /// Whether a state is the displacement or the velocity of a part.
    pub(super) fn moves(&self, name: &str) -> bool {
        self.motions.iter().any(|m| m.v == name || m.state == name || m.x == Some(name))
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
            let prescribed = law && self.kinematic_input(symbol) != Kinematic::Neither;
            // In a static law what the motion does is what the law does, and another is not put in its place without its rate.
            if !used || (prescribed && (differentiated(symbol) || self.simulation.is_static())) {
                continue;
            }
            let mut slot = Slot::new(
                if prescribed { Place::Prescribed } else { Place::Input },
                format!("input:{symbol}"),
                format!("at the input {symbol}"),
                Target::Symbol(symbol.clone()),
            );
            slot.offer(self.simulation, "u", Expr::symbol(symbol));
            slot.context = self.equations();
            let driven = self.motions.iter().find(|m| m.derivative.uses(symbol));
            if let Some(motion) = driven {
                self.offer_motion(&mut slot, motion);
            }
            // A constant that is free takes up an offset where it stands beside the input wherever that enters.
            let states =
                self.simulation.states.iter().map(|s| (&s.derivative, force_of(self.simulation, &s.derivative).0));
            let outputs = self.simulation.outputs.iter().map(|o| (&o.expression, &o.expression));
            let mut entered = states.chain(outputs).filter(|(whole, _)| whole.uses(symbol)).peekable();
            slot.constant = entered.peek().is_some() && entered.all(|(_, sum)| has_free_constant(self.simulation, sum));
            slots.push(slot);
            slots.extend(self.wound(symbol));
        }
        slots
    }

    /// The winding that an input feeds.
    fn wound(&self, input: &str) -> Option<Slot> {
        let (current, motion) = self.winding(input)?;
        let driven = vec![current.to_owned()];
        let mut slot = Slot::new(
            Place::Winding,
            format!("state:{current}"),
            format!("in the winding of {current}"),
            Target::SymbolIn(input.to_owned(), driven.clone(), None),
        );
        slot.offer(self.simulation, "u", Expr::symbol(input));
        slot.offer(self.simulation, "i", Expr::symbol(current));
        slot.offer(self.simulation, "v", Expr::symbol(motion.v));
        slot.context = self.derivatives_of(&driven);
        Some(slot)
    }

    /// Offers the velocity of a part and, where it has one, its displacement.
    pub(super) fn offer_motion(&self, slot: &mut Slot, motion: &Motion<'_>) {
        slot.offer(self.simulation, "v", motion.rate());
        if motion.scale.is_some() {
            slot.offer(self.simulation, OWN_VELOCITY, Expr::symbol(motion.v));
        }
        if let Some(x) = motion.x {
            slot.offer(self.simulation, "x", Expr::symbol(x));
            slot.measure_rate("v", "x");
        }
        if let Some(turn) = motion.turn {
            slot.offer(self.simulation, "turn", Expr::symbol(turn));
        }
    }

    /// The current that a parameter resists, as `R` in `(u - R*i)/L`; of a recorded one, as `R` in `e - R*i`.
    fn current_through(&self, parameter: &str) -> Option<&str> {
        let resists = |s: &&State| {
            let (voltage, inductance) = force_of(self.simulation, &s.derivative);
            has_unit(self.simulation.unit_of(&s.name), &["A"])
                && linear_coefficient(self.simulation, voltage, &s.name).is_some_and(|c| c.uses(parameter))
                && !inductance.is_some_and(|l| l.uses(parameter))
        };
        let recorded = |symbol: &&str| {
            let through = |e: &Expr| {
                linear_coefficient(self.simulation, force_of(self.simulation, e).0, symbol)
                    .is_some_and(|c| c.uses(parameter))
            };
            has_unit(self.simulation.unit_of(symbol), &["A"]) && self.equations().iter().any(through)
        };
        let state = self.simulation.states.iter().find(resists).map(|s| s.name.as_str());
        state.or_else(|| self.simulation.inputs.iter().map(|i| i.symbol.as_str()).find(recorded))
    }

    /// The current of a winding that an input drives, and the motion that it moves; `None` where the winding feels the speed already.
    fn winding(&self, input: &str) -> Option<(&str, &Motion<'_>)> {
        let mut driven = self.simulation.states.iter().filter(|s| s.derivative.uses(input) && self.is_current(s));
        let moved = |s: &State| self.motions.iter().find(|m| m.derivative.uses(&s.name) && !s.derivative.uses(m.v));
        driven.find_map(|s| Some((s.name.as_str(), moved(s)?)))
    }

    /// Whether a state may be a current, or the flux linkage that tells it: one that does not move, in amperes or webers where its unit is known.
    pub(super) fn is_current(&self, state: &State) -> bool {
        !self.moves(&state.name) && self.simulation.unit_of(&state.name).is_none_or(|u| is_one_of(&u, &["A", "Wb"]))
    }

    /// A measured quantity has the unit that its column's name ends in.
    pub(super) fn name_unit(&self, slot: &mut Slot, symbol: &str, column: &str) {
        if let (Some(unit), Some(quantity)) = (Unit::of_column(column), slot.symbols.get_mut(symbol)) {
            quantity.unit = Some(unit);
        }
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
            let divides =
                |m: &Motion<'_>| force_path(self.simulation, m.derivative).mass().is_some_and(|mass| mass.uses(name));
            slot.mass = self.motions.iter().any(divides);
            if let Some(output) = self.simulation.outputs.first() {
                slot.offer(self.simulation, "y", output.expression.clone());
            }
            let of_a_part = self.motions.iter().find(|m| m.derivative.uses(name));
            if let (None, Some(current)) = (of_a_part, self.current_through(name)) {
                // What a resistance makes of a current is what a damper makes of a velocity.
                slot.offer(self.simulation, "v", Expr::symbol(current));
            } else if let Some(current) = self.resisted_current(name) {
                slot.offer(self.simulation, "v", current);
            } else if let Some(motion) = of_a_part.or(self.motions.first()) {
                self.offer_motion(&mut slot, motion);
                match self.slip(name) {
                    Some(slip) => slot.offer(self.simulation, "v", slip),
                    None => self.offer_heat(&mut slot, motion, name),
                }
            } else if let Some(law) = self.force_laws().first() {
                for symbol in ["v", "x"] {
                    if let Some(q) = law.quantity(symbol) {
                        slot.offer(self.simulation, symbol, q.expression.clone());
                    }
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
            .filter_map(|pull| self.simulation.state(&pull.state))
            .map(|s| self.store_slot(Place::Disturbance, label(), &s.name, &s.derivative));
        let mut slots: Vec<Slot> = moving.chain(stored).collect();
        // One sensor shows a force and a hum of its own alike; of several, the force is seen by more than one.
        if slots.is_empty() || self.simulation.outputs.len() > 1 {
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
