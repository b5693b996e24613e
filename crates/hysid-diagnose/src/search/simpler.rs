//! Special cases in the place of members: a law that brings nothing beyond one that it contains gives way to it.
//!
//! Composition puts rivals in the place of the members of the best set. A set that comes near it may hold a wider law only because it was found on the way
//! of another: unequal friction that stood for friction and an offset, beside a spring that has taken over what was unequal.

use rayon::prelude::*;

use super::assemble::{Part, SKETCH, assemble, carried_on};
use super::compose::add;
use super::finer::inherited;
use crate::budget::Step;
use crate::mechanism::{Mechanism, Purpose, mechanism};
use crate::model::hypothesis::{Hypothesis, Setting};

/// Log evidence by which a set may trail the best and still have its members' special cases tried, and how many such sets there are at most.
const NEAR: (f64, usize) = (6.0, 6);

/// Adds the sets near the best with one member as the special case of its law, as far as nobody fitted them yet.
pub fn simplify<'d>(setting: &Setting<'d>, none: &Hypothesis<'d>, pool: &mut Vec<Hypothesis<'d>>) {
    let best = pool.iter().map(|h| h.log_evidence).fold(f64::NEG_INFINITY, f64::max);
    let mut near: Vec<&Hypothesis<'d>> =
        pool.iter().filter(|h| h.effects.len() > 1 && h.log_evidence > best - NEAR.0).collect();
    near.sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence));
    near.truncate(NEAR.1);
    let swaps: Vec<(&Hypothesis<'d>, usize, &'static Mechanism)> =
        near.iter().flat_map(|h| special(h).map(|(member, m)| (*h, member, m))).collect();
    let found: Vec<Hypothesis<'d>> = swaps
        .into_par_iter()
        .filter(|(set, member, special)| {
            let mut key = set.key_without(*member);
            key.push((special.id, set.effects[*member].slot.identity()));
            key.sort();
            // One that was fitted far off had come to rest somewhere else.
            pool.iter().all(|h| h.key() != key || h.log_evidence < set.log_evidence - NEAR.0)
        })
        .filter_map(|(set, member, special)| simpler(setting, none, set, member, special))
        .collect();
    found.into_iter().for_each(|h| add(pool, h));
}

/// The special cases of a set's members, with the member's place.
fn special<'h>(h: &'h Hypothesis<'_>) -> impl Iterator<Item = (usize, &'static Mechanism)> + 'h {
    h.effects.iter().enumerate().flat_map(|(i, e)| {
        let there = e.mechanism.contains.iter().filter_map(|id| mechanism(id));
        there.filter(|m| m.fits(&e.slot) && !m.is_in(&e.slot)).map(move |m| (i, m))
    })
}

/// A set with the special case of one member's law in its place, begun where the member stands.
fn simpler<'d>(
    setting: &Setting<'d>,
    none: &Hypothesis<'d>,
    set: &Hypothesis<'d>,
    member: usize,
    special: &'static Mechanism,
) -> Option<Hypothesis<'d>> {
    if setting.budget.omits(Step::Drops) {
        return None;
    }
    let values = set.base.values();
    let mut parts: Vec<Part> = set.effects.iter().map(|e| Part::of_effect(e, &values)).collect();
    let effect = &set.effects[member];
    let law = special.law_at(&effect.slot, Purpose::Refit);
    parts[member] = Part {
        mechanism: special,
        purpose: Purpose::Refit,
        values: inherited((special, &law), &vec![None; law.parameters.len()], effect, &values),
        ..Part::of_effect(effect, &values)
    };
    carried_on(setting, assemble(setting, none, &values, &parts, &set.base.whitener, SKETCH), set)
}

#[cfg(test)]
mod tests {
    use hysid_plant::Simulation;

    use super::*;
    use crate::budget::Budget;
    use crate::model::base::NoiseKind;
    use crate::model::hypothesis::{calibrated, recorded};
    use crate::oscillator::{BASELINE, PERIOD, REAL, drive, normal, respond, rms};
    use crate::search::fitting::refit;
    use crate::search::screen::screen;

    /// Friction alike in both directions beside a hardening spring, found as unequal friction: the special case takes its place, and one that is there already
    /// is not fitted again.
    #[test]
    fn unequal_friction_that_is_equal_gives_way() {
        let mut random = normal(3);
        let u = drive(900, &mut random);
        let mut y = respond(&u, REAL, |x, v| 0.3 * v.signum() + 900.0 * x * x * x);
        let noise = 0.01 * rms(&y);
        y.iter_mut().for_each(|y| *y += noise * random());
        let original = Simulation::parse(BASELINE, "test.sim.toml").unwrap();
        let data = recorded(&original, PERIOD, [("u_N", u), ("x_m", y)]);
        let budget = Budget::new(&|_| false);
        let (setting, none) = calibrated(original, &data, NoiseKind::White(1.0), &budget);
        let with = |parent: &Hypothesis<'_>, id: &str| {
            let evidence = parent.base.evidence();
            let found = screen(&parent.base, &setting.original, &parent.effects, &evidence, &|m, _| m.id == id);
            refit(&setting, parent, &found[0]).unwrap()
        };
        let wider = with(&with(&none, "asymmetric_friction"), "cubic_stiffness");
        let (key, evidence) = (wider.key(), wider.log_evidence);
        let mut pool = vec![wider];
        simplify(&setting, &none, &mut pool);
        assert_eq!(pool.len(), 2);
        let ids: Vec<&str> = pool[1].key().iter().map(|(id, _)| *id).collect();
        assert_eq!(ids, ["coulomb_friction", "cubic_stiffness"]);
        assert!(pool[1].log_evidence > evidence, "{} {evidence}", pool[1].log_evidence);
        simplify(&setting, &none, &mut pool);
        assert!(pool.len() == 2 && pool[0].key() == key);
    }
}
