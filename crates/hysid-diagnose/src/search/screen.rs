//! Screening: every mechanism at every slot, as a column in the evidence space of a calibrated simulation.
//!
//! A mechanism's feature is the derivative of the rewritten simulation's output by its amplitudes, at amplitude zero, for each point of its
//! shape grid. The derivatives come from the same forward differentiation that calibrates the simulation, so a feature costs one run.

use std::collections::BTreeMap;

use hysid_plant::{Expr, Simulation};
use rayon::prelude::*;

use super::candidate::{Candidate, Columns, Point};
use super::peaks::residual_peaks;
use super::ripple::residual_periods;
use crate::evidence::{FeatureGroup, Projector, norm2, score};
use crate::mechanism::{Family, Mechanism, Purpose, Rewritten, Signals, catalogue};
use crate::model::base::Base;
use crate::model::hypothesis::Effect;
use crate::model::{Model, Values, along};
use crate::slot::{Slot, Structure, only_parameters};

/// Points of a candidate, the best, whose columns are kept for pairs beside those of the mismatch test.
pub const JOINT: usize = 2;
/// Points of a candidate whose columns take part in the mismatch test: at least, and at most as the rows allow (the columns are held in memory).
/// A resonance between two of a few points shows in none of them.
const KEPT: (usize, usize) = (4, 24);
/// Rows in all points of a candidate together.
const KEPT_ROWS: usize = 200_000;

/// Points of a candidate whose columns take part in the mismatch test.
fn kept(rows: usize) -> usize {
    (KEPT_ROWS / rows.max(1)).clamp(KEPT.0, KEPT.1)
}

/// Points of a shape grid that are simulated together.
const TOGETHER: usize = 8;

/// What is known of the signals at each slot; `periods` and `read` ([`crate::data::DataSet::read_in_steps`]) matter to ripples only.
fn signals(
    base: &Base<'_>,
    structure: &Structure,
    peaks_hz: &[f64],
    periods: &[Vec<f64>],
    read: &[(String, f64)],
) -> Vec<Option<Signals>> {
    let data = base.model.data();
    let simulation = base.model.simulation();
    let mut expressions: Vec<Expr> = Vec::new();
    let mut place = BTreeMap::new();
    for slot in &structure.slots {
        for (_, quantity) in slot.symbols() {
            let text = quantity.expression.to_string();
            place.entry(text).or_insert_with(|| {
                expressions.push(quantity.expression.clone());
                expressions.len() - 1
            });
        }
    }
    let Some(series) = along(base, &expressions) else {
        return vec![None; structure.slots.len()];
    };
    let mut stretches = Vec::new();
    let mut from = 0;
    for s in &data.stretches {
        stretches.push(from..from + s.len());
        from += s.len();
    }
    let start_s = data.longest().map_or(0.0, |at| data.stretches[at].start_s);
    structure
        .slots
        .iter()
        .enumerate()
        .map(|(i, slot)| {
            let mut moving = BTreeMap::new();
            let mut constants = BTreeMap::new();
            for (symbol, quantity) in slot.symbols() {
                let all: Vec<f64> = series.get(*place.get(&quantity.expression.to_string())?)?.concat();
                if only_parameters(simulation, &quantity.expression) {
                    constants.insert(symbol.to_owned(), *all.first()?);
                } else {
                    moving.insert(symbol.to_owned(), all);
                }
            }
            let mut signals = Signals::new(data.period_s, start_s, moving).held(simulation.time.hold);
            signals.stretches.clone_from(&stretches);
            signals.constants = constants;
            signals.peaks_hz = peaks_hz.to_vec();
            signals.periods = periods.get(i).cloned().unwrap_or_default();
            let over = slot.coordinate().and_then(|x| slot.quantity(x)).map(|q| q.expression.to_string());
            let shortest = read.iter().filter(|(state, _)| over.as_ref() == Some(state)).map(|(_, shortest)| *shortest);
            signals.shortest_period = shortest.fold(0.0, f64::max);
            let output =
                slot.label.strip_prefix("output:").and_then(|c| simulation.outputs.iter().position(|o| o.column == c));
            if let Some(o) = output {
                signals.measure(Some(data.stretches.iter().flat_map(|s| s.outputs[o].iter().copied()).collect()));
            }
            Some(signals)
        })
        .collect()
}

/// Everything in the catalogue that can be missing in this simulation, with its columns, best score first.
///
/// `original` is the user's simulation: slots are those of it, with what stands there now. What looks as if a slot had it already is a
/// candidate still where it looks so by an effect of another family among `effects`.
pub fn screen(
    base: &Base<'_>,
    original: &Simulation,
    effects: &[Effect],
    evidence: &(Projector, Vec<f64>),
    keep: &dyn Fn(&Mechanism, &Slot) -> bool,
) -> Vec<Candidate> {
    screen_along(base, Along::itself(base), original, effects, evidence, keep, Columns::Kept)
}

/// The motion along which features are taken: that of the simulation as it runs, or another.
#[derive(Clone, Copy)]
pub struct Along<'a> {
    /// The simulation that moves so, with further inputs and what they do.
    pub motion: &'a Base<'a>,
    /// Writes the same into a simulation with an effect.
    pub bring: &'a (dyn Fn(&mut Simulation) + Sync),
}

impl<'a> Along<'a> {
    /// The motion of the simulation as it runs.
    pub fn itself(base: &'a Base<'a>) -> Self {
        Self { motion: base, bring: &|_| {} }
    }
}

/// The same with the features, and the evidence, along a motion, and with columns or without.
pub fn screen_along(
    base: &Base<'_>,
    along: Along<'_>,
    original: &Simulation,
    effects: &[Effect],
    evidence: &(Projector, Vec<f64>),
    keep: &dyn Fn(&Mechanism, &Slot) -> bool,
    held: Columns,
) -> Vec<Candidate> {
    let (own, r) = evidence;
    let document = base.document();
    let structure = Structure::within(&document, original);
    let bare = Structure::of(original);
    let peaks = residual_peaks(along.motion);
    let ripples = || catalogue().iter().filter(|m| m.family == Family::PositionRipple);
    let looked_for = structure.slots.iter().any(|slot| ripples().any(|m| m.fits(slot) && keep(m, slot)));
    let periods = if looked_for { residual_periods(along.motion, &structure, r) } else { Vec::new() };
    let read = if looked_for { along.motion.model.data().read_in_steps(original) } else { Vec::new() };
    let at = signals(along.motion, &structure, &peaks, &periods, &read);
    let mut work: Vec<(&'static Mechanism, &Slot, &Signals)> = Vec::new();
    for mechanism in catalogue() {
        for (place, slot) in structure.slots.iter().enumerate() {
            let theirs = effects.iter().any(|e| e.slot.label == slot.label && e.mechanism.family == mechanism.family);
            let added = || !theirs && !bare.slots.iter().any(|b| b.label == slot.label && mechanism.is_in(b));
            if !mechanism.fits(slot) || (mechanism.is_in(slot) && !added()) || !keep(mechanism, slot) {
                continue;
            }
            if let Some(signals) = at[place].as_ref().filter(|s| mechanism.is_written_from(s)) {
                work.push((mechanism, &structure.slots[place], signals));
            }
        }
    }
    let values = along.motion.values();
    let total = norm2(r);
    let mut found: Vec<Candidate> = work
        .par_iter()
        .filter_map(|(mechanism, slot, signals)| {
            let screening = mechanism.rewrite(&document, slot, signals, Purpose::Screening).ok()?;
            let mut points = features(along, &screening, slot, &values, own, r, total)?;
            points.sort_by(|a, b| b.score.total_cmp(&a.score));
            let best = points.first()?;
            let purpose = mechanism.fitted_first(slot, &best.amplitudes, &best.shapes);
            let refit = mechanism.rewrite(&document, slot, signals, purpose).ok()?;
            let slot = (*slot).clone();
            let mut found = Candidate { mechanism, slot, refit, points, lacking: mechanism.lacking(signals) };
            if held == Columns::Dropped {
                found.drop_columns();
            }
            Some(found)
        })
        .collect();
    found.sort_by(|a, b| b.score().total_cmp(&a.score()));
    found
}

/// The columns of every point of a screening form.
fn features(
    along: Along<'_>,
    screening: &Rewritten,
    slot: &Slot,
    values: &Values,
    own: &Projector,
    r: &[f64],
    total: f64,
) -> Option<Vec<Point>> {
    let base = along.motion;
    let data = base.model.data();
    let starts = screening.starts();
    let mut points = Vec::new();
    // Amplitudes at zero; the shapes are values, not unknowns.
    let mut document = screening.simulation.clone();
    for shape in &screening.shapes {
        if let Some(p) = document.parameter_mut(&shape.name) {
            p.fixed = true;
        }
    }
    (along.bring)(&mut document);
    let model = Model::new(&document, data, base.model.substeps()).ok()?;
    let start = with_added_starts(values, screening, slot, data.stretches.len());
    let mut theta = model.theta(&start);
    let places: Vec<usize> = screening.amplitudes.iter().filter_map(|a| model.place_of(&a.name)).collect();
    for &p in &places {
        theta[p] = 0.0;
    }
    let every = starts.len().div_ceil(kept(data.rows()));
    let together = starts.chunks(TOGETHER).flat_map(|some| model.tangents_with(&theta, &places, some));
    for (i, (shapes, tangents)) in starts.iter().zip(together).enumerate() {
        let Some((_, columns)) = tangents else { continue };
        // The test asks what surrogates do at the same points.
        let any = shapes.iter().all(|(n, v)| !screening.shapes.iter().any(|s| s.name == *n && s.pointed.contains(v)));
        let each = if screening.apart { 1 } else { columns.len().max(1) };
        for (columns, amplitudes) in columns.chunks(each).zip(screening.amplitudes.chunks(each)) {
            let Some(group) = FeatureGroup::new(columns, &data.layout, &base.whitener, own) else { continue };
            let amplitudes =
                amplitudes.iter().map(|a| a.name.clone()).zip(group.amplitudes(r, columns.len())).collect();
            let score = score(total, group.explained(r), r.len(), group.columns.len());
            let (concealment, norm) = (group.concealment, group.norm);
            points.push(Point {
                shapes: shapes.clone(),
                group: (any && i % every == every / 2).then(|| group.clone()),
                joint: Some(group),
                concealment,
                norm,
                amplitudes,
                score,
            });
            forget_the_weakest(&mut points);
        }
    }
    (!points.is_empty()).then_some(points)
}

/// Of more points than pairs are judged by, the columns of the one that explains least: all of them together are hundreds of megabytes of a long recording.
fn forget_the_weakest(points: &mut [Point]) {
    let mut held: Vec<&mut Point> = points.iter_mut().filter(|p| p.joint.is_some()).collect();
    // Of equal ones the last.
    held.sort_by(|a, b| b.score.total_cmp(&a.score));
    held.into_iter().skip(JOINT).for_each(|p| p.joint = None);
}

/// The values with a start for each state that an effect added: where the state of the slot that it goes with starts (`x_a` with `x`).
pub fn with_added_starts(values: &Values, effect: &Rewritten, slot: &Slot, stretches: usize) -> Values {
    let mut out = values.clone();
    for name in &effect.states {
        let symbol = name.split('_').next().unwrap_or(name);
        let Some(Expr::Symbol(like)) = slot.quantity(symbol).map(|q| &q.expression) else { continue };
        for s in 0..stretches {
            if let Some(x) = values.initials.get(&(s, like.clone())) {
                out.initials.insert((s, name.clone()), *x);
            }
        }
    }
    out
}

/// A mechanism written into a document at this slot, scaled by the signals of a calibrated simulation.
pub fn rewrite_at(
    base: &Base<'_>,
    document: &Simulation,
    original: &Simulation,
    mechanism: &'static Mechanism,
    slot: &Slot,
    purpose: Purpose,
) -> Option<(Rewritten, Slot)> {
    let sizes = Structure::within(&base.document(), original);
    let ripple = mechanism.family == Family::PositionRipple;
    let read = if ripple { base.model.data().read_in_steps(original) } else { Vec::new() };
    let at = signals(base, &sizes, &residual_peaks(base), &[], &read);
    // What the simulation's numerics lack is told in words of its own.
    let known = |s: &&Slot| s.label == slot.label && mechanism.places.contains(&s.place);
    let place_in =
        |slots: &[Slot]| slots.iter().position(|s| s.is_at(slot)).or_else(|| slots.iter().position(|s| known(&s)));
    let place = place_in(&sizes.slots)?;
    let structure = Structure::within(document, original);
    let slot = structure.slots[place_in(&structure.slots)?].clone();
    let written = mechanism.rewrite(document, &slot, at[place].as_ref()?, purpose).ok()?;
    Some((written, slot))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::Budget;
    use crate::model::base::NoiseKind;
    use crate::model::hypothesis::{calibrated, recorded};
    use crate::oscillator::{BASELINE, PERIOD, REAL, drive, normal, respond, rms};
    use crate::search::rivals::short_list;

    /// Whether a sensor that is blind to the sign is tried, of a list of one, where the recording is this of the oscillator's displacement.
    fn blind_sensor_is_tried(sensor: impl Fn(f64) -> f64) -> bool {
        let original = Simulation::parse(BASELINE, "test.sim.toml").unwrap();
        let u = drive(600, &mut normal(4));
        let y = respond(&u, REAL, |x, _| 2e5 * x.powi(3)).into_iter().map(sensor).collect();
        let data = recorded(&original, PERIOD, [("u_N", u), ("x_m", y)]);
        let budget = Budget::new(&|_| false);
        let (setting, none) = calibrated(original, &data, NoiseKind::White(1.0), &budget);
        let wanted = ["rectified_output", "cubic_stiffness", "quintic_stiffness"];
        let evidence = none.base.evidence();
        let mut found = screen(&none.base, &setting.original, &[], &evidence, &|m, _| wanted.contains(&m.id));
        // However little it promises.
        found.sort_by_key(|c| c.mechanism.id == "rectified_output");
        short_list(&found, 1).iter().any(|c| c.mechanism.id == "rectified_output" && c.is_shown())
    }

    #[test]
    fn what_the_recording_shows_by_itself_is_tried() {
        assert!(blind_sensor_is_tried(f64::abs));
        assert!(!blind_sensor_is_tried(|x| x));
    }

    #[test]
    fn what_repeats_with_the_steps_of_a_converter_is_no_ripple() {
        let original = Simulation::parse(BASELINE, "test.sim.toml").unwrap();
        let u = drive(1000, &mut normal(4));
        let y = respond(&u, REAL, |_, _| 0.0);
        let q = 0.1 * rms(&y);
        // The shortest period that is tried, in steps, where the displacement is read in steps of so many.
        let shortest = |steps: f64| {
            let read = |y: &f64| if steps > 0.0 { steps * q * (y / (steps * q)).round() } else { *y };
            let data = recorded(&original, PERIOD, [("u_N", u.clone()), ("x_m", y.iter().map(read).collect())]);
            let budget = Budget::new(&|_| false);
            let (setting, none) = calibrated(original.clone(), &data, NoiseKind::White(1.0), &budget);
            let ripple = |m: &Mechanism, _: &Slot| m.id == "cogging";
            let found = screen(&none.base, &setting.original, &[], &none.base.evidence(), &ripple);
            let written = &found[0].refit;
            let bound = written.simulation.parameter(&written.shapes[0].name).unwrap().lower();
            let tried = found[0].points.iter().map(|p| p.shapes[0].1).fold(f64::INFINITY, f64::min);
            assert!(bound <= tried * (1.0 + 1e-9));
            (bound / q, tried / q)
        };
        let (bound, tried) = shortest(0.0);
        assert!(bound < 0.1 && tried < 2.0, "{bound} {tried}");
        let (bound, tried) = shortest(1.0);
        assert!((bound - 3.0).abs() < 1e-3 && (3.0..4.0).contains(&(tried * 1.001)), "{bound} {tried}");
        // Stairs are an effect.
        assert!(shortest(4.0).0 < 0.1);
    }
}
