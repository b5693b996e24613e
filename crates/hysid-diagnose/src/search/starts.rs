//! Where the fit of an effect begins: points of its grid, beside the parameters that the simulation has by then or that the user gave.

use hysid_plant::Simulation;

use super::candidate::{Candidate, Point};
use super::screen::with_added_starts;
use crate::budget::Step;
use crate::calibration::global::calibrated_copy;
use crate::calibration::unfold::calibrated_unfolded;
use crate::mechanism::mechanism;
use crate::model::Values;
use crate::model::hypothesis::{Hypothesis, Setting};
use crate::slot::Place;

/// Points of a shape grid that a refit starts from.
const MOST_POINTS: usize = 3;

/// Starts of a refit: the best point of the grid, as strong as the screening would have it where its strength is in its shapes, the next best points that
/// are no neighbours of each other, and gentler ones.
pub fn starts(candidate: &Candidate) -> Vec<Vec<(String, f64)>> {
    let named = |point: &Point| -> Vec<(String, f64)> {
        let mut values = point.shapes.clone();
        for (name, amplitude) in &point.amplitudes {
            values.push((name.clone(), *amplitude));
        }
        values
    };
    let mut out: Vec<Vec<(String, f64)>> = Vec::new();
    let Some(best) = candidate.points.first() else { return out };
    out.push(named(best));
    let weight = best.amplitudes.first().map_or(1.0, |a| a.1);
    out.extend(weakened(candidate, &best.shapes, weight));
    let far = |a: &[(String, f64)], b: &[(String, f64)]| {
        a.iter().zip(b).any(|((_, x), (_, y))| (x - y).abs() > 0.6 * x.abs().max(y.abs()))
    };
    let mut apart = vec![best];
    for p in &candidate.points[1..] {
        if apart.len() < MOST_POINTS && apart.iter().all(|q| far(&p.shapes, &q.shapes)) {
            apart.push(p);
            out.push(named(p));
        }
    }
    let beside_its_own =
        candidate.mechanism.contains.iter().any(|id| mechanism(id).is_some_and(|m| m.is_in(&candidate.slot)));
    let amplitudes = candidate.refit.amplitudes.as_slice();
    if let Some(last) = amplitudes.last().filter(|_| amplitudes.len() > 1 || beside_its_own) {
        // Beside another, or beside one that the simulation has, the last amplitude may have the wrong sign at zero, where friction that sticks is
        // nothing like its derivative.
        let mut turned = named(best);
        turned.iter_mut().filter(|(name, _)| *name == last.name).for_each(|(_, value)| *value = -*value);
        out.push(turned);
    }
    out.extend(weakened(candidate, &best.shapes, weight.clamp(0.05, 1.0).sqrt()));
    out
}

/// Least share of a shape's way from its neutral value that a weak effect begins at.
const WEAKEST: f64 = 0.01;

/// Whether a law has no amplitude and its strength is in its shapes.
pub fn strength_in_shapes(candidate: &Candidate) -> bool {
    candidate.refit.amplitudes.is_empty() && !candidate.refit.neutral.is_empty()
}

/// Whether a law is written into a loop that the simulation has. A loop that had to follow another shape is bent so far that near it the law explains next to
/// nothing: neither its score nor its first start tells how well it would do.
pub fn is_in_a_loop(candidate: &Candidate) -> bool {
    candidate.slot.place == Place::Loop
}

/// Shapes of a law that has no amplitude, so that its strength is in them, at a share of their way from where the law does nothing; `None` for other
/// laws.
pub fn weakened(candidate: &Candidate, shapes: &[(String, f64)], share: f64) -> Option<Vec<(String, f64)>> {
    if !strength_in_shapes(candidate) {
        return None;
    }
    let neutral = &candidate.refit.neutral;
    let neutral = |name: &str| neutral.iter().find(|(n, _)| n == name).map_or(0.0, |(_, v)| *v);
    let share = share.clamp(WEAKEST, 1.0);
    Some(shapes.iter().map(|(n, v)| (n.clone(), neutral(n) + share * (v - neutral(n)))).collect())
}

/// The values with the candidate in the place of what the simulation has of the same: its first amplitude takes the size, at the point that explains
/// most and at the shortest shape of the grid, which at amplitude zero beside the other looks like nothing.
fn in_place(candidate: &Candidate, values: &Values) -> Vec<Values> {
    let document = &candidate.refit.simulation;
    let (Some(own), Some(amplitude)) =
        (candidate.mechanism.stands_for(&candidate.slot), candidate.refit.amplitudes.first())
    else {
        return Vec::new();
    };
    let (Some(size), true) = (values.parameters.get(own).copied(), document.parameter(own).is_some_and(|p| !p.fixed))
    else {
        return Vec::new();
    };
    let Some(best) = candidate.points.first() else { return Vec::new() };
    let shortest = |name: &str| candidate.refit.shapes.iter().find(|s| s.name == name).and_then(|s| s.grid.first());
    let least: Vec<(String, f64)> =
        best.shapes.iter().map(|(n, v)| (n.clone(), shortest(n).copied().unwrap_or(*v))).collect();
    let begun = |shapes: &[(String, f64)]| {
        let mut from = values.clone();
        shapes.iter().for_each(|(name, x)| set(&mut from, document, name, *x));
        set(&mut from, document, own, 0.0);
        set(&mut from, document, &amplitude.name, size);
        from
    };
    if least == best.shapes { vec![begun(&least)] } else { vec![begun(&best.shapes), begun(&least)] }
}

/// Sets a start value of a parameter that the document has, within its bounds.
pub fn set(values: &mut Values, document: &Simulation, name: &str, x: f64) {
    if let Some(p) = document.parameter(name) {
        values.parameters.insert(name.to_owned(), x.clamp(p.lower(), p.upper()));
    }
}

/// The parent's values with each of the candidate's starts; the last one has the simulation's parameters as the user gave them where the
/// parent has no effect yet, and the one before it comes from a global calibration where the parent is far off and the law has no amplitude.
pub fn starting_values(setting: &Setting<'_>, parent: &Hypothesis<'_>, candidate: &Candidate) -> Vec<Values> {
    let document = &candidate.refit.simulation;
    let values =
        with_added_starts(&parent.base.values(), &candidate.refit, &candidate.slot, setting.data.stretches.len());
    let with = |values: &Values, start: Vec<(String, f64)>| {
        let mut from = values.clone();
        start.iter().for_each(|(name, x)| set(&mut from, document, name, *x));
        from
    };
    let starts = starts(candidate);
    let mut out: Vec<Values> = starts.iter().map(|s| with(&values, s.clone())).collect();
    out.extend(in_place(candidate, &values));
    if parent.effects.is_empty()
        && let Some(best) = starts.into_iter().next()
    {
        let mut own = values.clone();
        for p in setting.original.parameters.iter().filter(|p| !p.fixed) {
            own.parameters.insert(p.name.clone(), p.value);
        }
        let own = with(&own, best);
        // A law with amplitudes begins beside the simulation as it is; one without them is there or not, and may stand far from it.
        if candidate.refit.amplitudes.is_empty() && parent.base.far() && !setting.budget.omits(Step::Fits) {
            let mut document = document.clone();
            for p in &mut document.parameters {
                p.value = own.parameters.get(&p.name).copied().unwrap_or(p.value);
            }
            let restored = calibrated_unfolded(&setting.original, &document, setting.data);
            if let Some(found) = restored.or_else(|| calibrated_copy(&document, setting.data, 1).map(|c| c.0)) {
                let mut global = own.clone();
                global.parameters.extend(found.parameters.iter().map(|p| (p.name.clone(), p.value)));
                out.push(global);
            }
        }
        out.push(own);
    }
    out
}

#[cfg(test)]
mod tests {
    use hysid_plant::Simulation;

    use super::*;
    use crate::budget::Budget;
    use crate::evidence::quantile;
    use crate::model::base::NoiseKind;
    use crate::model::hypothesis::{calibrated, recorded};
    use crate::oscillator::{BASELINE, PERIOD, REAL, drive, normal, respond, rms};
    use crate::search::screen::screen;

    /// A gap in the spring far below the least of the grid: the grid's best point is several times too wide, the second start is not.
    #[test]
    fn a_law_whose_strength_is_in_its_shapes_begins_second_as_weak_as_the_screening_has_it() {
        let original = Simulation::parse(BASELINE, "test.sim.toml").unwrap();
        let mut random = normal(6);
        let u = drive(900, &mut random);
        let mut reach: Vec<f64> = respond(&u, REAL, |_, _| 0.0).into_iter().map(f64::abs).collect();
        reach.sort_by(f64::total_cmp);
        let gap = 0.3 * quantile(&reach, 0.1).unwrap();
        let mut y = respond(&u, REAL, |x, _| -REAL.2 * x.clamp(-gap, gap));
        let noise = 1e-3 * rms(&y);
        y.iter_mut().for_each(|y| *y += noise * random());
        let data = recorded(&original, PERIOD, [("u_N", u), ("x_m", y)]);
        let budget = Budget::new(&|_| false);
        let (setting, none) = calibrated(original, &data, NoiseKind::White(1.0), &budget);
        let found =
            screen(&none.base, &setting.original, &[], &none.base.evidence(), &|m, _| m.id == "spring_clearance");
        let starts = starts(&found[0]);
        let begun = |i: usize| starts[i][0].1 / gap;
        assert!(begun(0) > 2.0 && (0.5..1.6).contains(&begun(1)), "{} and {} times the gap", begun(0), begun(1));
    }
}
