//! The generic signals: functions of displacement and velocity, plays, lags, functions of time, of the input and of the output, each pushed
//! through the tangent of the fitted simulation from the slot at which it acts.

use std::sync::Arc;

use hysid_plant::{Expr, Function, Slot as Place};
use rayon::prelude::*;

use crate::answer::text::number;
use crate::data::DataSet;
use crate::model::base::Base;
use crate::search::screen::along;
use crate::slot::Structure;

/// Samples of a signal by stretch.
type Series = Vec<Vec<f64>>;

/// A generic signal before it is pushed through the simulation.
struct Signal {
    place: Place,
    slot: String,
    side: &'static str,
    text: String,
    coordinates: Arc<[Coordinate]>,
    kind: Kind,
    series: Series,
}

/// A coordinate of generic terms.
#[derive(Debug, Clone)]
pub struct Coordinate {
    /// As it is called in a term's text.
    pub name: String,
    /// What it stands for in the simulation.
    pub meaning: Expr,
    /// The same, held at the ends of the range that was seen of it.
    pub held: Expr,
}

/// What a generic term is a function of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// An odd function of its coordinate.
    Odd,
    /// An even or one-sided one.
    Even,
    /// A play.
    Play,
    /// What a lag leaves.
    Lag,
    /// Something that changes over the record.
    Time,
}

/// One generic signal at one place.
#[derive(Debug, Clone)]
pub struct Term {
    /// As it is written.
    pub text: String,
    /// What its text is written over.
    pub coordinates: Arc<[Coordinate]>,
    /// Where it enters the equations.
    pub place: Place,
    /// What it is a function of.
    pub kind: Kind,
    /// Where it acts: plant, input or output.
    pub side: &'static str,
    /// The slot.
    pub slot: String,
    /// Its response, stacked, in the unit of the outputs.
    pub column: Vec<f64>,
}

/// Signals that are pushed through the simulation's tangent together.
const TOGETHER: usize = 8;

/// The signals of one coordinate that are tried: text, kind, series by stretch.
fn shapes(name: &str, x: &[Vec<f64>], velocity: bool) -> Vec<(String, Kind, Series)> {
    let all: Vec<f64> = x.concat();
    let mut size: Vec<f64> = all.iter().map(|v| v.abs()).collect();
    size.sort_by(f64::total_cmp);
    let quantile = |q: f64| size.get(((size.len() as f64 - 1.0) * q) as usize).copied().unwrap_or(0.0);
    let map =
        |f: &dyn Fn(f64) -> f64| -> Vec<Vec<f64>> { x.iter().map(|s| s.iter().map(|v| f(*v)).collect()).collect() };
    let mut out: Vec<(String, Kind, Series)> = vec![
        (format!("{name}^2"), Kind::Even, map(&|v| v * v)),
        (format!("{name}^3"), Kind::Odd, map(&|v| v * v * v)),
        (format!("abs({name})"), Kind::Even, map(&f64::abs)),
        (format!("abs({name})*{name}"), Kind::Odd, map(&|v| v * v.abs())),
        (format!("sign({name})*sqrt(abs({name}))"), Kind::Odd, map(&|v| v.signum() * v.abs().sqrt())),
    ];
    if velocity {
        let small = 0.05 * quantile(0.8);
        if small > 0.0 {
            out.push((format!("tanh({name}/{})", number(small)), Kind::Odd, map(&|v| (v / small).tanh())));
        }
    }
    for q in [0.5, 0.8] {
        let g = quantile(q);
        out.push((format!("max({name} - {}, 0)", number(g)), Kind::Even, map(&|v| (v - g).max(0.0))));
        out.push((format!("max(-{} - {name}, 0)", number(g)), Kind::Even, map(&|v| (-g - v).max(0.0))));
    }
    for q in [0.2, 0.5, 0.8] {
        let r = 0.7 * quantile(q);
        if r > 0.0 && !velocity {
            let play = x
                .iter()
                .map(|s| {
                    let mut w = s.first().copied().unwrap_or(0.0);
                    s.iter()
                        .map(|v| {
                            w = w.max(v - r).min(v + r);
                            w
                        })
                        .collect()
                })
                .collect();
            out.push((format!("play({name}, {})", number(r)), Kind::Play, play));
        }
    }
    out
}

/// A function of two series.
fn both(a: &[Vec<f64>], b: &[Vec<f64>], f: impl Fn(f64, f64) -> f64) -> Series {
    a.iter().zip(b).map(|(a, b)| a.iter().zip(b).map(|(a, b)| f(*a, *b)).collect()).collect()
}

/// What first-order lags of a coordinate leave of it: three time constants, of the length of the recording.
fn lags(name: &str, x: &[Vec<f64>], data: &DataSet) -> Vec<(String, Kind, Series)> {
    let longest = data.stretches.iter().map(|s| s.len() as f64 * data.period_s).fold(0.0, f64::max);
    [300.0, 60.0, 12.0]
        .map(|part| {
            let tau = longest / part;
            let (a, ratio) = ((-data.period_s / tau).exp(), tau / data.period_s);
            // Exact where the coordinate is linear between samples.
            let left = |s: &Vec<f64>| {
                let (mut before, mut behind) = (s.first().copied().unwrap_or(0.0), 0.0);
                s.iter()
                    .map(|v| {
                        let settled = (v - before) * ratio;
                        behind = settled + a * (behind - settled);
                        before = *v;
                        behind
                    })
                    .collect()
            };
            (format!("{name} - lag({name}, {})", number(tau)), Kind::Lag, x.iter().map(left).collect())
        })
        .into()
}

/// Tents over the recording by which a coordinate's coefficient may change.
const TENTS: usize = 6;

/// A coordinate with a coefficient that drifts, and one that changes during a part of the recording.
fn changes(name: &str, x: &[Vec<f64>], data: &DataSet) -> Vec<(String, Kind, Series)> {
    let over = |f: &dyn Fn(f64) -> f64| -> Series {
        x.iter()
            .zip(&data.stretches)
            .map(|(s, st)| s.iter().enumerate().map(|(n, v)| v * f(st.start_s + n as f64 * data.period_s)).collect())
            .collect()
    };
    let mut out = vec![(format!("t*{name}"), Kind::Time, over(&|t| t))];
    let ends = data.stretches.iter().map(|s| (s.start_s, s.start_s + s.len() as f64 * data.period_s));
    let (first, last) = ends.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), (c, d)| (a.min(c), b.max(d)));
    let width = (last - first) / (TENTS - 1) as f64;
    if width > 0.0 {
        out.extend((0..TENTS).map(|i| {
            let at = first + i as f64 * width;
            let text = format!("max(1 - abs(t - {})/{}, 0)*{name}", number(at), number(width));
            (text, Kind::Time, over(&|t| (1.0 - (t - at).abs() / width).max(0.0)))
        }));
    }
    out
}

/// Products of displacement and velocity, and what is periodic in the displacement.
fn surface((a, x): (&str, &[Vec<f64>]), (b, v): (&str, &[Vec<f64>])) -> Vec<(String, Kind, Series)> {
    let mut out = vec![
        (format!("{a}^2*{b}"), Kind::Odd, both(x, v, |x, v| x * x * v)),
        (format!("{a}*{b}^2"), Kind::Odd, both(x, v, |x, v| x * v * v)),
        (format!("abs({a})*{b}"), Kind::Odd, both(x, v, |x, v| x.abs() * v)),
        (format!("{a}*abs({b})"), Kind::Odd, both(x, v, |x, v| x * v.abs())),
        (format!("abs({a})*sign({b})"), Kind::Odd, both(x, v, |x, v| x.abs() * v.signum())),
        (format!("{a}*{b}"), Kind::Even, both(x, v, |x, v| x * v)),
    ];
    let span = spread(x);
    for cycles in [1.0, 2.0, 4.0].into_iter().filter(|_| span > 0.0) {
        let k = std::f64::consts::TAU * cycles / span;
        let n = number(k);
        out.extend([
            (format!("sin({n}*{a})"), Kind::Odd, both(x, v, |x, _| (k * x).sin())),
            (format!("cos({n}*{a})"), Kind::Even, both(x, v, |x, _| (k * x).cos())),
            (format!("{b}*sin({n}*{a})"), Kind::Even, both(x, v, |x, v| v * (k * x).sin())),
            (format!("{b}*cos({n}*{a})"), Kind::Odd, both(x, v, |x, v| v * (k * x).cos())),
        ]);
    }
    out
}

/// Smallest and largest value.
fn range(x: &[Vec<f64>]) -> (f64, f64) {
    x.iter().flatten().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)))
}

/// Largest less smallest value.
fn spread(x: &[Vec<f64>]) -> f64 {
    let (low, high) = range(x);
    if high > low { high - low } else { 0.0 }
}

/// A coordinate, held at the ends of the range that its series has.
fn held_beyond(coordinate: Expr, x: &[Vec<f64>]) -> Expr {
    let (low, high) = range(x);
    Expr::call2(Function::Min, Expr::call2(Function::Max, coordinate, low), high)
}

/// The generic terms of a fitted simulation, as responses in the unit of the outputs.
pub fn terms(base: &Base<'_>) -> Vec<Term> {
    let model = &base.model;
    let data = model.data();
    let simulation = model.simulation();
    let structure = Structure::of(simulation);
    // (place in the engine, slot's name, side, coordinates)
    let mut places: Vec<(Place, String, &'static str, Vec<(String, Expr, bool)>)> = Vec::new();
    let own: Vec<&str> = structure.slots.iter().map(|s| s.label.as_str()).collect();
    for (i, state) in simulation.states.iter().enumerate() {
        let label = format!("state:{}", state.name);
        let Some(slot) = structure.slots.iter().find(|s| s.label == label) else { continue };
        let coordinates = ["x", "v"]
            .iter()
            .filter_map(|n| slot.quantity(n).map(|q| ((*n).to_owned(), q.expression.clone(), *n == "v")))
            .map(|(n, e, v)| (if let Expr::Symbol(s) = &e { s.clone() } else { n }, e, v))
            .collect::<Vec<_>>();
        let coordinates = if coordinates.is_empty() {
            vec![(state.name.clone(), Expr::symbol(&state.name), false)]
        } else {
            coordinates
        };
        places.push((Place::State(i), label, "plant", coordinates));
    }
    for (i, input) in simulation.inputs.iter().enumerate() {
        let label = format!("input:{}", input.symbol);
        if !simulation.is_static() && own.contains(&label.as_str()) {
            places.push((
                Place::Input(i),
                label,
                "input",
                vec![(input.symbol.clone(), Expr::symbol(&input.symbol), false)],
            ));
        }
    }
    for (i, output) in simulation.outputs.iter().enumerate() {
        let label = format!("output:{}", output.column);
        let coordinates = if simulation.is_static() {
            simulation
                .inputs
                .iter()
                .map(|u| (u.symbol.clone(), Expr::symbol(&u.symbol), u.symbol.starts_with('v')))
                .collect()
        } else {
            vec![("y".to_owned(), output.expression.clone(), false)]
        };
        places.push((Place::Output(i), label, if simulation.is_static() { "plant" } else { "output" }, coordinates));
    }
    let mut work: Vec<Signal> = Vec::new();
    for (place, label, side, coordinates) in places {
        let mut expressions: Vec<Expr> = coordinates.iter().map(|c| c.1.clone()).collect();
        let plant = side == "plant";
        let inputs = if plant && !simulation.is_static() { simulation.inputs.as_slice() } else { &[] };
        expressions.extend(inputs.iter().map(|u| Expr::symbol(&u.symbol)));
        let Some(mut series) = along(base, &expressions) else { continue };
        let inputs: Vec<(&str, Series)> =
            inputs.iter().map(|u| u.symbol.as_str()).zip(series.split_off(coordinates.len())).collect();
        let within: Arc<[Coordinate]> = coordinates
            .iter()
            .zip(&series)
            .map(|((name, meaning, _), x)| Coordinate {
                name: name.clone(),
                meaning: meaning.clone(),
                held: held_beyond(meaning.clone(), x),
            })
            .collect();
        let mut found: Vec<(String, Kind, Series)> = Vec::new();
        for ((name, _, velocity), x) in coordinates.iter().zip(&series) {
            found.extend(shapes(name, x, *velocity));
            if plant {
                found.extend(lags(name, x, data));
                found.extend(changes(name, x, data));
            }
            for (u, input) in &inputs {
                found.push((format!("{u}*{name}"), Kind::Even, both(input, x, |u, x| u * x)));
                found.push((format!("abs({u})*{name}"), Kind::Odd, both(input, x, |u, x| u.abs() * x)));
            }
        }
        if let ([(a, _, _), (b, _, _)], [x, v], true) = (coordinates.as_slice(), series.as_slice(), plant) {
            found.extend(surface((a, x), (b, v)));
        }
        work.extend(found.into_iter().map(|(text, kind, series)| Signal {
            place,
            slot: label.clone(),
            side,
            text,
            coordinates: Arc::clone(&within),
            kind,
            series,
        }));
    }
    let columns: Vec<Option<Vec<f64>>> = work
        .par_chunks(TOGETHER)
        .flat_map_iter(|work| {
            let signals: Vec<_> = work.iter().map(|s| (s.place, s.series.as_slice())).collect();
            model.responses_to(&base.fit.theta, &signals)
        })
        .collect();
    work.into_iter()
        .zip(columns)
        .filter_map(|(s, column)| {
            let Signal { text, coordinates, place, kind, side, slot, .. } = s;
            Some(Term { text, coordinates, place, kind, side, slot, column: column? })
        })
        .collect()
}
