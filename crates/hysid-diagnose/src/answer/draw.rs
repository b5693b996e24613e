//! Fills a [`Picture`]: the series that a report draws, read off the fitted simulations. Nothing is decided here.

use hysid_plant::{Expr, Simulation, Unit};
use hysid_signal::power_spectrum;

use super::picture::{LawPicture, MapPicture, ParameterPicture, Picture, RecordPicture, Role, SpectrumPicture};
use crate::data::DataSet;
use crate::evidence::quantile;
use crate::mechanism::Block;
use crate::model::along;
use crate::model::base::Interval;
use crate::model::hold::FreeRun;
use crate::model::hypothesis::Hypothesis;
use crate::slot::Structure;

/// Cells of a map along each axis.
const CELLS: usize = 12;
/// Samples that a cell must have to be shown.
const LEAST_IN_CELL: usize = 3;
/// Longest segment of a spectrum.
const SEGMENT: usize = 2048;

/// What the picture is made from.
pub(crate) struct Sitting<'a, 'd> {
    /// The user's simulation.
    pub simulation: &'a Simulation,
    /// The estimation data that the fits rest on.
    pub data: &'a DataSet,
    /// The recalibrated simulation.
    pub none: &'a Hypothesis<'d>,
    /// The winning hypothesis; the same as `none` where nothing was found.
    pub best: &'a Hypothesis<'d>,
    /// The hold-out.
    pub held: &'a DataSet,
    /// Free runs on the hold-out.
    pub before: Option<&'a FreeRun>,
    /// The same of the augmented simulation.
    pub after: Option<&'a FreeRun>,
    /// Noise of each output.
    pub noise: &'a [f64],
}

/// The picture of a diagnosis.
pub(crate) fn picture(s: &Sitting<'_, '_>) -> Picture {
    let found = !std::ptr::eq(s.none, s.best);
    let (first, second) = (s.none.base.prediction(), found.then(|| s.best.base.prediction()));
    let mut records = records(s, s.data, Role::Estimation, Some(&first), second.as_deref(), None);
    let (before, after) = (s.before.map(|r| r.prediction.as_slice()), s.after.map(|r| r.prediction.as_slice()));
    let scored: Vec<bool> = (0..s.held.rows())
        .map(|row| s.before.is_none_or(|r| r.scored[row]) && s.after.is_none_or(|r| r.scored[row]))
        .collect();
    records.extend(self::records(s, s.held, Role::HoldOut, before, after, Some(&scored)));
    Picture {
        title: s.simulation.title.clone(),
        records,
        maps: maps(s, found),
        spectra: spectra(s, found),
        laws: laws(s),
        parameters: parameters(s, found),
    }
}

fn unit_of(column: &str) -> String {
    Unit::of_column(column).map(|unit| unit.to_string()).unwrap_or_default()
}

/// One entry for each stretch and output; gaps are `NaN`.
fn records(
    s: &Sitting<'_, '_>,
    data: &DataSet,
    role: Role,
    before: Option<&[f64]>,
    after: Option<&[f64]>,
    scored: Option<&[bool]>,
) -> Vec<RecordPicture> {
    let mut out = Vec::new();
    for (recording, name) in data.recordings.iter().enumerate() {
        for (o, output) in s.simulation.outputs.iter().enumerate() {
            let mine =
                data.layout.series.iter().filter(|x| x.output == o && data.stretches[x.stretch].recording == recording);
            let mut picture = RecordPicture {
                recording: name.clone(),
                output: output.column.clone(),
                unit: unit_of(&output.column),
                role,
                place: recording,
                samples: Vec::new(),
                scored: Vec::new(),
                time_s: Vec::new(),
                measured: Vec::new(),
                before: Vec::new(),
                after: after.map(|_| Vec::new()),
                noise_rms: s.noise.get(o).copied().unwrap_or(0.0),
                every: data.step,
            };
            for series in mine {
                if let (Some(&time), Some(&sample)) = (picture.time_s.last(), picture.samples.last()) {
                    // A break in the lines where samples are missing.
                    picture.time_s.push(time);
                    picture.samples.push(sample);
                    picture.scored.push(false);
                    picture.measured.push(f64::NAN);
                    picture.before.push(f64::NAN);
                    picture.after.iter_mut().for_each(|a| a.push(f64::NAN));
                }
                picture.time_s.extend(data.time_of_rows(series));
                let first = data.stretches[series.stretch].samples.start + series.first;
                picture.samples.extend((0..series.rows.len()).map(|n| first + n * data.step));
                match scored {
                    Some(scored) => picture.scored.extend_from_slice(&scored[series.rows.clone()]),
                    None => picture.scored.resize(picture.time_s.len(), false),
                }
                picture.measured.extend_from_slice(&data.y[series.rows.clone()]);
                match before {
                    Some(b) => picture.before.extend_from_slice(&b[series.rows.clone()]),
                    None => picture.before.resize(picture.time_s.len(), f64::NAN),
                }
                if let (Some(to), Some(a)) = (&mut picture.after, after) {
                    to.extend_from_slice(&a[series.rows.clone()]);
                }
            }
            if !picture.time_s.is_empty() {
                out.push(picture);
            }
        }
    }
    out
}

/// The quantities that span the operating region: displacement and velocity where there are any, else the input and its rate.
fn axes(s: &Sitting<'_, '_>) -> Option<[(String, Expr); 2]> {
    let label = |name: &str, unit: String| if unit.is_empty() { name.to_owned() } else { format!("{name} ({unit})") };
    let structure = Structure::of(s.simulation);
    let slots = s.best.effects.iter().map(|e| &e.slot).chain(&structure.slots);
    for slot in slots {
        if let (Some(x), Some(v)) = (slot.quantity("x"), slot.quantity("v")) {
            let name = |q: &crate::slot::Quantity| {
                label(&q.expression.to_string(), q.unit.as_ref().map(ToString::to_string).unwrap_or_default())
            };
            return Some([(name(x), x.expression.clone()), (name(v), v.expression.clone())]);
        }
    }
    let u = s.simulation.inputs.first()?;
    let rate = Expr::parse(&format!("d({})", u.symbol)).ok()?;
    Some([(u.column.clone(), Expr::symbol(&u.symbol)), (format!("rate of {} (per s)", u.column), rate)])
}

/// Inner quantiles of a series as equally wide cells.
fn edges(values: &[f64]) -> Option<Vec<f64>> {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let (low, high) = (quantile(&sorted, 0.005)?, quantile(&sorted, 0.995)?);
    let edges: Vec<f64> = (0..=CELLS).map(|i| low + (high - low) * i as f64 / CELLS as f64).collect();
    edges.windows(2).all(|w| w[0] < w[1]).then_some(edges)
}

fn maps(s: &Sitting<'_, '_>, found: bool) -> Vec<MapPicture> {
    let Some([(x_label, x), (y_label, y)]) = axes(s) else { return Vec::new() };
    let Some(series) = along(&s.none.base, &[x, y]) else { return Vec::new() };
    let layout = &s.data.layout;
    let mut out = Vec::new();
    for (o, output) in s.simulation.outputs.iter().enumerate() {
        let noise = s.noise.get(o).copied().filter(|n| *n > 0.0).unwrap_or(1.0);
        let mut points = Vec::new();
        for part in layout.series.iter().filter(|p| p.output == o) {
            for (n, row) in part.rows.clone().enumerate() {
                let at = |axis: usize| {
                    series[axis][part.stretch].get(part.first + n * s.data.step).copied().unwrap_or(f64::NAN)
                };
                points.push((at(0), at(1), row));
            }
        }
        let column = |f: fn(&(f64, f64, usize)) -> f64| points.iter().map(f).collect::<Vec<f64>>();
        let (Some(x_edges), Some(y_edges)) = (edges(&column(|p| p.0)), edges(&column(|p| p.1))) else { continue };
        let mean = |residual: &[f64]| -> Vec<f64> {
            let mut cells = vec![(0.0, 0usize); CELLS * CELLS];
            let place = |edges: &[f64], v: f64| {
                let i = edges.partition_point(|e| *e <= v);
                (1..=CELLS).contains(&i).then(|| i - 1)
            };
            for &(x, y, row) in &points {
                if let (Some(c), Some(r)) = (place(&x_edges, x), place(&y_edges, y)) {
                    cells[r * CELLS + c].0 += residual[row] / noise;
                    cells[r * CELLS + c].1 += 1;
                }
            }
            cells.into_iter().map(|(sum, n)| if n < LEAST_IN_CELL { f64::NAN } else { sum / n as f64 }).collect()
        };
        out.push(MapPicture {
            output: output.column.clone(),
            x_label: x_label.clone(),
            y_label: y_label.clone(),
            before: mean(&s.none.base.fit.residual),
            after: found.then(|| mean(&s.best.base.fit.residual)),
            x_edges,
            y_edges,
        });
    }
    out
}

/// Amplitude spectra over the longest series of each output.
fn spectra(s: &Sitting<'_, '_>, found: bool) -> Vec<SpectrumPicture> {
    let mut out = Vec::new();
    for (o, output) in s.simulation.outputs.iter().enumerate() {
        let mine = s.data.layout.series.iter().filter(|p| p.output == o);
        let Some(series) = mine.max_by_key(|p| p.rows.len()) else { continue };
        let segment = (series.rows.len() / 4).clamp(16, SEGMENT).min(series.rows.len());
        let spectrum = |e: &[f64]| {
            let (f, power) = power_spectrum(&e[series.rows.clone()], s.data.row_period_s(), segment).ok()?;
            Some((f, power.into_iter().map(f64::sqrt).collect::<Vec<f64>>()))
        };
        let Some((frequency_hz, before)) = spectrum(&s.none.base.fit.residual) else { continue };
        let Some((_, measured)) = spectrum(&s.data.y) else { continue };
        // White noise of the estimated strength has a flat density.
        let nyquist = 0.5 / s.data.row_period_s();
        let level = s.noise.get(o).copied().unwrap_or(0.0) / nyquist.sqrt();
        out.push(SpectrumPicture {
            output: output.column.clone(),
            unit: format!("{}/sqrt(Hz)", unit_of(&output.column)),
            noise: vec![level; frequency_hz.len()],
            after: if found { spectrum(&s.best.base.fit.residual).map(|p| p.1) } else { None },
            frequency_hz,
            measured,
            before,
        });
    }
    out
}

/// What the effects add, over the quantities of the first effect's slot: as a force where the slot has a mass.
fn laws(s: &Sitting<'_, '_>) -> Vec<LawPicture> {
    let Some(effect) = s.best.effects.first() else { return Vec::new() };
    let Some((symbol, mut law)) = super::region::added_law(s.none, s.best) else { return Vec::new() };
    let mut y_label = format!("added to {symbol}");
    if let (Some(m), true) = (effect.slot.quantity("m"), symbol.starts_with("d(")) {
        law = Expr::Number(-1.0) * m.expression.clone() * law;
        let unit = effect.slot.quantity("F").and_then(|q| q.unit.as_ref()).map(ToString::to_string);
        y_label = unit.map_or("force against the motion".into(), |u| format!("force against the motion ({u})"));
    }
    // A spring is looked at over the displacement first, everything else over the velocity.
    let order = match effect.mechanism.block_at(&effect.slot) {
        Block::Restoring | Block::Hysteresis => ["x", "v", "u", "y", "w"],
        _ => ["v", "x", "u", "y", "w"],
    };
    let mut out = Vec::new();
    for name in order {
        let Some(q) = effect.slot.quantity(name) else { continue };
        let Some(series) = along(&s.best.base, &[q.expression.clone(), law.clone()]) else { continue };
        let points: Vec<(f64, f64)> = series[0].concat().into_iter().zip(series[1].concat()).collect();
        let moves = points.iter().any(|p| p.0.is_finite() && p.0 != points[0].0);
        if !moves || points.iter().all(|p| !p.1.is_finite()) {
            continue;
        }
        let unit = q.unit.as_ref().map(|u| format!(" ({u})")).unwrap_or_default();
        let text = q.expression.to_string();
        out.push(LawPicture {
            title: format!("What is added, over {text}"),
            x_label: format!("{text}{unit}"),
            y_label: y_label.clone(),
            points,
        });
        if out.len() == 2 {
            break;
        }
    }
    out
}

fn parameters(s: &Sitting<'_, '_>, found: bool) -> Vec<ParameterPicture> {
    let before = s.none.base.intervals();
    let after = if found { s.best.base.intervals() } else { Vec::new() };
    let find = |list: &[Interval], name: &str| list.iter().find(|p| p.name == name).cloned();
    let brought = after.iter().filter(|a| before.iter().all(|b| b.name != a.name));
    let names = before.iter().chain(brought).map(|p| p.name.clone());
    names
        .map(|name| {
            let given = s.simulation.parameter(&name);
            let document = s.best.base.model.simulation();
            let unit = document.parameter(&name).and_then(|p| p.unit.as_ref()).map(ToString::to_string);
            let (before, after) = (find(&before, &name), find(&after, &name));
            let bound = |i: &Option<Interval>| i.as_ref().is_some_and(|i| i.at_bound);
            let remark = match (bound(&before), bound(&after)) {
                (_, true) => "at a bound",
                (true, false) if found => "at a bound before",
                (true, false) => "at a bound",
                _ => "",
            };
            ParameterPicture {
                unit: unit.unwrap_or_default(),
                given: given.map(|p| p.value),
                before,
                after,
                remark: remark.into(),
                name,
            }
        })
        .collect()
}
