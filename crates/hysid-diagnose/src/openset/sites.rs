//! Where generic terms act, and over what.

use std::ops::Range;

use hysid_plant::{Expr, Output, Simulation, Slot as Place};

use crate::slot::{Place as Slotted, Quantity, Slot, Structure, is_place, is_turn};

/// A signal that terms are written over.
#[derive(Debug, Clone)]
pub struct Symbol {
    /// As it is called in a term's text.
    pub name: String,
    /// What it stands for.
    pub meaning: Expr,
    /// Whether it is a velocity.
    pub velocity: bool,
}

impl Symbol {
    fn new(name: &str, meaning: Expr) -> Self {
        Self { name: name.to_owned(), meaning, velocity: false }
    }

    fn itself(name: &str) -> Self {
        Self::new(name, Expr::symbol(name))
    }
}

/// A place at which generic terms act.
#[derive(Debug)]
pub struct Site {
    /// In the engine.
    pub place: Place,
    /// The slot's name.
    pub slot: String,
    /// Plant, input or output.
    pub side: &'static str,
    /// What is there.
    pub own: Vec<Symbol>,
    /// The rate of what follows a command by itself, as an actuator does, which may be limited.
    pub rate: Option<Symbol>,
    /// What moves elsewhere.
    pub others: Vec<Symbol>,
    /// The coordinates among them that have their velocity there too: the places of both.
    pub parts: Vec<(usize, usize)>,
    /// The acceleration here, where there are such parts: on linkages the inertia depends on how the others stand.
    pub acceleration: Option<Symbol>,
    /// What turns elsewhere, where something moves here: its speed and its angle in rad.
    pub turning: Vec<[Symbol; 2]>,
    /// The rates of inputs that are places: what a length changes that someone else pays out has forces of that rate in it (a load on a rope that is hoisted).
    pub led: Vec<Symbol>,
    /// What a sensor may show a share of past what it measures.
    pub passed: Vec<Symbol>,
}

impl Site {
    /// A site at which nothing else is looked at than what is there.
    fn alone(place: Place, slot: String, side: &'static str, own: Vec<Symbol>) -> Self {
        let (rate, acceleration, others, led, passed) = (None, None, Vec::new(), Vec::new(), Vec::new());
        let (parts, turning) = (Vec::new(), Vec::new());
        Self { place, slot, side, own, rate, others, parts, acceleration, turning, led, passed }
    }

    /// All that terms are written over, in this order.
    pub fn symbols(&self) -> impl Iterator<Item = &Symbol> {
        let turning = self.turning.iter().flatten();
        let plant = self.own.iter().chain(&self.rate).chain(&self.others).chain(&self.acceleration);
        plant.chain(turning).chain(&self.led).chain(&self.passed)
    }

    /// What [`Self::others`] are among [`Self::symbols`].
    pub fn elsewhere(&self) -> Range<usize> {
        let start = self.own.len() + usize::from(self.rate.is_some());
        start..start + self.others.len()
    }

    /// What each pair of [`Self::turning`] is among [`Self::symbols`].
    pub fn turns(&self) -> impl Iterator<Item = [usize; 2]> {
        let start = self.elsewhere().end + usize::from(self.acceleration.is_some());
        (0..self.turning.len()).map(move |i| [start + 2 * i, start + 2 * i + 1])
    }

    /// What [`Self::led`] are among [`Self::symbols`].
    pub fn led_at(&self) -> Range<usize> {
        let end = self.passed_at().start;
        end - self.led.len()..end
    }

    /// What [`Self::passed`] are among [`Self::symbols`]: the last.
    pub fn passed_at(&self) -> Range<usize> {
        let end = self.symbols().count();
        end - self.passed.len()..end
    }
}

/// Most states of other parts in which a slot's correction may be written, and of those that a parameter may follow.
pub const OTHERS: usize = 6;

/// The places of a simulation at which generic terms act.
pub fn sites(simulation: &Simulation, structure: &Structure) -> Vec<Site> {
    // Over an angle that nothing uses there is nothing but what returns with the turn, and the catalogue has that.
    let used = |i: &usize| !is_turn(simulation, &simulation.states[*i].name);
    let states = (0..simulation.states.len()).filter(used).map(|i| of_state(simulation, structure, i));
    let has_slot = |label: &String| structure.slots.iter().any(|s| s.label == *label && s.place != Slotted::Prescribed);
    let inputs = simulation.inputs.iter().enumerate().filter(|_| !simulation.is_static()).map(|(i, input)| {
        Site::alone(Place::Input(i), format!("input:{}", input.symbol), "input", vec![Symbol::itself(&input.symbol)])
    });
    let outputs = simulation.outputs.iter().enumerate().map(|(i, output)| {
        let signal = |name: &String| Symbol { velocity: name.starts_with('v'), ..Symbol::itself(name) };
        let (side, own) = if simulation.is_static() {
            ("plant", simulation.inputs.iter().map(|u| signal(&u.symbol)).collect())
        } else {
            ("output", vec![Symbol::new("y", output.expression.clone())])
        };
        // What another sensor shows, of which this one may show a share (the cross-talk of a force platform).
        let shown = |(_, o): (usize, &Output)| Symbol::new(&o.column, o.expression.clone());
        let elsewhere =
            simulation.outputs.iter().enumerate().filter(|(j, o)| *j != i && o.expression != output.expression);
        let (others, passed) = if simulation.is_static() {
            Default::default()
        } else {
            (elsewhere.take(OTHERS).map(shown).collect(), passed(simulation, i))
        };
        Site { others, passed, ..Site::alone(Place::Output(i), format!("output:{}", output.column), side, own) }
    });
    states.chain(inputs.filter(|site| has_slot(&site.slot))).chain(outputs).collect()
}

/// The states, but for angles that nothing uses.
fn used_states(simulation: &Simulation) -> impl Iterator<Item = &str> {
    simulation.states.iter().map(|s| s.name.as_str()).filter(|name| !is_turn(simulation, name))
}

/// What goes into the machine, and what moves inside it, that neither this output nor another shows: a sensor may show a share of it (the resistance in series
/// with a capacitor, a current that is picked up).
fn passed(simulation: &Simulation, output: usize) -> Vec<Symbol> {
    let own = &simulation.outputs[output].expression;
    let shown = |name: &str| {
        let is_it = |o: &Output| matches!(&o.expression, Expr::Symbol(s) if s == name);
        own.uses(name) || simulation.outputs.iter().any(is_it)
    };
    let inputs = simulation.inputs.iter().map(|u| u.symbol.as_str());
    inputs.chain(used_states(simulation)).filter(|name| !shown(name)).take(OTHERS).map(Symbol::itself).collect()
}

/// The equation of a state. In one that has no slot, as a part of a cascade, only the rate may be limited.
fn of_state(simulation: &Simulation, structure: &Structure, i: usize) -> Site {
    let state = &simulation.states[i];
    let label = format!("state:{}", state.name);
    let own = structure.slots.iter().find(|s| s.label == label).map(|slot| {
        let of = |n: &str| {
            let meaning = slot.quantity(n)?.expression.clone();
            let name = if let Expr::Symbol(s) = &meaning { s.clone() } else { n.to_owned() };
            Some(Symbol { velocity: n == "v", ..Symbol::new(&name, meaning) })
        };
        let motion: Vec<Symbol> = ["x", "v"].into_iter().filter_map(of).collect();
        if motion.is_empty() { vec![Symbol::itself(&state.name)] } else { motion }
    });
    let others = own.as_ref().map_or(Vec::new(), |own| others(simulation, own));
    let moved = own.as_ref().filter(|own| own.iter().any(|s| s.velocity));
    let turning = moved.map_or(Vec::new(), |own| turning(structure, own));
    let own = own.unwrap_or_default();
    let moves_by_itself = own.iter().all(|s| s.name == state.name) && !matches!(state.derivative, Expr::Symbol(_));
    let rate = moves_by_itself.then(|| Symbol::new(&format!("rate_{}", state.name), state.derivative.clone()));
    let place = |name: &str| others.iter().position(|o| o.name == name);
    let velocity = |coordinate: &Symbol| {
        let of_coordinate = |s: &&Slot| {
            let itself = s.coordinate().and_then(|x| s.quantity(x)).is_some_and(|q| q.expression == coordinate.meaning);
            s.place == Slotted::Force && itself
        };
        match &structure.slots.iter().find(of_coordinate)?.own_velocity()?.expression {
            Expr::Symbol(v) => place(v),
            _ => None,
        }
    };
    let parts: Vec<(usize, usize)> = (0..others.len()).filter_map(|x| Some((x, velocity(&others[x])?))).collect();
    let moves = own.iter().any(|s| s.velocity) && !parts.is_empty();
    let acceleration = moves.then(|| Symbol::new(&format!("acc_{}", state.name), state.derivative.clone()));
    let led = if own.is_empty() { Vec::new() } else { led(simulation) };
    Site { rate, others, parts, acceleration, turning, led, ..Site::alone(Place::State(i), label, "plant", own) }
}

/// The rates of the inputs that are places, of a simulation that is driven by something else, too.
fn led(simulation: &Simulation) -> Vec<Symbol> {
    if simulation.inputs.len() < 2 {
        return Vec::new();
    }
    let places = simulation.inputs.iter().map(|u| u.symbol.as_str()).filter(|u| is_place(simulation, u));
    places.map(|u| Symbol::new(&format!("rate_{u}"), Expr::symbol(u).derivative_of_input())).collect()
}

/// The speeds and angles of what turns without a part in a slot's own coordinates, as a rotor in a machine that stands on springs.
fn turning(structure: &Structure, own: &[Symbol]) -> Vec<[Symbol; 2]> {
    let of_slot = |slot: &Slot| {
        let elsewhere = |quantity: &Quantity| match &quantity.expression {
            Expr::Symbol(name) if own.iter().all(|s| !s.meaning.uses(name)) => Some(name.clone()),
            _ => None,
        };
        let speed = elsewhere(slot.own_velocity()?)?;
        let name = format!("{}_rad", elsewhere(slot.quantity(slot.coordinate()?)?)?);
        let text = Expr::parse(slot.angle()?).ok()?;
        let meant = |e: Expr, n: &String| match slot.quantity(n) {
            Some(quantity) => e.substitute(n, &quantity.expression),
            None => e,
        };
        let angle = text.symbols().iter().fold(text, meant).simplified();
        Some([Symbol::itself(&speed), Symbol::new(&name, angle)])
    };
    structure.slots.iter().filter(|s| s.place == Slotted::Force).filter_map(of_slot).collect()
}

/// The states that none of a slot's own coordinates is made of: what moves elsewhere acts through products (a swing's centrifugal force, a field's
/// pull), and in proportion where the simulation has no parameter for it (two axes that a spinning wheel couples).
fn others(simulation: &Simulation, own: &[Symbol]) -> Vec<Symbol> {
    let known: Vec<String> = own.iter().flat_map(|s| s.meaning.symbols()).collect();
    used_states(simulation).filter(|name| known.iter().all(|k| k != name)).take(OTHERS).map(Symbol::itself).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::slot::with_turns;

    /// The name of the speed and the meaning of the angle of each pair that turns elsewhere, at a slot of a table under a rotor whose states are these.
    fn turning_at(slot: &str, rotor: &str) -> Vec<String> {
        let text = format!(
            "[time]\nperiod_s = 0.01\n[inputs]\nu = \"ref_rpm\"\n[parameters]\nT = {{ value = 1.0, min = 0.1 }}\nk = {{ value = 90.0, min = 9.0 }}\n[states]\n{rotor}\
             x = {{ derivative = \"v\", initial = 0.0, unit = \"mm\" }}\nv = {{ derivative = \"-k*x - T*v\", initial = 0.0, unit = \"mm/s\" }}\n\
             [outputs]\nx_mm = \"x\"\nspeed_rpm = \"n\"\n"
        );
        let simulation = with_turns(&Simulation::parse(&text, "table.sim.toml").unwrap());
        let sites = sites(&simulation, &Structure::of(&simulation));
        let site = sites.iter().find(|s| s.slot == slot).unwrap();
        let told = |i: usize| site.symbols().nth(i).unwrap().meaning.to_string();
        site.turns().map(|[speed, angle]| format!("{}: {}", told(speed), told(angle))).collect()
    }

    #[test]
    fn what_turns_elsewhere_shakes_what_moves() {
        let speed = "n = { derivative = \"(u - n)/T\", initial = 0.0, unit = \"rpm\" }\n";
        assert_eq!(turning_at("state:v", speed), ["n: turn"]);
        // Not where it is at home: the catalogue has that.
        assert!(turning_at("state:n", speed).is_empty());
        let angle = "q = { derivative = \"n*6\", initial = 0.0, unit = \"deg\" }\n";
        assert_eq!(turning_at("state:v", &format!("{speed}{angle}")), ["n: pi/180*q"]);
    }

    #[test]
    fn what_is_paid_out_has_forces_of_its_rate() {
        let led_at = |inputs: &str| {
            let text = format!(
                "[time]\nperiod_s = 0.01\n[inputs]\n{inputs}\n[parameters]\nc = {{ value = 1.0, min = 0.1 }}\n[states]\n\
                 q = {{ derivative = \"w\", initial = 0.0, unit = \"rad\" }}\nw = {{ derivative = \"-9.81*q/l - c*w\", initial = 0.0, unit = \"rad/s\" }}\n\
                 [outputs]\nq_rad = \"q\"\n"
            );
            let simulation = Simulation::parse(&text, "crane.sim.toml").unwrap();
            let sites = sites(&simulation, &Structure::of(&simulation));
            let site = sites.iter().find(|s| s.slot == "state:w").unwrap();
            site.led_at().map(|i| site.symbols().nth(i).unwrap().meaning.to_string()).collect::<Vec<_>>()
        };
        assert_eq!(led_at("a = \"trolley_m_s2\"\nl = \"rope_m\""), ["d(l)"]);
        assert!(led_at("a = \"trolley_m_s2\"\nl = \"load_kg\"").is_empty(), "no place");
        assert!(led_at("l = \"rope_m\"").is_empty(), "what drives it is there already");
    }

    #[test]
    fn a_part_elsewhere_has_its_coordinate_and_its_velocity_whatever_their_units() {
        let parts = |rate: &str| {
            let text = format!(
                "[time]\nperiod_s = 1e-4\n[inputs]\nu = \"drive_V\"\n[parameters]\nk = {{ value = 9.0, min = 0.1 }}\n[states]\n\
                 x = {{ derivative = \"{rate}\", initial = 0.0 }}\nwx = {{ derivative = \"u - k*x - wx\", initial = 0.0 }}\n\
                 y = {{ derivative = \"wy*1000\", initial = 0.0 }}\nwy = {{ derivative = \"u - 2*k*y - wy\", initial = 0.0 }}\n[outputs]\ntip = \"x\"\ntilt = \"y\"\n"
            );
            let simulation = Simulation::parse(&text, "mirror.sim.toml").unwrap();
            let sites = sites(&simulation, &Structure::of(&simulation));
            let site = sites.into_iter().find(|s| s.slot == "state:wy").unwrap();
            site.parts.iter().map(|(x, v)| [*x, *v].map(|i| site.others[i].name.clone())).collect::<Vec<_>>()
        };
        for rate in ["wx", "1000*wx"] {
            assert_eq!(parts(rate), [["x", "wx"]], "{rate}");
        }
    }
}
