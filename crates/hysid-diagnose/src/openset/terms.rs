//! The generic terms: functions of displacement and velocity, plays, lags, functions of time, of the input and of the output ([`shapes`]), each
//! pushed through the tangent of the fitted simulation from the slot at which it acts.

use std::sync::Arc;

use hysid_plant::{Expr, Function, Simulation, Slot as Place};
use hysid_signal::range;
use rayon::prelude::*;

use super::past;
use super::shapes::{self, Kind, Shape};
use super::sites::{Site, Symbol, sites};
use super::switches;
use super::varying::course::Series;
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
    /// The same, held some way beyond the ends of the range that was seen of it.
    pub held: Expr,
}

impl Coordinate {
    /// Of what it stands for and the series of that.
    fn new(name: &str, meaning: Expr, x: &Series) -> Self {
        Self { name: name.to_owned(), held: held_beyond(meaning.clone(), x), meaning }
    }
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
    let mut work: Vec<Signal> = Vec::new();
    for site in sites(simulation, &structure) {
        let symbols: Vec<&Symbol> = site.symbols().collect();
        let (own, others) = (site.own.len(), site.elsewhere());
        let Site { place, slot: label, side, .. } = &site;
        let mut expressions: Vec<Expr> = symbols.iter().map(|s| s.meaning.clone()).collect();
        let plant = *side == "plant";
        let inputs = if plant && !simulation.is_static() { simulation.inputs.as_slice() } else { &[] };
        expressions.extend(inputs.iter().map(|u| Expr::symbol(&u.symbol)));
        let slot = structure.slots.iter().find(|s| s.label == *label);
        let radians = slot.and_then(|s| s.quantity("rad")).map(|q| q.expression.clone());
        expressions.extend(radians.clone());
        let Some(mut series) = along(base, &expressions) else { continue };
        // The same at every sample.
        let radians = radians.and_then(|_| series.pop()?.first()?.first().copied());
        let inputs: Vec<(&str, Series)> =
            inputs.iter().map(|u| u.symbol.as_str()).zip(series.split_off(symbols.len())).collect();
        let own_and_others = symbols.iter().zip(&series).map(|(s, x)| Coordinate::new(&s.name, s.meaning.clone(), x));
        let driving = inputs.iter().map(|(u, x)| Coordinate::new(u, Expr::symbol(*u), x));
        let mut within: Vec<Coordinate> = Vec::new();
        for coordinate in own_and_others.chain(driving) {
            // The speed of what turns elsewhere is one of the others too.
            if !within.iter().any(|known| known.name == coordinate.name) {
                within.push(coordinate);
            }
        }
        let within: Arc<[Coordinate]> = within.into();
        let mut found: Vec<Shape> = Vec::new();
        let named = |i: usize| (symbols[i].name.as_str(), series[i].as_slice());
        for rate in own..others.start {
            found.extend(shapes::limits(named(rate)));
            found.push(shapes::one_way_faster(named(rate)));
        }
        for other in others.clone() {
            found.push(shapes::proportional(named(other)));
            let factors = (0..own).chain(others.start..=other);
            found.extend(factors.map(|i| shapes::product(named(i), named(other))));
            found.extend(inputs.iter().map(|(u, input)| shapes::product((u, input), named(other))));
        }
        // What drives another part may drive this one too.
        let is_driven_by = |u: &str| matches!(place, Place::State(i) if simulation.states[*i].derivative.uses(u));
        if own > 0 {
            found.extend(inputs.iter().filter(|(u, _)| !is_driven_by(u)).map(|(u, x)| shapes::proportional((u, x))));
        }
        if let (Some(v), Some(_)) = (site.own.iter().position(|s| s.velocity), &site.acceleration) {
            let x = (0..own).find(|i| *i != v).map(named);
            for (place, rate) in &site.parts {
                let other = (named(others.start + place), named(others.start + rate));
                found.extend(shapes::linked((x, named(v)), other, named(others.end)));
            }
        }
        found.extend(site.passed_at().map(|i| shapes::proportional(named(i))));
        for rate in site.led_at() {
            found.extend((0..own).map(|i| shapes::product(named(rate), named(i))));
        }
        found.extend(site.turns().flat_map(|[speed, angle]| shapes::unbalanced(named(speed), named(angle))));
        if plant && let (Some(first), Some(x)) = (site.own.first(), series.first()) {
            found.extend(past::echoes(&first.name, x, data));
        }
        for (Symbol { name, velocity, .. }, x) in site.own.iter().zip(&series) {
            found.extend(shapes::curves(name, x, *velocity));
            if plant {
                if !velocity {
                    found.extend(switches::relays(name, x));
                }
                found.extend(past::lags(name, x, data));
                found.extend(shapes::changes(name, x, data));
            }
            for (u, input) in &inputs {
                found.extend(shapes::driven((u, input), (name, x)));
                found.extend(switches::gears((u, input), (name, x)));
            }
        }
        if let ([a, b], [x, v], true) = (&site.own[..], &series[..own], plant) {
            found.extend(shapes::surface((&a.name, x), (&b.name, v), radians));
        }
        work.extend(found.into_iter().map(|Shape { text, kind, series }| Signal {
            place: *place,
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

/// Places of states and of the outputs that measure their derivatives, with the multiples.
pub fn measured(simulation: &Simulation) -> Vec<(usize, usize, f64)> {
    let place = |s: Sensed| {
        let state = simulation.states.iter().position(|x| x.name == s.state)?;
        let output = simulation.outputs.iter().position(|o| o.column == s.column)?;
        Some((state, output, s.times))
    };
    sensed(simulation).into_iter().filter_map(place).collect()
}

/// Share of the range that was seen of a coordinate by which a curve goes on at either end of it, so that it is there on recordings that are up to twice
/// as loud. Held at the ends themselves, a right law was worse than none on a recording a third louder.
const BEYOND: f64 = 0.5;

/// A coordinate, held some way beyond the ends of the range that its series has.
pub fn held_beyond(coordinate: Expr, x: &[Vec<f64>]) -> Expr {
    let (low, high) = range(x.iter().flatten().copied());
    let further = BEYOND * (high - low);
    Expr::call2(Function::Min, Expr::call2(Function::Max, coordinate, low - further), high + further)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_goes_on_to_a_recording_that_is_twice_as_loud() {
        let held = held_beyond(Expr::symbol("x"), &[vec![-3.0, 1.0], vec![0.0, 3.0]]);
        assert_eq!(held.to_string(), "min(max(x, -6), 6)");
    }
}
