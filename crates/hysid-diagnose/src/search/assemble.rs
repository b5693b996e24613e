//! Sets of effects written into a simulation together: from parts with start values to a hypothesis, on to its end, and without one of them.

use nalgebra::{DMatrix, DVector};

use super::candidate::Candidate;
use super::finish::{finish, likelier};
use super::given_up::HOPELESS;
use super::screen::{rewrite_at, with_added_starts};
use super::starts::{set, starts, weakened};
use crate::evidence::Whitener;
use crate::mechanism::{Mechanism, Purpose};
use crate::model::Values;
use crate::model::base::Base;
use crate::model::hypothesis::{Effect, Hypothesis, Setting};
use crate::slot::Slot;

/// Iterations of [`assemble`] that tell who is hopeless.
pub const SKETCH: usize = 5;

/// An effect to be written: the mechanism, the slot, values of its parameters in the order of the law.
pub struct Part {
    /// The mechanism.
    pub mechanism: &'static Mechanism,
    /// The slot.
    pub slot: Slot,
    /// The form of its law.
    pub purpose: Purpose,
    /// Start values of amplitudes, then shapes; missing ones stay as the law has them.
    pub values: Vec<Option<f64>>,
    /// Share that the simulation's own parameters absorb, from the screening.
    pub concealment: Option<f64>,
}

impl Part {
    /// A candidate at a point of its grid, `amplitudes` as they explain the residual.
    pub fn of_candidate(candidate: &Candidate, point: usize, amplitudes: &[(String, f64)]) -> Self {
        let start = starts(candidate).into_iter().next().unwrap_or_default();
        let shapes = candidate.points.get(point).map_or(&[][..], |p| &p.shapes);
        // A pair tells how strong each of its members is.
        let weaker = amplitudes.first().and_then(|(_, weight)| weakened(candidate, shapes, *weight));
        let shapes = weaker.as_deref().unwrap_or(shapes);
        let find = |list: &[(String, f64)], name: &str| list.iter().find(|(n, _)| n == name).map(|(_, v)| *v);
        let values = candidate.refit.parameters_of();
        Self {
            mechanism: candidate.mechanism,
            slot: candidate.slot.clone(),
            purpose: candidate.refit.purpose,
            values: values
                .iter()
                .map(|n| find(amplitudes, n).or_else(|| find(shapes, n)).or_else(|| find(&start, n)))
                .collect(),
            concealment: candidate.concealment(),
        }
    }

    /// An effect of a fitted hypothesis, as it stands.
    pub fn of_effect(effect: &Effect, values: &Values) -> Self {
        Self {
            mechanism: effect.mechanism,
            slot: effect.slot.clone(),
            purpose: effect.written.purpose,
            values: effect.written.parameters_of().iter().map(|n| values.parameters.get(n).copied()).collect(),
            concealment: effect.concealment,
        }
    }
}

/// Several effects written into the simulation of `trunk` one after the other and fitted for `iterations` from these values, first under
/// this noise model.
pub fn assemble<'d>(
    setting: &Setting<'d>,
    trunk: &Hypothesis<'_>,
    own: &Values,
    parts: &[Part],
    noise: &Whitener,
    iterations: usize,
) -> Option<Hypothesis<'d>> {
    let mut document = trunk.base.document();
    let mut values = own.clone();
    let mut effects = trunk.effects.clone();
    for part in parts {
        let (written, slot) =
            rewrite_at(&trunk.base, &document, &setting.original, part.mechanism, &part.slot, part.purpose)?;
        values = with_added_starts(&values, &written, &slot, setting.data.stretches.len());
        for (name, x) in written.parameters_of().iter().zip(&part.values) {
            if let Some(x) = x {
                set(&mut values, &written.simulation, name, *x);
            }
        }
        document = written.simulation.clone();
        effects.push(Effect { mechanism: part.mechanism, slot, written, concealment: part.concealment });
    }
    let base = setting.fit(&document, &values, Some(noise), 1, iterations)?;
    Some(setting.hypothesis(effects, base))
}

/// Goes on with a hypothesis that was fitted for a few iterations only.
pub fn complete<'d>(setting: &Setting<'d>, mut h: Hypothesis<'d>) -> Hypothesis<'d> {
    if let Some(base) = likelier(&h.base, setting.further(&h.base, Some(&h.base.whitener), 2, setting.iterations)) {
        h.base = base;
    }
    finish(setting, &mut h, 0);
    h
}

/// The likeliest of some sketches of a set, fitted to the end unless it trails what it stands `beside` hopelessly.
pub fn carried_on<'d>(
    setting: &Setting<'d>,
    sketches: impl IntoIterator<Item = Hypothesis<'d>>,
    beside: &Hypothesis<'_>,
) -> Option<Hypothesis<'d>> {
    let h = sketches.into_iter().max_by(|a, b| a.log_evidence.total_cmp(&b.log_evidence))?;
    let near = h.log_evidence > beside.log_evidence - HOPELESS;
    Some(if near { complete(setting, h) } else { h })
}

/// Squared amplitude of a member, over its variance, up to which the others are moved to where they come without it.
const HARDLY_TOLD: f64 = 25.0;

/// The values of a set beside nothing of a member: as they are, or, where the recording hardly tells its amplitudes from nothing, moved to where the others come,
/// to first order, when these are held at nothing (the mean of a normal law under that condition). A stop that is a part of the stiffness behind a
/// clearance gives its share back, for which no fit finds the way where impacts make the error rough.
fn beside_nothing_of(set: &Hypothesis<'_>, member: usize) -> Values {
    let Base { model, fit, whitener, .. } = &set.base;
    let amplitudes = set.effects[member].written.amplitudes.iter();
    let places: Vec<usize> = amplitudes.filter_map(|a| model.place_of(&a.name)).collect();
    let k = fit.theta.len();
    let covariance = DMatrix::from_vec(k, k, fit.covariance(&model.data().layout, whitener, None, 1.0));
    let theta = DVector::from_column_slice(&fit.theta);
    let own = covariance.select_rows(&places).select_columns(&places).cholesky();
    let moved = own.filter(|_| !places.is_empty()).and_then(|own| {
        let amplitudes = theta.select_rows(&places);
        let told = own.solve(&amplitudes);
        (amplitudes.dot(&told) < HARDLY_TOLD).then(|| &theta - covariance.select_columns(&places) * told)
    });
    model.values(moved.unwrap_or(theta).as_slice())
}

/// The set without its `index`-th effect: the others are written anew in their order and fitted from where they were, or are without it.
pub fn without<'d>(
    setting: &Setting<'d>,
    none: &Hypothesis<'d>,
    set: &Hypothesis<'d>,
    index: usize,
) -> Option<Hypothesis<'d>> {
    let values = beside_nothing_of(set, index);
    let rest: Vec<Part> = (set.effects.iter().enumerate())
        .filter(|(i, _)| *i != index)
        .map(|(_, e)| Part::of_effect(e, &values))
        .collect();
    if rest.is_empty() {
        return None;
    }
    assemble(setting, none, &values, &rest, &none.base.whitener, setting.iterations).map(|h| complete(setting, h))
}

#[cfg(test)]
pub(crate) mod tests {
    use hysid_plant::{Compiled, Drive, Run, Simulation};

    use super::*;
    use crate::budget::Budget;
    use crate::model::base::NoiseKind;
    use crate::model::hypothesis::{calibrated, recorded};
    use crate::oscillator::{BASELINE, REAL, drive, normal, respond, rms};
    use crate::search::fitting::refit;
    use crate::search::screen::screen;
    use crate::slot::Place;

    const PERIOD: f64 = 0.02;

    #[test]
    fn what_is_hardly_told_gives_its_share_back_to_the_others() {
        let original = Simulation::parse(BASELINE, "test.sim.toml").unwrap();
        let check = |cubic: f64, moves: bool| {
            let mut random = normal(4);
            let u = drive(900, &mut random);
            let mut y = respond(&u, REAL, |x, _| cubic * x.powi(3));
            let noise = 0.3 * rms(&y);
            y.iter_mut().for_each(|y| *y += noise * random());
            let data = recorded(&original, PERIOD, [("u_N", u), ("x_m", y)]);
            let budget = Budget::new(&|_| false);
            let (setting, none) = calibrated(original.clone(), &data, NoiseKind::White(1.0), &budget);
            let evidence = none.base.evidence();
            let found = screen(&none.base, &original, &[], &evidence, &|m, _| m.id == "cubic_stiffness");
            let set = refit(&setting, &none, &found[0]).unwrap();
            let k = |values: Values| values.parameters["k"];
            let (alone, beside, moved) = (k(none.base.values()), k(set.base.values()), k(beside_nothing_of(&set, 0)));
            let off = (moved - alone).abs() / (beside - alone).abs();
            assert!(if moves { off < 0.5 } else { moved == beside }, "{cubic}: {alone} {beside} {moved}");
        };
        check(10.0, true);
        check(9000.0, false);
    }

    /// Cubic springs at every place of two masses in which nothing is missing, as they were found and as sets that were hardly fitted.
    pub fn with_springs_of_two_masses(check: impl FnOnce(&[Candidate], Vec<Hypothesis<'_>>)) {
        let text = include_str!("../mechanism/specimens/two_masses.sim.toml");
        let original = Simulation::parse(text, "two_masses.sim.toml").unwrap();
        let mut random = normal(8);
        let u = drive(600, &mut random);
        let compiled = Compiled::new(&original).unwrap();
        let run = Drive::new(0.0, PERIOD, u.len(), vec![u.clone()]).unwrap();
        let outputs = compiled.simulate(&Run::new(&run, &compiled.theta())).outputs;
        let mut columns = vec![(original.inputs[0].column.as_str(), u)];
        for (output, y) in original.outputs.iter().zip(outputs) {
            let size = crate::oscillator::rms(&y);
            columns.push((output.column.as_str(), y.into_iter().map(|y| y + 0.01 * size * random()).collect()));
        }
        let columns: [_; 3] = columns.try_into().unwrap();
        let data = recorded(&original, PERIOD, columns);
        let budget = Budget::new(&|_| false);
        let (setting, none) = calibrated(original.clone(), &data, NoiseKind::White(1.0), &budget);
        let found =
            screen(&none.base, &setting.original, &[], &none.base.evidence(), &|m, _| m.id == "cubic_stiffness");
        let written = |c: &Candidate| {
            let part = Part::of_candidate(c, 0, &[]);
            assemble(&setting, &none, &none.base.values(), &[part], &none.base.whitener, 1).unwrap()
        };
        let sets = found.iter().map(written).collect();
        check(&found, sets);
    }

    /// A spring to the ground and one between two masses have one label: they are two statements, and each is written where it was found.
    #[test]
    fn an_effect_is_written_anew_where_it_stands() {
        with_springs_of_two_masses(|found, sets| {
            let places: Vec<Place> = found.iter().map(|c| c.slot.place).collect();
            assert!(places.contains(&Place::Force) && places.contains(&Place::Connection), "{places:?}");
            let alike = |a: &Candidate, b: &Candidate| a.slot.label == b.slot.label;
            let mut pairs = found.iter().enumerate().flat_map(|(i, a)| found[..i].iter().map(move |b| (a, b)));
            assert!(pairs.clone().any(|(a, b)| alike(a, b)) && pairs.all(|(a, b)| a.key() != b.key()));
            for (c, set) in found.iter().zip(&sets) {
                assert!(set.effects[0].slot.is_at(&c.slot), "{} {}", c.slot.label, c.slot.whereabouts);
                assert_eq!(set.effects[0].written.simulation, c.refit.simulation);
            }
        });
    }
}
