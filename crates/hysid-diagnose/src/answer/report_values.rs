//! What is reported of an effect: its numbers with intervals, evaluated from the fitted parameters.

use hysid_plant::{ClockSource, Compiled, Drive, Expr, Input, Output, Run, Simulation};

use crate::file::{ParameterRecord, finite};
use crate::mechanism::Value;
use crate::model::base::{Base, Interval, QUANTILE};
use crate::model::hypothesis::Effect;

/// Values of expressions of parameters only.
fn evaluate(document: &Simulation, expressions: &[Expr], theta: &[Vec<f64>]) -> Option<Vec<Vec<f64>>> {
    let mut probe = document.clone();
    probe.states.clear();
    // An input that is zero throughout: a document refuses outputs that nothing moves.
    let idle = probe.fresh_symbol("idle");
    probe.inputs = vec![Input { symbol: idle.clone(), column: idle.clone() }];
    probe.time.clock = ClockSource::Period(1.0);
    probe.outputs = expressions
        .iter()
        .enumerate()
        .map(|(i, e)| Output {
            column: format!("probe_{i}"),
            expression: e.clone() + Expr::Number(0.0) * Expr::symbol(&idle),
        })
        .collect();
    let compiled = Compiled::new(&probe).ok()?;
    let drive = Drive::new(0.0, 1.0, 1, vec![vec![0.0]]).ok()?;
    Some(
        theta
            .iter()
            .map(|t| {
                let response = compiled.simulate(&Run::new(&drive, t));
                response.outputs.iter().map(|o| o.first().copied().unwrap_or(f64::NAN)).collect()
            })
            .collect(),
    )
}

/// The reported parameters of one effect of a fitted simulation, with 95 % intervals: that of the unknown where a value is one, by the delta method where it
/// is made of several; none where no unknown of the fit moves a value.
pub fn reported(base: &Base<'_>, effect: &Effect) -> Vec<ParameterRecord> {
    let document = base.document();
    let expressions: Vec<Expr> = effect.written.report.iter().map(|r| r.value.clone()).collect();
    let values = base.values();
    let names: Vec<String> = document.parameters.iter().map(|p| p.name.clone()).collect();
    let centre: Vec<f64> = names.iter().map(|n| values.parameters.get(n).copied().unwrap_or(f64::NAN)).collect();
    let covariance = base.covariance();
    let k = base.fit.theta.len();
    // One displaced point for each unknown that is a parameter.
    let mut points = vec![centre.clone()];
    let mut places = Vec::new();
    for place in 0..k {
        let Some(name) = base.model.name_of(place) else { continue };
        let Some(i) = names.iter().position(|n| n == name) else { continue };
        let step = 1e-3 * covariance[place + k * place].max(0.0).sqrt() + 1e-9 * centre[i].abs();
        if step > 0.0 {
            let mut p = centre.clone();
            p[i] += step;
            points.push(p);
            places.push((place, step));
        }
    }
    let Some(table) = evaluate(&document, &expressions, &points) else { return Vec::new() };
    let intervals = base.intervals();
    effect
        .written
        .report
        .iter()
        .enumerate()
        .map(|(e, r)| {
            let value = table[0][e];
            let gradient: Vec<f64> =
                places.iter().enumerate().map(|(i, (_, step))| (table[i + 1][e] - value) / step).collect();
            let mut variance = 0.0;
            for (a, (pa, _)) in places.iter().enumerate() {
                for (b, (pb, _)) in places.iter().enumerate() {
                    variance += gradient[a] * gradient[b] * covariance[pa + k * pb];
                }
            }
            // What no unknown moves was read from the recording or chosen from a grid: nothing tells how well it is known.
            // Nor does anything where all that moves it stands at a bound.
            let half = QUANTILE * variance.sqrt();
            let end = |x: f64| finite(x).filter(|_| variance > 0.0);
            let of_itself = match &expressions[e] {
                Expr::Symbol(name) => intervals.iter().find(|i| i.name == *name),
                _ => None,
            };
            let (low, high) = of_itself.map_or((Some(value - half), Some(value + half)), Interval::low_and_high);
            ParameterRecord {
                name: r.name.clone(),
                value,
                low: low.and_then(end),
                high: high.and_then(end),
                unit: r.unit.as_ref().map(ToString::to_string).unwrap_or_default(),
            }
        })
        .collect()
}

/// The sentence that tells an effect.
pub fn sentence(effect: &Effect, parameters: &[ParameterRecord]) -> String {
    let values: Vec<Value> = effect
        .written
        .report
        .iter()
        .zip(parameters)
        .map(|(r, p)| Value { name: r.name.clone(), value: p.value, unit: r.unit.clone() })
        .collect();
    effect.mechanism.tell(&effect.slot, &values)
}
