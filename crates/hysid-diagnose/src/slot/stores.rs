//! The slots at which something is stored: the level of a tank, a temperature, a pressure.

use hysid_plant::Expr;

use super::find::{Finder, is_one_of};
use super::pattern::roots;
use super::{Place, Pull, Slot, Target};

impl Finder<'_> {
    pub(super) fn store_slot(&self, place: Place, label: String, name: &str, derivative: &Expr) -> Slot {
        let target = Target::Derivatives(vec![Pull::new(name, 1.0)]);
        let mut slot = Slot::new(place, label, name.to_owned(), target);
        slot.offer(self.simulation, "s", Expr::symbol(name));
        self.offer_force(&mut slot, derivative, Some(name), name, None);
        slot.context = vec![derivative.clone()];
        slot.feeds = self.feeds(name, derivative);
        slot
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
        if self.is_force_law() {
            return Vec::new();
        }
        // Beside a motion a state may be a controller's or a filter's: only what has the unit of something held is a store.
        let holds = |name: &str| {
            let unit = self.simulation.unit_of(name);
            self.motions.is_empty() || (!self.moves(name) && unit.is_some_and(|u| is_one_of(&u, &["Pa", "K", "m^3"])))
        };
        let states = self.simulation.states.iter().filter(|s| self.original.state(&s.name).is_some() && holds(&s.name));
        states.map(|s| self.store_slot(Place::Store, format!("state:{}", s.name), &s.name, &s.derivative)).collect()
    }
}
