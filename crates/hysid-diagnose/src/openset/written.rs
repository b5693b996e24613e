//! A correction as a simulation: its terms stand in the equations; their coefficients, knees, widths and wave numbers are parameters.
//!
//! Regression on the tangent chose the terms out of a coarse grid. A wave number that is a tenth wrong is out of phase at the end of the range,
//! and what was better on the recording is then worse on another: all of it is refitted.

use std::f64::consts::TAU;

use hysid_plant::{Expr, Parameter, Simulation, Slot as Place};

use super::course::{Course, phases};
use super::modulation::multiply;
use super::terms::Term;
use super::varying::Varying;

/// How far a coefficient may move from where the regression on the tangent found it, over its own size.
const REACH: f64 = 10.0;
/// How far a shape may move, as multiples of where it began.
const SHAPES: (f64, f64) = (0.5, 2.0);
/// Numbers that are part of a term's form.
const FORM: [f64; 4] = [0.0, 1.0, 2.0, 3.0];

/// A simulation with these terms, each with its coefficient, where they act; `None` where a term cannot be written over its symbols.
pub fn with_terms<'t>(simulation: &Simulation, terms: impl IntoIterator<Item = (&'t Term, f64)>) -> Option<Simulation> {
    let mut written = simulation.clone();
    // What is added to an input stands for the input as it was: all of its terms enter at once.
    let mut inputs: Vec<Option<Expr>> = vec![None; simulation.inputs.len()];
    for (term, coefficient) in terms {
        let name = written.fresh_symbol("g");
        let reach = REACH * coefficient.abs();
        written.parameters.push(Parameter::new(&name, coefficient).within(coefficient - reach, coefficient + reach));
        let part = Expr::symbol(&name) * with_free_shapes(&mut written, term)?;
        match term.place {
            Place::State(i) => {
                let state = written.states.get_mut(i)?;
                state.derivative = state.derivative.clone() + part;
            }
            Place::Output(i) => {
                let output = written.outputs.get_mut(i)?;
                output.expression = output.expression.clone() + part;
            }
            Place::Input(i) => {
                let sum = inputs.get_mut(i)?;
                *sum = Some(sum.take().unwrap_or_else(|| Expr::symbol(&simulation.inputs[i].symbol)) + part);
            }
        }
    }
    for (input, sum) in simulation.inputs.iter().zip(inputs) {
        if let Some(sum) = sum {
            written.map_equations(|e| e.substitute(&input.symbol, &sum));
        }
    }
    Some(written)
}

/// Share of a cycle over the recording by which a frequency may move from where the periodogram found it.
const CYCLES: f64 = 0.75;

/// A simulation in which a parameter oscillates, amplitudes and frequency unknown; `None` for a walk, since another recording sees another one.
pub fn with_oscillation(simulation: &Simulation, found: &Varying) -> Option<Simulation> {
    let Course::Line(f) = found.course else { return None };
    let mut written = simulation.clone();
    let frequency = written.fresh_symbol("s");
    let (w, far) = (TAU * f, TAU * CYCLES / found.length_s);
    written.parameters.push(Parameter::new(&frequency, w).within(w - far, w + far));
    let mut factor = Expr::Number(1.0);
    for (text, amplitude) in phases(&frequency).iter().zip(&found.amplitudes) {
        let course = Expr::parse(text).ok()?;
        let name = written.fresh_symbol("g");
        let reach = REACH * found.size;
        written.parameters.push(Parameter::new(&name, *amplitude).within(-reach, reach));
        factor = factor + Expr::symbol(&name) * course;
    }
    multiply(&mut written, &found.symbol, &factor);
    Some(written)
}

/// A term over the simulation's symbols, the numbers in it parameters; exponents, zero and one are part of its form.
fn with_free_shapes(simulation: &mut Simulation, term: &Term) -> Option<Expr> {
    let parsed = Expr::parse(&term.text).ok()?;
    let free = parsed.map(&mut |e| match e {
        Expr::Number(n) if !FORM.contains(&n) => {
            let name = simulation.fresh_symbol("s");
            let (low, high) = (n * SHAPES.0, n * SHAPES.1);
            simulation.parameters.push(Parameter::new(&name, n).within(low.min(high), low.max(high)));
            Expr::symbol(&name)
        }
        other => other,
    });
    Some(term.coordinates.iter().fold(free, |e, (name, meaning)| e.substitute(name, meaning)))
}

#[cfg(test)]
#[path = "../../tests/common/oscillator.rs"]
mod oscillator;

#[cfg(test)]
mod tests {
    use hysid_signal::{Channel, Clock, Recording};

    use super::oscillator::{BASELINE, PERIOD, REAL, drive, normal, respond, rms};
    use super::*;
    use crate::base::{NoiseKind, Start, fit_simulation};
    use crate::data::DataSet;
    use crate::evidence::{dot, norm2};
    use crate::model::{Model, Values};
    use crate::openset::terms::terms;
    use crate::refit::LmOptions;

    /// What regression on the tangent saw and what is written and refitted must be the same term: its response is the derivative of the
    /// written simulation by its coefficient, for each of the terms at every slot.
    #[test]
    fn the_response_of_a_term_is_the_derivative_by_its_coefficient() {
        let u = drive(600, &mut normal(3));
        let y = respond(&u, REAL, |_, _| 0.0);
        let channels = vec![Channel { name: "u_N".into(), samples: u }, Channel { name: "x_m".into(), samples: y }];
        let recording = Recording::new("est.csv", Clock { start_s: 0.0, period_s: PERIOD }, channels).unwrap();
        let simulation = Simulation::parse(BASELINE, "test.sim.toml").unwrap();
        let data = DataSet::new(&simulation, &[recording], 3).unwrap();
        let model = |s: &Simulation| Model::new(s, &data, &["x".into(), "v".into()], 2).unwrap();
        let start = Values::default();
        let base = fit_simulation(
            model(&simulation),
            Start::Values(&start),
            &[],
            None,
            1,
            LmOptions::default(),
            NoiseKind::White(1.0),
        )
        .unwrap();
        let all = terms(&base);
        assert!(all.len() > 50, "{}", all.len());
        for term in &all {
            let response = |g: f64| {
                let mut written = with_terms(&base.document(), [(term, 1.0)]).unwrap();
                written.parameter_mut("g").unwrap().value = g;
                let m = model(&written);
                let theta = m.theta(&start);
                m.simulate(&theta).0.concat().concat()
            };
            // As far as the oscillator moves by a hundredth of what it does.
            let g = 0.01 * rms(&data.y) / rms(&term.column).max(f64::MIN_POSITIVE);
            let slope: Vec<f64> = response(g).iter().zip(response(-g)).map(|(a, b)| (a - b) / (2.0 * g)).collect();
            let cosine = dot(&slope, &term.column) / (norm2(&slope) * norm2(&term.column)).sqrt();
            let size = rms(&slope) / rms(&term.column);
            assert!(cosine > 0.98 && (size - 1.0).abs() < 0.06, "{} at {}: {cosine} {size}", term.text, term.slot);
        }
    }
}
