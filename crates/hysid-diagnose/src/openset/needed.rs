//! A correction refitted in the equations, and which of its terms are needed there.
//!
//! Regression chooses terms on the tangent of the simulation as it is. Where the mismatch is large the tangent is only near, and further terms mend what one
//! that is right leaves of it; once that stands in the equations and is refitted they mend nothing, and on another recording they harm.

use hysid_plant::Simulation;

use super::Writable;
use super::written::Sparse;
use crate::model::base::Base;
use crate::search::budget::Step;
use crate::search::hypothesis::{Hypothesis, Setting};

/// A correction that was refitted in the equations.
pub struct Refitted<'d> {
    /// The simulation with it.
    pub hypothesis: Hypothesis<'d>,
    /// The terms that it needs there, with their coefficients; none for a parameter that oscillates.
    pub terms: Vec<(String, f64)>,
}

/// The correction fitted in the place of, or on top of, a set, without the terms that it does not need.
pub fn fitted<'d>(setting: &Setting<'d>, parent: &Hypothesis<'d>, writable: &Writable) -> Option<Refitted<'d>> {
    let fit = |simulation: &Simulation| {
        let (from, noise) = (parent.base.values(), Some(&parent.base.whitener));
        let base = setting.fit(simulation, &from, noise, 2, setting.iterations)?;
        Some(setting.hypothesis(parent.effects.clone(), base))
    };
    let mut sparse = match writable {
        Writable::Oscillation(simulation) => {
            return Some(Refitted { hypothesis: fit(simulation)?, terms: Vec::new() });
        }
        Writable::Sparse(sparse) => sparse.clone(),
    };
    let (simulation, mut names) = sparse.written()?;
    let mut best = fit(&simulation)?;
    while let Some((fewer, its_names, h)) = without_the_weakest(setting, &sparse, &names, &best, &fit) {
        if h.log_evidence < best.log_evidence {
            break;
        }
        (sparse, names, best) = (fewer, its_names, h);
    }
    let values = best.base.values().parameters;
    let coefficient = |names: &Vec<String>| names.first().and_then(|n| values.get(n)).copied().unwrap_or(0.0);
    let terms = sparse.texts().map(str::to_owned).zip(names.iter().map(coefficient)).collect();
    Some(Refitted { hypothesis: best, terms })
}

/// The correction without the term whose coefficient is the smallest beside its standard error.
fn without_the_weakest<'d>(
    setting: &Setting<'d>,
    sparse: &Sparse,
    names: &[Vec<String>],
    h: &Hypothesis<'d>,
    fit: &dyn Fn(&Simulation) -> Option<Hypothesis<'d>>,
) -> Option<(Sparse, Vec<Vec<String>>, Hypothesis<'d>)> {
    let certainty = certainty(&h.base, names)?;
    let weakest = (0..names.len()).min_by(|&a, &b| certainty[a].total_cmp(&certainty[b]))?;
    let values = h.base.values().parameters;
    let of_term = |names: &Vec<String>| names.iter().map(|n| values.get(n).copied()).collect::<Option<Vec<f64>>>();
    let fitted: Vec<Vec<f64>> = names.iter().map(of_term).collect::<Option<_>>()?;
    let fewer = sparse.without(weakest, &fitted)?;
    if setting.budget.omits(Step::Terms) {
        return None;
    }
    let (simulation, names) = fewer.written()?;
    let h = fit(&simulation)?;
    Some((fewer, names, h))
}

/// Each term's coefficient over the width of its interval.
fn certainty(base: &Base<'_>, names: &[Vec<String>]) -> Option<Vec<f64>> {
    let intervals = base.intervals();
    let of = |names: &Vec<String>| {
        let (_, value, low, high, _) = intervals.iter().find(|i| Some(&i.0) == names.first())?;
        Some(value.abs() / (high - low).max(f64::MIN_POSITIVE))
    };
    names.iter().map(of).collect()
}
