//! Slots: the places of a simulation at which something can be missing, found from its equations.
//!
//! A state `x` whose derivative is exactly the state `v` is a displacement with its velocity, and the derivative of `v` holds
//! the force. Where that derivative is a quotient `(...)/m` by parameters, forces enter above the line and have the unit of a
//! force; else they have the unit of the derivative. Two displacements that appear in each other's force are connected, and a
//! law can stand between them, also over a gear; so are two velocities whose difference, but for factors, is the derivative of
//! a state that both feel. A displacement may also be a multiple of the integral of its velocity (`1000*v`, or `p/m` of a
//! momentum). A state without a partner whose unit is a speed is a velocity without its displacement; any other is a store. A
//! simulation without states is a static relation: its force laws stand at the output, over the inputs that are a displacement
//! or a velocity by their unit or name (where there is only a displacement, the velocity is `d(x)`).
//! Where one part of a simulation drives another and nothing comes back, what it passes on is an input of the second; where that is a sum
//! of several states, the sum is.

mod algebra;
mod balance;
mod cascades;
mod cells;
mod commands;
mod connections;
mod elements;
mod find;
mod forces;
mod grounds;
mod heat;
mod laws;
mod loops;
mod motion;
mod pattern;
mod place;
mod seen;
mod sensed;
mod stores;
mod target;
mod turn;

use std::collections::BTreeMap;
use std::fmt::{self, Display, Formatter};

use hysid_plant::{Expr, Function, Simulation, Unit};

use find::presses;

pub use find::Structure;
pub(crate) use find::feeds;
pub use place::Place;

pub(crate) use algebra::{is_linear, only_parameters};
pub(crate) use balance::with_balances;
pub(crate) use loops::play_of;
pub(crate) use motion::{ForcePath, force_path, is_place};
pub(crate) use sensed::{Felt, Sensed, sensed};
pub(crate) use target::{Pull, Rate, Seen, Target};
pub(crate) use turn::{begins_anywhere, is_turn, with_turns, with_used_turns};

/// Signs of a velocity that a simulation may have: the sharp one, then the smoothed ones that may stand in its place.
pub(crate) const SIGNS: [&str; 8] = [
    "sign(v)",
    "tanh(v/P)",
    "tanh(P*v)",
    "atan(v/P)",
    "atan(P*v)",
    "v/(abs(v) + P)",
    "v/sqrt(v^2 + P)",
    "v/sqrt(v*v + P)",
];

/// What a smoothed sign of this form comes to at large velocities.
fn reach(form: &Expr) -> Expr {
    match form {
        Expr::Call(Function::Atan, _) => Expr::symbol("pi") / 2.0,
        _ => Expr::Number(1.0),
    }
}

/// The symbol for the velocity as the simulation has it, where that is not the rate of the displacement.
pub(crate) const OWN_VELOCITY: &str = "v_own";

/// A place of a simulation at which a mechanism can stand.
#[derive(Debug, Clone, PartialEq)]
pub struct Slot {
    /// Its kind.
    pub place: Place,
    /// The name in `diagnosis.json`, as in `state:v`.
    pub label: String,
    /// Where it is, for people: `between x1 and x2`, `at the input u`.
    pub whereabouts: String,
    /// What the law's symbols stand for here.
    symbols: BTreeMap<String, Quantity>,
    pub(crate) target: Target,
    /// Outputs that measure the derivatives which a force here changes.
    pub(crate) sensed: Vec<Sensed>,
    /// The state that feels the output which a law here adds to: the flux of a winding its current.
    pub(crate) feeds_back: Option<Pull>,
    /// Whether the output here is what a part pulls with, which falls as it moves on: a force of a law is taken from it.
    pub(crate) pulls: bool,
    /// What is looked through for a mechanism that is already there.
    context: Vec<Expr>,
    inputs: usize,
    idle_loads: Vec<String>,
    constant: bool,
    loops: bool,
    mass: bool,
    feeds: bool,
    turns: bool,
}

/// What a symbol of a law stands for at a slot.
#[derive(Debug, Clone, PartialEq)]
pub struct Quantity {
    /// The expression over the simulation's symbols.
    pub expression: Expr,
    /// Its unit, where the simulation settles it.
    pub unit: Option<Unit>,
}

impl Display for Slot {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(&self.label)
    }
}

impl Slot {
    /// Whether it is the same place: a force on a part and one between it and another share a label.
    pub fn is_at(&self, other: &Self) -> bool {
        (self.place, &self.label, &self.whereabouts) == (other.place, &other.label, &other.whereabouts)
    }

    /// The same place in one word.
    pub fn identity(&self) -> String {
        format!("{} ({})", self.label, self.whereabouts)
    }

    /// Whether a force here changes the derivative of this state.
    fn pulls_at(&self, state: &str) -> bool {
        matches!(&self.target, Target::Derivatives(pulls) if pulls.iter().any(|p| p.state == state))
    }

    fn new(place: Place, label: String, whereabouts: String, target: Target) -> Self {
        Self {
            place,
            label,
            whereabouts,
            symbols: BTreeMap::new(),
            target,
            sensed: Vec::new(),
            feeds_back: None,
            pulls: false,
            context: Vec::new(),
            inputs: 0,
            idle_loads: Vec::new(),
            constant: false,
            loops: false,
            mass: false,
            feeds: false,
            turns: false,
        }
    }

    fn offer(&mut self, simulation: &Simulation, symbol: &str, expression: Expr) {
        let unit = simulation.unit_of_expr(&expression);
        self.symbols.insert(symbol.to_owned(), Quantity { expression, unit });
    }

    /// Gives a symbol the unit of another.
    fn measure_alike(&mut self, symbol: &str, other: &str) {
        let unit = self.quantity(other).and_then(|q| q.unit.clone());
        if let Some(quantity) = self.symbols.get_mut(symbol) {
            quantity.unit = unit;
        }
    }

    /// Gives a symbol whose unit is not known (a velocity in thousandths) that of the rate of another.
    fn measure_rate(&mut self, symbol: &str, of: &str) {
        let per_second = |unit: &Unit| Some(unit.per(&Unit::parse("s").ok()?));
        let unit = self.quantity(of).and_then(|q| q.unit.as_ref()).and_then(per_second);
        if let Some(quantity) = self.symbols.get_mut(symbol).filter(|q| q.unit.is_none()) {
            quantity.unit = unit;
        }
    }

    /// Leaves the unit of a symbol open.
    fn forget_unit(&mut self, symbol: &str) {
        if let Some(quantity) = self.symbols.get_mut(symbol) {
            quantity.unit = None;
        }
    }

    /// Whether a law can use this symbol here.
    pub fn has(&self, symbol: &str) -> bool {
        self.symbols.contains_key(symbol)
    }

    /// The symbol of the coordinate that a force may return with: the displacement, or the angle of what turns.
    pub(crate) fn coordinate(&self) -> Option<&'static str> {
        ["x", "turn"].into_iter().find(|x| self.has(x))
    }

    /// The velocity as the simulation has it, which the rate of the coordinate may be a multiple of.
    pub(crate) fn own_velocity(&self) -> Option<&Quantity> {
        self.quantity(if self.has(OWN_VELOCITY) { OWN_VELOCITY } else { "v" })
    }

    /// The angle in radians, as text, where the coordinate is one.
    pub(crate) fn angle(&self) -> Option<&'static str> {
        match self.coordinate()? {
            "x" => self.has("rad").then_some("rad*x"),
            turn => Some(turn),
        }
    }

    /// What a symbol stands for here.
    pub fn quantity(&self, symbol: &str) -> Option<&Quantity> {
        self.symbols.get(symbol)
    }

    /// All symbols that a law can use here, in alphabetical order.
    pub fn symbols(&self) -> impl Iterator<Item = (&str, &Quantity)> {
        self.symbols.iter().map(|(name, quantity)| (name.as_str(), quantity))
    }

    /// The number of inputs of the simulation, offered as `u_1`, `u_2`, ...
    pub fn inputs(&self) -> usize {
        self.inputs
    }

    /// What the outputs that see the motion here measure of it, each offered as `y_1`, `y_2`, ...
    pub(crate) fn seen(&self) -> &[Seen] {
        match &self.target {
            Target::Outputs(seen) => seen,
            _ => &[],
        }
    }

    /// The inputs that enter the equations here, as they are offered.
    fn entering(&self) -> Vec<String> {
        let enters = |symbol: &String| {
            let here = |name: &String| self.context.iter().any(|e| e.uses(name));
            self.quantity(symbol).is_some_and(|q| q.expression.symbols().iter().any(here))
        };
        (1..=self.inputs).map(|i| format!("u_{i}")).filter(enters).collect()
    }

    /// Whether an input enters the equations here.
    pub(crate) fn is_driven(&self) -> bool {
        !self.entering().is_empty()
    }

    /// What may load a guide or a gear here, as it is offered: first recorded inputs that move nothing in the simulation (somebody recorded a clamping
    /// force), then those that enter the equations here, then what other parts pass on. In a static force law the motion enters too, which loads nothing.
    pub(crate) fn loads(&self) -> Vec<String> {
        let pressing = |u: &String| self.quantity(u).and_then(|q| q.unit.as_ref()).is_some_and(presses);
        let mut others = self.entering();
        others.retain(|u| !self.idle_loads.contains(u) && (self.place != Place::ForceLaw || pressing(u)));
        others.extend(self.has("load").then(|| "load".to_owned()));
        [&self.idle_loads[..], &others].concat()
    }

    /// Whether a parameter of its own is added to the force or to the output here: an offset.
    pub fn has_constant(&self) -> bool {
        self.constant
    }

    /// Whether a state of the simulation already has a loop in the velocity of this slot.
    pub(crate) fn loops(&self) -> bool {
        self.loops
    }

    /// Whether the slot is a parameter by which a force is divided: a mass.
    pub(crate) fn is_mass(&self) -> bool {
        self.mass
    }

    /// Whether what is connected here turns, by its units.
    pub(crate) fn turns(&self) -> bool {
        self.turns
    }

    /// Whether the slot is a parameter that dissipates power: one that a velocity or a current is multiplied by, or that makes the current.
    pub(crate) fn dissipates(&self) -> bool {
        let (Some(parameter), Some(v)) = (self.quantity("p"), self.quantity("v")) else { return false };
        let uses = |e: &Expr, quantity: &Quantity| quantity.expression.symbols().iter().any(|s| e.uses(s));
        // A current that falls as the resistance grows.
        let mut found = uses(&v.expression, parameter);
        for equation in &self.context {
            equation.visit(&mut |e| {
                if let Expr::Binary(hysid_plant::BinaryOp::Mul, a, b) = e {
                    found |= (uses(a, parameter) && uses(b, v)) || (uses(a, v) && uses(b, parameter));
                }
            });
        }
        found
    }

    /// The measure of a mass here: `m` where there is one, else a pure number.
    pub(crate) fn mass_measure(&self) -> &'static str {
        if self.has("m") { "m" } else { "1" }
    }

    /// Whether the mass depends on the motion.
    pub(crate) fn mass_varies(&self) -> bool {
        match (&self.target, self.quantity("x")) {
            (Target::Derivatives(_), Some(x)) => self.context.iter().any(|e| {
                matches!(e, Expr::Binary(hysid_plant::BinaryOp::Div, _, below)
                    if x.expression.symbols().iter().any(|s| below.uses(s)))
            }),
            _ => false,
        }
    }

    /// Whether the equations here contain an expression of this form. Symbols of the slot stand for what they are here, a
    /// single capital letter for anything.
    pub fn shows(&self, form: &str) -> bool {
        let shown = |v: &str| {
            let symbol = |s: &str| self.symbols.get(if s == "v" { v } else { s }).map(|q| q.expression.clone());
            let form = pattern::prepare(form, symbol);
            form.is_some_and(|form| self.context.iter().any(|e| pattern::occurs(&form, e)))
        };
        shown("v") || (self.has(OWN_VELOCITY) && shown(OWN_VELOCITY))
    }

    /// Offers the sign of the velocity as the equations here smooth it, where they do: friction that sticks beside one that creeps is another machine.
    fn offer_own_sign(&mut self, simulation: &Simulation) {
        if let Some((form, part)) = self.smooth_sign() {
            self.offer(simulation, "own_sign", (part / reach(&form)).simplified());
        }
    }

    /// The form in which the equations here smooth the sign of the velocity, if they do, with the part that has it.
    fn smooth_sign(&self) -> Option<(Expr, Expr)> {
        let symbol = |s: &str| self.symbols.get(s).map(|q| q.expression.clone());
        let mut forms = SIGNS[1..].iter().filter_map(|form| pattern::prepare(form, symbol));
        forms.find_map(|form| {
            let part = self.context.iter().find_map(|e| pattern::part(&form, e))?;
            Some((form, part))
        })
    }

    /// An equation with the smoothed sign of the velocity replaced: three times as sharp, or one that sticks. As it is where it holds none.
    pub(crate) fn sharpened(&self, equation: &Expr, sticks: bool) -> Expr {
        let (Some((form, _)), Some(v)) = (self.smooth_sign(), self.quantity("v").map(|q| &q.expression)) else {
            return equation.clone();
        };
        pattern::replaced(&form, equation, &|part| {
            if sticks {
                (v.clone().sign() * reach(&form)).simplified()
            } else {
                part.replace(v, &(Expr::Number(3.0) * v.clone()))
            }
        })
    }

    /// The symbol that multiplies, alone, something of one of these forms in the equations here.
    pub(crate) fn size_beside(&self, forms: &[&str]) -> Option<&str> {
        let symbol = |s: &str| self.symbols.get(s).map(|q| q.expression.clone());
        let prepared = forms.iter().filter_map(|form| pattern::prepare(form, symbol));
        prepared.into_iter().find_map(|form| self.context.iter().find_map(|e| pattern::size_of(&form, e)))
    }

    /// Whether the displacement's rate is the velocity, but for a number: what depends on it is then an energy over the same coordinate.
    pub(crate) fn has_own_coordinate(&self) -> bool {
        let scaled = self.quantity("v").filter(|_| self.has(OWN_VELOCITY));
        scaled.is_none_or(|v| v.expression.symbols().iter().filter(|s| *s != "pi").count() == 1)
    }

    /// The share of attached flow, or of separated flow, that the equations here have as a function of the angle.
    pub(crate) fn separation(&self) -> Option<Expr> {
        let Some(Quantity { expression: Expr::Symbol(x), .. }) = self.symbols.get("x") else { return None };
        self.context.iter().find_map(|e| pattern::step_in(e, x))
    }

    /// Whether what leaves this store by its own outflow arrives in another one.
    pub(crate) fn feeds_another(&self) -> bool {
        self.feeds
    }

    /// Whether the equations here contain a square root of an expression that uses this symbol.
    pub(crate) fn shows_root(&self, symbol: &str) -> bool {
        let Some(quantity) = self.symbols.get(symbol) else { return false };
        let used = quantity.expression.symbols();
        self.context.iter().flat_map(pattern::roots).any(|root| used.iter().any(|s| root.uses(s)))
    }
}
