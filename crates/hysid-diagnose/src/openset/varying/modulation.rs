//! A simulation whose parameters and input gains can be modulated: each is multiplied by one and a further input that is zero.
//!
//! The response to a signal at such an input is the derivative by the modulation's amplitude, exactly, wherever the parameter stands; the adjoint
//! gives the score of a modulation at every instant.

use hysid_plant::{BinaryOp, Compiled, Expr, Input, Memory, Simulation, Slot as Place};
use rayon::prelude::*;

use crate::data::DataSet;
use crate::evidence::Whitener;
use crate::model::Model;
use crate::model::base::Base;

/// Signals that are pushed through the simulation's tangent together.
const TOGETHER: usize = 8;
/// Most parameters and inputs that are looked at.
const MOST: usize = 12;

/// Instants at which it is looked at whether a modulation acts on something that moves, and the change that is none.
const INSTANTS: usize = 24;
const CONSTANT: f64 = 1e-6;

/// What can be modulated: a parameter or an input, by its symbol. What an operator with memory needs to stand still (the time constant of a `lag`) cannot.
pub fn modulated(base: &Base<'_>) -> Vec<String> {
    let simulation = base.model.simulation();
    let values = base.values();
    let own = base.model.unknowns().len();
    let inputs = simulation.inputs.iter().filter(|_| !simulation.is_static()).map(|u| u.symbol.clone());
    (0..own)
        .filter_map(|place| base.model.name_of(place))
        .filter(|name| values.parameters.get(*name).is_some_and(|v| *v != 0.0) && !is_a_share(simulation, name))
        .map(str::to_owned)
        .chain(inputs)
        .filter(|symbol| {
            let mut document = simulation.clone();
            modulate(&mut document, symbol);
            Compiled::new(&document).is_ok()
        })
        .take(MOST)
        .collect()
}

/// Whether a symbol only stands for the share by which something else changes with the time, as `epsilon` in `R*(1 + epsilon*t)`: what varies there is that.
fn is_a_share(simulation: &Simulation, symbol: &str) -> bool {
    let of_time = |e: &Expr| e.uses("t") && e.symbols().iter().all(|s| s == "t" || simulation.parameter(s).is_some());
    let (mut everywhere, mut as_a_share) = (0, 0);
    for (_, equation) in simulation.expressions() {
        equation.visit(&mut |e| {
            everywhere += usize::from(*e == Expr::symbol(symbol));
            if let Expr::Binary(BinaryOp::Add | BinaryOp::Sub, ..) = e {
                let terms = e.terms();
                let relative = terms.iter().any(|(_, term)| matches!(term, Expr::Number(_)));
                let own = terms.iter().filter(|(_, term)| term.uses(symbol) && of_time(term)).count();
                as_a_share += if relative { own } else { 0 };
            }
        });
    }
    everywhere > 0 && as_a_share >= everywhere
}

/// Multiplies a symbol in every equation; the time by which inputs are delayed, which has to stand still, to first order: `delay(u, T)` becomes
/// `delay(u, T) - (factor - 1)*T*delay(d(u), T)`.
pub fn multiply(simulation: &mut Simulation, symbol: &str, factor: &Expr) {
    let (own, by) = (Expr::symbol(symbol), Expr::symbol(symbol) * factor.clone());
    let inputs: Vec<String> = simulation.inputs.iter().map(|u| u.symbol.clone()).collect();
    let recorded = |w: &Expr| !w.has_memory() && w.symbols().iter().all(|s| inputs.contains(s));
    // Under another name while delays are looked at: in them it is meant to stay.
    let mark = Expr::symbol(simulation.fresh_symbol("varying"));
    let later = |e: Expr| match &e {
        Expr::Memory(Memory::Delay, arguments) => match arguments.as_slice() {
            [w, seconds] if recorded(w) && seconds.replace(&mark, &own) != *seconds => {
                let still = seconds.replace(&mark, &own);
                let more = seconds.replace(&mark, &by) - still.clone();
                w.clone().delay(still.clone()) - more * w.clone().derivative_of_input().delay(still)
            }
            _ => e,
        },
        _ => e,
    };
    simulation.map_equations(|e| e.replace(&own, &mark).map(&mut &later).replace(&mark, &by));
}

/// Multiplies a symbol by one and a further input that is zero.
fn modulate(simulation: &mut Simulation, symbol: &str) {
    let name = simulation.fresh_symbol("modulation");
    simulation.inputs.push(Input { symbol: name.clone(), column: name.clone() });
    multiply(simulation, symbol, &(Expr::Number(1.0) + Expr::symbol(&name)));
}

/// The fitted simulation with a further input for each modulation.
pub struct Modulated<'d> {
    model: Model<'d>,
    theta: Vec<f64>,
    /// The place among the inputs of each modulation.
    places: Vec<usize>,
}

impl<'d> Modulated<'d> {
    /// With a modulation of each of these symbols; `data` are the fit's with as many still inputs.
    pub fn new(base: &Base<'_>, symbols: &[String], data: &'d DataSet) -> Option<Self> {
        let mut document = base.document();
        let own = document.inputs.len();
        let places = (own..own + symbols.len()).collect();
        symbols.iter().for_each(|symbol| modulate(&mut document, symbol));
        let model = Model::new(&document, data, base.model.substeps()).ok()?;
        let theta = model.theta(&base.values());
        Some(Self { model, theta, places })
    }

    /// Whether each modulation acts on something that moves. An offset that varies is an unknown force or a drift of the sensor, which noise is too.
    pub fn of_motion(&self) -> Vec<bool> {
        let points = self.model.linearised(&self.theta, INSTANTS);
        let inputs = self.model.simulation().inputs.len();
        let column = |p: &hysid_plant::Linearisation, i: usize| -> Vec<f64> {
            p.b.chunks(inputs).chain(p.d.chunks(inputs)).filter_map(|row| row.get(i).copied()).collect()
        };
        self.places
            .iter()
            .map(|&i| {
                let all: Vec<Vec<f64>> = points.iter().map(|p| column(p, i)).collect();
                let size = all.iter().flatten().fold(0.0f64, |m, x| m.max(x.abs()));
                let moved = |x: &Vec<f64>| x.iter().zip(&all[0]).any(|(a, b)| (a - b).abs() > CONSTANT * size);
                // What acts through the past only (a delay) is not seen at an instant, and does move.
                size == 0.0 || all.iter().any(moved)
            })
            .collect()
    }

    /// Forgets the modulations of what does not move, and returns the symbols of those that are left.
    pub fn keep_of_motion(&mut self, symbols: Vec<String>) -> Vec<String> {
        let moving = self.of_motion();
        let mut each = moving.iter();
        self.places.retain(|_| each.next() == Some(&true));
        symbols.into_iter().zip(moving).filter(|(_, moving)| *moving).map(|(s, _)| s).collect()
    }

    /// The stacked response to each modulation (number of the symbol, series by stretch), for an amplitude of one.
    pub fn responses(&self, modulations: &[(usize, Vec<Vec<f64>>)]) -> Vec<Option<Vec<f64>>> {
        modulations
            .par_chunks(TOGETHER)
            .flat_map_iter(|some| {
                let signals: Vec<_> =
                    some.iter().map(|(i, series)| (Place::Input(self.places[*i]), series.as_slice())).collect();
                self.model.responses_to(&self.theta, &signals)
            })
            .collect()
    }

    /// The score of a modulation at each instant, for each of several whitened residuals: `[residual][symbol][stretch][sample]`.
    pub fn scores(&self, noise: &Whitener, residuals: &[Vec<f64>]) -> Option<Vec<Vec<Vec<Vec<f64>>>>> {
        let all = self.model.scores(&self.theta, noise, residuals)?;
        let of_places = |mut by: Vec<Vec<Vec<f64>>>| self.places.iter().map(|&i| std::mem::take(&mut by[i])).collect();
        Some(all.into_iter().map(of_places).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_share_of_a_change_with_time_varies_in_the_place_of_what_changes() {
        let share = |derivative: &str, output: &str| {
            let text = format!(
                "[time]\nperiod_s = 0.1\n[inputs]\nu = \"u\"\n[parameters]\nR = {{ value = 1.0, min = 0.1 }}\nq = {{ value = 0.2, min = 0.1 }}\n[states]\n\
                 s = {{ derivative = \"{derivative}\", initial = 0.0 }}\n[outputs]\ny = \"{output}\"\n"
            );
            is_a_share(&Simulation::parse(&text, "share.sim.toml").unwrap(), "q")
        };
        assert!(share("u/(R*(1 + q*(1 - exp(-t/3)))) - s", "s"));
        assert!(share("u*R*(1 - q*t) - s", "s*(1 + q*t)"));
        // A drift of its own, a share that follows a state, and one that stands elsewhere too.
        assert!(!share("u*R - s", "s + q*t"));
        assert!(!share("u*R*(1 + q*s) - s", "s"));
        assert!(!share("u*R*(1 + q*t) - s", "q*s"));
    }
}
