//! The loops that a simulation has: states beside the motions that move with the size of a velocity, as Bouc and Wen's `z`, and plays of its inputs.

use hysid_plant::{Expr, Function, Memory, Simulation};

use super::algebra::{Factors, size};
use super::find::Finder;
use super::motion::{ForcePath, Kinematic, force_path};
use super::{Place, Pull, Slot, Target};

impl Finder<'_> {
    /// A slot in each loop of the simulation: what bends, pinches or wears it out enters its rate.
    pub(super) fn own_loops(&self) -> Vec<Slot> {
        let states = self.simulation.states.iter().filter(|s| self.original.state(&s.name).is_some());
        let loops = states.filter(|s| !self.moves(&s.name));
        loops.filter_map(|s| self.own_loop(&s.name, &s.derivative)).collect()
    }

    /// Whether a state besides the motions has a loop in this velocity.
    pub(super) fn loops(&self, v: &Expr) -> bool {
        let others = self.simulation.states.iter().filter(|s| !self.moves(&s.name));
        others.into_iter().any(|s| speed_of(&s.derivative, &s.name, |a| a == v).is_some())
    }

    /// A slot in the plays of each input that the simulation has: what widens them enters their half-widths.
    pub(super) fn own_plays(&self) -> Vec<Slot> {
        let inputs = self.simulation.inputs.iter();
        let played = inputs.filter(|i| !half_widths(self.original, &i.symbol).is_empty());
        let slot_of = |symbol: &str| {
            let target = Target::HalfWidths(symbol.to_owned());
            let mut slot = Slot::new(Place::Plays, format!("input:{symbol}"), format!("at the input {symbol}"), target);
            slot.offer(self.simulation, "u", Expr::symbol(symbol));
            slot.context = half_widths(self.simulation, symbol);
            slot
        };
        played.map(|i| slot_of(&i.symbol)).collect()
    }

    fn own_loop(&self, name: &str, derivative: &Expr) -> Option<Slot> {
        let v = speed_of(derivative, name, |a| self.is_velocity(a))?;
        let target = Target::Derivatives(vec![Pull::new(name, 1.0)]);
        let mut slot = Slot::new(Place::Loop, format!("state:{name}"), format!("in the loop of {name}"), target);
        // Where a law enters above the line it is measured by what stands there.
        let rate = match force_path(self.simulation, derivative) {
            ForcePath::Quotient(above, _) => above.clone(),
            ForcePath::Divided(below) => below.clone() * derivative.clone(),
            ForcePath::Bare => derivative.clone(),
        };
        // What drives the loop at rest in its middle.
        let free = rate.terms().into_iter().filter(|(_, term)| !term.uses(name));
        let signed = free.map(|(sign, term)| if sign < 0.0 { -term.clone() } else { term.clone() });
        let drive = signed.reduce(|a, b| a + b).unwrap_or_else(|| rate.substitute(name, &Expr::Number(0.0)));
        slot.offer(self.simulation, "z", Expr::symbol(name));
        slot.offer(self.simulation, "v", v.clone());
        slot.offer(self.simulation, "F", size(self.simulation, &rate));
        slot.offer(self.simulation, "rate", rate);
        slot.offer(self.simulation, "drive", drive.simplified());
        if let Some(x) = self.motions.iter().find(|m| v == Expr::symbol(m.v)).and_then(|m| m.x) {
            slot.offer(self.simulation, "x", Expr::symbol(x));
        }
        slot.context = vec![derivative.clone()];
        Some(slot)
    }

    fn is_velocity(&self, e: &Expr) -> bool {
        let mut rate = false;
        e.visit(&mut |e| rate |= matches!(e, Expr::Memory(Memory::Derivative, _)));
        let moving = |s: &String| {
            self.motions.iter().any(|m| m.v == *s)
                || (self.simulation.input(s).is_some() && self.kinematic_input(s) == Kinematic::Velocity)
        };
        rate || e.symbols().iter().any(moving) || self.is_rate_of_a_state(e)
    }

    /// Whether an expression is the derivative of a state but for a constant: `u - w` where `w` follows `u` with a lag.
    fn is_rate_of_a_state(&self, e: &Expr) -> bool {
        let varies = |f: &Expr| f.symbols().iter().any(|s| self.simulation.parameter(s).is_none());
        self.simulation.states.iter().any(|s| {
            let mut varying = Factors::of(s.derivative.clone()).above.into_iter().filter(varies);
            varying.next().is_some_and(|f| f == *e) && varying.next().is_none()
        })
    }
}

/// What is played and the half-width, where an expression is a play of a symbol or of what is made of it.
pub(crate) fn play_of<'e>(e: &'e Expr, symbol: &str) -> Option<(&'e Expr, &'e Expr)> {
    match e {
        Expr::Memory(Memory::Play, arguments) => match arguments.as_slice() {
            [w, half_width] if w.uses(symbol) => Some((w, half_width)),
            _ => None,
        },
        _ => None,
    }
}

/// The half-widths of the plays of a symbol.
fn half_widths(simulation: &Simulation, symbol: &str) -> Vec<Expr> {
    let mut found = Vec::new();
    for (_, equation) in simulation.expressions() {
        equation.visit(&mut |e| found.extend(play_of(e, symbol).map(|(_, half_width)| half_width.clone())));
    }
    found
}

/// The first velocity whose size the rate of a state holds, or whose sign beside that of the state: `abs(v)`, `abs(v*z)`, `sign(v*z)`.
fn speed_of(rate: &Expr, state: &str, wanted: impl Fn(&Expr) -> bool) -> Option<Expr> {
    let mut found = None;
    rate.visit(&mut |e| {
        let held = match e {
            Expr::Call(Function::Abs, a) => a.first(),
            Expr::Call(Function::Sign, a) => a.first().filter(|a| a.uses(state)),
            _ => None,
        };
        if let (Some(held), None) = (held, &found) {
            let factors = Factors::of(held.clone()).above;
            found = factors.into_iter().find(|f| !f.uses(state) && wanted(f));
        }
    });
    found
}

#[cfg(test)]
mod tests {
    use super::super::connections::tests::slots_of;
    use super::*;

    #[test]
    fn a_loop_is_a_state_that_moves_with_the_size_of_a_velocity() {
        let check = |rate: &str, expected: Option<[&str; 3]>| {
            let found =
                slots_of(Place::Loop, &[("x", "w2", "m"), ("w2", "(u - k*x - c*z2)/J", "m/s"), ("z2", rate, "-")]);
            let told = |s: &Slot| ["v", "drive", "rate"].map(|n| s.quantity(n).unwrap().expression.to_string());
            assert_eq!(found.first().map(told), expected.map(|e| e.map(str::to_owned)), "{rate}");
        };
        check("k*w2 - k*abs(w2)*z2", Some(["w2", "k*w2", "k*w2 - k*abs(w2)*z2"]));
        check("(w2 - abs(w2)*z2)/k", Some(["w2", "w2", "w2 - abs(w2)*z2"]));
        let signed = "k*w2*(1 - 0.5*abs(z2)*(sign(w2*z2) + 1))";
        check(signed, Some(["w2", "k*w2", signed]));
        check("k*w2 - k*abs(w2*z2)", Some(["w2", "k*w2", "k*w2 - k*abs(w2*z2)"]));
        check("k*w2 - c*z2", None);
        check("k*w2 - c*sign(w2)", None);
        check("k*w2 - c*abs(z2)*z2", None);
    }

    #[test]
    fn a_loop_may_follow_the_rate_of_what_lags() {
        let found =
            slots_of(Place::Loop, &[("w2", "(u - w2)/J", "V"), ("z2", "(u - w2)/J*k - c*abs((u - w2)/J)*z2", "-")]);
        let velocity = found.first().map(|s| s.quantity("v").unwrap().expression.to_string());
        assert_eq!(velocity.as_deref(), Some("u - w2"));
    }
}
