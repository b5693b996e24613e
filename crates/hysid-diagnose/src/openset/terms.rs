//! The generic terms: functions of displacement and velocity, plays, lags, functions of time, of the input and of the output ([`shapes`]), each
//! pushed through the tangent of the fitted simulation from the slot at which it acts.

use std::sync::Arc;

use hysid_plant::{Expr, Simulation, Slot as Place};
use rayon::prelude::*;

use super::course::Series;
use super::shapes::{self, Kind, Shape, held_beyond};
use crate::model::along;
use crate::model::base::Base;
use crate::slot::{Sensed, Structure, sensed};

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
        let Some(slot) = structure.slots.iter().find(|s| s.label == label) else {
            // A part of a cascade, in which only its rate may be limited.
            places.push((Place::State(i), label, "plant", Vec::new()));
            continue;
        };
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
    for (place, label, side, mut coordinates) in places {
        let own = coordinates.len();
        if let (Place::State(i), "plant") = (place, side) {
            // What follows a command by itself, as an actuator does, may do so no faster than it can.
            let state = &simulation.states[i];
            let known = others(simulation, &coordinates);
            let passes = !matches!(state.derivative, Expr::Symbol(_));
            if passes && coordinates.iter().all(|(name, ..)| *name == state.name) {
                coordinates.push((format!("rate_{}", state.name), state.derivative.clone(), false));
            }
            let others = if own > 0 { known } else { Vec::new() };
            coordinates.extend(others.into_iter().map(|s| (s.to_owned(), Expr::symbol(s), false)));
        }
        let mut expressions: Vec<Expr> = coordinates.iter().map(|c| c.1.clone()).collect();
        let plant = side == "plant";
        let inputs = if plant && !simulation.is_static() { simulation.inputs.as_slice() } else { &[] };
        expressions.extend(inputs.iter().map(|u| Expr::symbol(&u.symbol)));
        let slot = structure.slots.iter().find(|s| s.label == label);
        let radians = slot.and_then(|s| s.quantity("rad")).map(|q| q.expression.clone());
        expressions.extend(radians.clone());
        let Some(mut series) = along(base, &expressions) else { continue };
        // The same at every sample.
        let radians = radians.and_then(|_| series.pop()?.first()?.first().copied());
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
        let mut found: Vec<Shape> = Vec::new();
        let named = |i: usize| (coordinates[i].0.as_str(), series[i].as_slice());
        let rates = coordinates[own..].iter().take_while(|(name, ..)| name.starts_with("rate_")).count();
        found.extend((own..own + rates).flat_map(|i| shapes::limits(named(i))));
        for other in own + rates..coordinates.len() {
            found.push(shapes::proportional(named(other)));
            found.extend(
                (0..=other)
                    .filter(|i| !(own..own + rates).contains(i))
                    .map(|i| shapes::product(named(i), named(other))),
            );
            found.extend(inputs.iter().map(|(u, input)| shapes::product((u, input), named(other))));
        }
        for ((name, _, velocity), x) in coordinates[..own].iter().zip(&series) {
            found.extend(shapes::curves(name, x, *velocity));
            if plant {
                if !velocity {
                    found.extend(shapes::relays(name, x));
                }
                found.extend(shapes::lags(name, x, data));
                found.extend(shapes::changes(name, x, data));
            }
            for (u, input) in &inputs {
                found.extend(shapes::driven((u, input), (name, x)));
            }
        }
        if let ([(a, _, _), (b, _, _)], [x, v], true) = (&coordinates[..own], &series[..own], plant) {
            found.extend(shapes::surface((a, x), (b, v), radians));
        }
        work.extend(found.into_iter().map(|Shape { text, kind, series }| Signal {
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
    let measured = measured(simulation);
    work.into_iter()
        .zip(columns)
        .filter_map(|(s, column)| {
            let mut column = column?;
            for (_, output, times) in measured.iter().filter(|(state, ..)| s.place == Place::State(*state)) {
                for part in data.layout.series.iter().filter(|part| part.output == *output) {
                    let direct = data.rows_of(part, &s.series[part.stretch]);
                    column[part.rows.clone()].iter_mut().zip(direct.iter()).for_each(|(c, d)| *c += times * d);
                }
            }
            let Signal { text, coordinates, place, kind, side, slot, .. } = s;
            Some(Term { text, coordinates, place, kind, side, slot, column })
        })
        .collect()
}

/// Most states of other parts in which a slot's correction may be written.
const OTHERS: usize = 6;

/// The states that none of a slot's own coordinates is made of: what moves elsewhere acts through products (a swing's centrifugal force, a field's
/// pull), and in proportion where the simulation has no parameter for it (two axes that a spinning wheel couples).
fn others<'s>(simulation: &'s Simulation, own: &[(String, Expr, bool)]) -> Vec<&'s str> {
    let known: Vec<String> = own.iter().flat_map(|(_, meaning, _)| meaning.symbols()).collect();
    let states = simulation.states.iter().map(|s| s.name.as_str());
    states.filter(|name| known.iter().all(|k| k != name)).take(OTHERS).collect()
}

/// Places of states and of the outputs that measure their derivatives, with the multiples.
pub fn measured(simulation: &Simulation) -> Vec<(usize, usize, f64)> {
    let place = |s: Sensed| {
        let state = simulation.states.iter().position(|x| x.name == s.state)?;
        let output = simulation.outputs.iter().position(|o| o.column == s.column)?;
        Some((state, output, s.times))
    };
    sensed(simulation).into_iter().filter_map(place).collect()
}
