//! The slots at which something is stored: the level of a tank, a temperature, a pressure; flux, charge and current in circuits.

use hysid_plant::Expr;

use super::algebra::{linear_coefficient, quotient};
use super::find::{Finder, has_unit, is_one_of};
use super::motion::{CHARGED, force_of};
use super::pattern::roots;
use super::{Place, Pull, Slot, Target};

/// Units of electrical states.
const ELECTRICAL: &[&str] = &["Wb", "A", "C", "V"];

impl Slot {
    /// Whether what is held here is electrical, which leaves through a resistance and through no opening.
    pub(crate) fn is_electrical(&self) -> bool {
        self.holds(ELECTRICAL)
    }

    /// Whether what is held here is heat.
    pub(crate) fn is_thermal(&self) -> bool {
        self.holds(&["K"])
    }

    fn holds(&self, units: &[&str]) -> bool {
        self.quantity("s").and_then(|q| q.unit.as_ref()).is_some_and(|u| is_one_of(u, units))
    }
}

impl Finder<'_> {
    pub(super) fn store_slot(&self, place: Place, label: String, name: &str, derivative: &Expr) -> Slot {
        let target = Target::Derivatives(vec![Pull::new(name, 1.0)]);
        let whereabouts = match place {
            Place::Circuit => format!("that {name} stands for in the circuit"),
            _ => name.to_owned(),
        };
        let mut slot = Slot::new(place, label, whereabouts, target);
        slot.offer(self.simulation, "s", Expr::symbol(name));
        self.offer_force(&mut slot, derivative, Some(name), name, None);
        if self.exchanges(name, derivative) {
            slot.symbols.remove("k");
        }
        slot.context = vec![derivative.clone()];
        slot.feeds = self.feeds(name, derivative);
        slot
    }

    /// Whether all that leaves a store in proportion to what it holds comes back in proportion to what others hold that feel it, as in `c*(p_1 - p_2)`:
    /// nothing of it is lost. What follows another that does not feel it, as a filter does, holds nothing of that.
    fn exchanges(&self, name: &str, derivative: &Expr) -> bool {
        let sum = force_of(self.simulation, derivative).0;
        let of = |symbol: &str| linear_coefficient(self.simulation, sum, symbol);
        let others = self.simulation.states.iter().filter(|s| s.name != name && s.derivative.uses(name));
        let given = others.filter_map(|s| of(&s.name)).reduce(|a, b| a + b);
        let (Some(own), Some(given)) = (of(name), given) else { return false };
        let sorted = |sum: &Expr, times: f64| {
            let mut terms: Vec<String> = sum.terms().iter().map(|(sign, t)| format!("{}*{t}", times * sign)).collect();
            terms.sort_unstable();
            terms
        };
        sorted(&own, -1.0) == sorted(&given, 1.0) || quotient(-own, given) == Expr::Number(1.0)
    }

    /// Whether a root that drains a store stands in the balance of another state as well.
    fn feeds(&self, name: &str, derivative: &Expr) -> bool {
        let others: Vec<&Expr> =
            self.simulation.states.iter().filter(|s| s.name != name).map(|s| &s.derivative).collect();
        roots(derivative)
            .into_iter()
            .filter(|root| root.uses(name))
            .any(|root| others.iter().any(|e| roots(e).contains(&root)))
    }

    pub(super) fn stores(&self) -> Vec<Slot> {
        // Beside a motion a state may be a controller's or a filter's: only what has the unit of something held is a store.
        // A capacitor is one even where its charge plays the part of a displacement.
        self.held(Place::Store, |name| {
            let has = |units: &[&str]| has_unit(self.simulation.unit_of(name), units);
            let charged = || self.motions.iter().any(|m| m.x == Some(name)) && has(CHARGED);
            // What flows moves between stores of any kind.
            let only_flows = self.motions.iter().all(|m| m.flow);
            !self.moves(name) && (only_flows || has(&["Pa", "K", "m^3"])) || charged()
        })
    }

    /// The electrical states of a circuit of first order: iron that saturates draws a current as a spring that stiffens draws a force. Where the current is
    /// measured the law stands there, and acts on both.
    pub(super) fn circuits(&self) -> Vec<Slot> {
        let mut slots = self.held(Place::Circuit, |name| {
            let electrical = has_unit(self.simulation.unit_of(name), ELECTRICAL);
            self.motions.is_empty() && electrical && !self.feels_its_current(name)
        });
        for slot in &mut slots {
            if let Some(held) = slot.quantity("s").cloned() {
                slot.offer(self.simulation, "x", held.expression);
            }
        }
        slots
    }

    /// The slots of those of the user's states that hold something.
    fn held(&self, place: Place, holds: impl Fn(&str) -> bool) -> Vec<Slot> {
        if self.is_force_law() {
            return Vec::new();
        }
        let states = self.simulation.states.iter().filter(|s| self.original.state(&s.name).is_some() && holds(&s.name));
        states.map(|s| self.store_slot(place, format!("state:{}", s.name), &s.name, &s.derivative)).collect()
    }
}

#[cfg(test)]
mod tests {
    use hysid_plant::Simulation;

    use super::super::Structure;
    use super::*;

    /// The labels of the slots of a kind, of a simulation driven by a voltage with these states.
    fn labels(place: Place, states: &str) -> Vec<String> {
        let text = format!(
            "[time]\nperiod_s = 1e-4\n[inputs]\ne = \"source_V\"\n[parameters]\nR = {{ value = 2.0, min = 0.1, unit = \"ohm\" }}\n\
             L = {{ value = 0.5, min = 0.1, unit = \"H\" }}\nC = {{ value = 1e-3, min = 1e-4, unit = \"F\" }}\n[states]\n{states}[outputs]\ny = \"s\"\n"
        );
        let simulation = Simulation::parse(&text, "circuit.sim.toml").unwrap();
        let slots = Structure::of(&simulation).slots.into_iter().filter(|s| s.place == place);
        slots
            .map(|s| format!("{} {}", s.label, s.quantity("x").map_or("-".into(), |q| q.expression.to_string())))
            .collect()
    }

    #[test]
    fn what_two_stores_exchange_is_no_loss() {
        let losses = |states: &str| {
            let text = format!(
                "[time]\nperiod_s = 1.0\n[inputs]\nu = \"supply\"\n[parameters]\nV = {{ value = 2.0, min = 0.1 }}\nc = {{ value = 0.5, min = 0.1 }}\n\
                 g = {{ value = 0.3, min = 0.1 }}\n[states]\n{states}[outputs]\ny = \"a\"\n"
            );
            let slots = Structure::of(&Simulation::parse(&text, "stores.sim.toml").unwrap()).slots.into_iter();
            let stores = slots.filter(|s| s.place == Place::Store);
            stores.map(|s| s.quantity("k").map_or("-".to_owned(), |k| k.expression.to_string())).collect::<Vec<_>>()
        };
        let state = |name: &str, rate: &str| format!("{name} = {{ derivative = \"{rate}\", initial = 1.0 }}\n");
        let b = state("b", "(c*(a - b) - g*b)/V");
        assert_eq!(losses(&[state("a", "(u - c*(a - b))/V"), b.clone()].concat()), ["-", "-(-c - g)"]);
        assert_eq!(losses(&[state("a", "u/V - c/V*a + c/V*b"), b.clone()].concat()), ["-", "-(-c - g)"]);
        assert_eq!(losses(&[state("a", "c*(u - a)"), state("b", "g*(a - b)")].concat()), ["c", "g"], "a filter");
        let three = [state("a", "(u - c*(a - b) + g*(e - a))/V"), b, state("e", "g*(a - e) - c*e")].concat();
        assert_eq!(losses(&three), ["-", "-(-c - g)", "-(-g - c)"]);
    }

    #[test]
    fn a_circuit_of_first_order_has_a_law_of_its_own() {
        let flux = "s = { derivative = \"e - R*s/L\", initial = 0.0, unit = \"Wb\" }\n";
        assert_eq!(labels(Place::Circuit, flux), ["state:s s"]);
        let heat = "s = { derivative = \"0.1*(20 - s)\", initial = 0.0, unit = \"K\" }\n";
        assert!(labels(Place::Circuit, heat).is_empty());
        assert_eq!(labels(Place::Store, heat), ["state:s -"]);
        // A current that charges a capacitor is a motion, whose spring the capacitor is; what it holds may leak.
        let resonant = "i = { derivative = \"(e - R*i - s)/L\", initial = 0.0, unit = \"A\" }\ns = { derivative = \"i/C\", initial = 0.0, unit = \"V\" }\n";
        assert!(labels(Place::Circuit, resonant).is_empty());
        assert_eq!(labels(Place::Force, resonant), ["state:i s"]);
        assert_eq!(labels(Place::Store, resonant), ["state:s -"]);
    }
}
