//! The slots inside a cascade: what one part passes on to the next.

use hysid_plant::Expr;

use super::algebra::{linear_coefficient, quotient};
use super::commands::followed;
use super::find::Finder;
use super::{Place, Slot, Target};

impl Finder<'_> {
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

    /// What one part of the simulation passes on to another from which nothing comes back, and the states that receive it.
    pub(super) fn cascades(&self) -> Vec<Slot> {
        let known = |name: &str| self.original.state(name).is_some();
        let mut links: Vec<(&str, Vec<String>)> = Vec::new();
        for source in self.simulation.states.iter().filter(|s| known(&s.name)) {
            let integrates =
                |name: &str| self.motions.iter().any(|m| m.v == source.name && [m.x, m.turn].contains(&Some(name)));
            // What comes back through a controller does not act upon its actuator.
            let alone = followed(self.simulation, source).is_some() && !self.moves(&source.name);
            let driven: Vec<String> = self
                .simulation
                .states
                .iter()
                .filter(|s| known(&s.name) && s.name != source.name && s.derivative.uses(&source.name))
                .filter(|s| !integrates(&s.name) && (alone || !self.reaches(&s.name, &source.name)))
                .map(|s| s.name.clone())
                .collect();
            if !driven.is_empty() {
                links.push((&source.name, driven));
            }
        }
        let mut slots = Vec::new();
        while !links.is_empty() {
            let (source, driven) = links.remove(0);
            let Some(first) = driven.first() else { continue };
            // States of the first part that enter the same equations in one proportion are one signal.
            let mut others: Option<Expr> = None;
            links.retain(|(other, into)| {
                let share = if *into == driven { self.proportion(source, other, &driven) } else { None };
                let Some(share) = share else { return true };
                let term = match share {
                    Expr::Neg(share) => -(*share * Expr::symbol(*other)).simplified(),
                    share => (share * Expr::symbol(*other)).simplified(),
                };
                others = Some(match others.take() {
                    Some(sum) => (sum + term).simplified(),
                    None => term,
                });
                false
            });
            let signal = match &others {
                Some(others) => (Expr::symbol(source) + others.clone()).simplified(),
                None => Expr::symbol(source),
            };
            let mut slot = Slot::new(
                Place::Between,
                format!("state:{first}"),
                format!("where {signal} drives {first}"),
                Target::SymbolIn(source.to_owned(), driven.clone(), others),
            );
            slot.offer(self.simulation, "u", signal);
            slot.context = self.derivatives_of(&driven);
            slots.push(slot);
        }
        slots
    }

    /// How much of the state `other` enters for each unit of `source`, where both enter the derivatives of these states linearly and in
    /// the same proportion.
    fn proportion(&self, source: &str, other: &str, states: &[String]) -> Option<Expr> {
        let mut shares = states.iter().map(|name| {
            let derivative = &self.simulation.state(name)?.derivative;
            let coefficient = |symbol: &str| linear_coefficient(self.simulation, derivative, symbol);
            Some(quotient(coefficient(other)?, coefficient(source)?))
        });
        let first = shares.next()??;
        shares.all(|s| s.as_ref() == Some(&first)).then_some(first)
    }
}
