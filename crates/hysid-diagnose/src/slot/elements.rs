//! Elements: connections whose deflection is a coordinate of the simulation, as the drift of a storey.

use hysid_plant::{BinaryOp, Expr};

use super::algebra::{linear_coefficient, quotient, unless_one};
use super::connections::{Stretch, forces_of, signed};
use super::find::Finder;
use super::motion::{Motion, force_of};
use super::{Pull, Slot, Target};

impl Finder<'_> {
    /// Connections of a simulation in relative coordinates, as the drifts of storeys: what the deflection of an element pulls with stands in the
    /// equations of several coordinates, in a term of that deflection alone.
    pub(super) fn elements(&self) -> Vec<Slot> {
        let element = |one: &Motion<'_>| {
            let x = one.x?;
            // The rate of the deflection may tell the force of its element once for each of the masses at its ends.
            let own = self.springs(one, x)?;
            let mut felt = Vec::new();
            for other in self.motions.iter().filter(|m| m.v != one.v) {
                let mut terms = self.terms_with(other, x).into_iter();
                if terms.any(|(_, t)| t.uses(other.v) || other.x.is_some_and(|x2| t.uses(x2))) {
                    return None;
                }
                let Some(springs) = self.springs(other, x) else { continue };
                if own.len() == 1 && self.lie_apart(one, other) {
                    return None;
                }
                let [there] = <[Expr; 1]>::try_from(springs).ok()?;
                felt.push((other, there));
            }
            let (other, first) = felt.first()?;
            // What cancels is the same force, in another share.
            let of = |unit: &Expr, spring: &Expr| {
                let share = quotient(spring.clone(), unit.clone());
                (!unit.symbols().iter().any(|s| share.uses(s))).then_some(share)
            };
            let told_by = |unit: &&Expr| own.iter().filter(|spring| of(unit, spring).is_some()).count();
            // The force is that of the deflection's own equation, or the one that the first of the others feels where its own holds several shares of it.
            let felt_first = -first.clone();
            let units = if own.len() > 1 { Some(&felt_first) } else { None };
            // Of several that tell as much the first, where `max_by_key` would take the last.
            let unit = units.into_iter().chain(&own).rev().max_by_key(told_by)?.clone();
            let share = |springs: &[Expr]| {
                let shares: Option<Vec<Expr>> = springs.iter().map(|spring| of(&unit, spring)).collect();
                let (negative, shares): (Vec<bool>, Vec<Expr>) = shares?.into_iter().map(signed).unzip();
                let one_way = negative.iter().all(|n| *n == negative[0]);
                let whole = shares.into_iter().reduce(|a, b| a + b)?;
                one_way.then(|| (if negative[0] { -1.0 } else { 1.0 }, unless_one(whole)))
            };
            // Another spring may be at the same coordinate: the tyre under a suspension.
            let own: Vec<Expr> = own.iter().filter(|spring| of(&unit, spring).is_some()).cloned().collect();
            let (_, lever) = share(&own).filter(|(sign, _)| *sign > 0.0)?;
            let mut pulls = vec![Pull { lever: lever.clone(), ..Pull::new(one.state, 1.0) }];
            for (other, there) in &felt {
                let (sign, lever) = share(std::slice::from_ref(there))?;
                pulls.push(Pull { lever, ..Pull::new(other.state, sign) });
            }
            let stretch = Stretch {
                x: Expr::symbol(x),
                v: one.rate(),
                symbol: x,
                lever,
                other: Some(other),
                words: format!("in {x}, which pulls at {} coordinates", pulls.len()),
            };
            let mut slot = Slot { target: Target::Derivatives(pulls), ..self.connection(one, stretch) };
            slot.offer(self.simulation, "k", (-unit).simplified());
            Some(slot)
        };
        self.motions.iter().filter_map(element).collect()
    }

    /// Whether two displacements are places, and what is between them pulls at both with one stiffness: neither is a deflection, also where the terms of their
    /// difference stand apart, as in `(-(k_1 + k_2)*x_1 + k_2*x_2)/m_1` and `(k_2*x_1 - k_2*x_2)/m_2`.
    fn lie_apart(&self, one: &Motion<'_>, other: &Motion<'_>) -> bool {
        let (Some(x1), Some(x2)) = (one.x, other.x) else { return false };
        let pull = |part: &Motion<'_>, x: &str| {
            linear_coefficient(self.simulation, force_of(self.simulation, part.derivative).0, x)
        };
        let Some(stiffness) = pull(one, x2).filter(|k| pull(other, x1).as_ref() == Some(k)) else { return false };
        let holds = |part: &Motion<'_>, x: &str| {
            let own = pull(part, x).map(|k| -k);
            own.is_some_and(|own| stiffness.terms().iter().all(|term| own.terms().contains(term)))
        };
        // The rate of a deflection tells its force once for each of the masses at its ends.
        let told_once = self.springs(other, x2).is_some_and(|own| own.len() == 1);
        told_once && holds(one, x1) && holds(other, x2)
    }

    /// The terms of the force on a part that hold a displacement, each with its sign, also those of a sum that is divided as a whole, which may hold
    /// several springs.
    fn terms_with(&self, part: &Motion<'_>, x: &str) -> Vec<(f64, Expr)> {
        let each = forces_of(self.simulation, part).flat_map(|(sign, term)| match term {
            Expr::Binary(BinaryOp::Div, sum, by) => {
                sum.terms().into_iter().map(|(own, t)| (sign * own, t.clone() / (**by).clone())).collect()
            }
            _ => vec![(sign, term.clone())],
        });
        each.filter(|(_, term)| term.uses(x)).collect()
    }

    /// What a deflection pulls with for each unit of it, in each term of the force on a part that is linear in it; `None` where there is none. Another
    /// term may be what a first effect has put there.
    pub(super) fn springs(&self, part: &Motion<'_>, x: &str) -> Option<Vec<Expr>> {
        let all: Vec<Expr> = self
            .terms_with(part, x)
            .into_iter()
            .filter_map(|(sign, term)| {
                let rate = linear_coefficient(self.simulation, &term, x)?;
                Some(if sign < 0.0 { -rate } else { rate })
            })
            .collect();
        (!all.is_empty()).then_some(all)
    }
}
