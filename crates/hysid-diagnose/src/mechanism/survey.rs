//! The signals at every slot, from one run of the simulation over the recordings.

use std::collections::BTreeMap;

use hysid_plant::{Compiled, DataError, Drive, Error, Expr, Output, Run, Simulation, Start};
use hysid_signal::{Recording, Segment};

use super::signals::{Signals, excited_band};
use crate::slot::{Slot, Structure, Target};

/// A stretch of a recording without gaps.
#[derive(Debug, Clone, Copy)]
pub struct Stretch<'a> {
    /// The recording.
    pub recording: &'a Recording,
    /// Its samples.
    pub range: &'a Segment,
    /// The values of the simulation's free initial states there, in their order.
    pub free: &'a [f64],
}

/// Why the signals could not be found.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SurveyError {
    /// The simulation is not well-formed.
    #[error(transparent)]
    Simulation(#[from] Error),
    /// The recording does not fit it.
    #[error(transparent)]
    Data(#[from] DataError),
    /// There is nothing to look at.
    #[error("there is no stretch of a recording to look at")]
    Empty,
}

/// The signals at each slot of a structure, in its order, from the simulation's own run at its present parameter values.
///
/// # Errors
/// A simulation or recording that cannot be run.
pub fn survey(
    simulation: &Simulation,
    structure: &Structure,
    stretches: &[Stretch<'_>],
) -> Result<Vec<Signals>, SurveyError> {
    let mut probe = Probe::new(simulation);
    for slot in &structure.slots {
        for (_, quantity) in slot.symbols() {
            probe.add(&quantity.expression);
        }
    }
    let runs = probe.run(stretches)?;
    let mut found = Vec::with_capacity(structure.slots.len());
    for slot in &structure.slots {
        let mut signals = runs.frame.clone();
        for (symbol, quantity) in slot.symbols() {
            match probe.position(&quantity.expression) {
                Some(at) => {
                    signals.series.insert(symbol.to_owned(), runs.series.get(at).cloned().unwrap_or_default());
                }
                None => {
                    if let Some(value) = constant(simulation, &quantity.expression) {
                        signals.constants.insert(symbol.to_owned(), value);
                    }
                }
            }
        }
        signals.measure(measured(slot, stretches));
        found.push(signals);
    }
    Ok(found)
}

/// The recorded output of a sensor's slot, stretch after stretch.
fn measured(slot: &Slot, stretches: &[Stretch<'_>]) -> Option<Vec<f64>> {
    let Target::Output(column) = &slot.target else { return None };
    let mut all = Vec::new();
    for stretch in stretches {
        all.extend_from_slice(stretch.recording.channel(column)?.samples.get(stretch.range.clone())?);
    }
    Some(all)
}

/// The value of an expression of parameters.
fn constant(simulation: &Simulation, expr: &Expr) -> Option<f64> {
    let mut values = expr.substitute("pi", &Expr::Number(std::f64::consts::PI));
    for parameter in &simulation.parameters {
        values = values.substitute(&parameter.name, &Expr::Number(parameter.value));
    }
    Signals::new(1.0, 0.0, BTreeMap::new()).size_of(&values)
}

struct Probe<'a> {
    simulation: &'a Simulation,
    expressions: Vec<Expr>,
}

struct Runs {
    frame: Signals,
    series: Vec<Vec<f64>>,
}

impl<'a> Probe<'a> {
    fn new(simulation: &'a Simulation) -> Self {
        Self { simulation, expressions: Vec::new() }
    }

    fn moves(&self, expr: &Expr) -> bool {
        expr.symbols()
            .iter()
            .any(|s| s == "t" || self.simulation.input(s).is_some() || self.simulation.state(s).is_some())
    }

    fn add(&mut self, expr: &Expr) {
        if self.moves(expr) && !self.expressions.contains(expr) {
            self.expressions.push(expr.clone());
        }
    }

    fn position(&self, expr: &Expr) -> Option<usize> {
        self.expressions.iter().position(|e| e == expr)
    }

    /// The simulation with everything that is looked at as its outputs, its own outputs first.
    fn simulation(&self) -> Simulation {
        let mut probing = self.simulation.clone();
        for (i, expr) in self.expressions.iter().enumerate() {
            probing.outputs.push(Output { column: format!("probe_{i}"), expression: expr.clone() });
        }
        probing
    }

    fn run(&self, stretches: &[Stretch<'_>]) -> Result<Runs, SurveyError> {
        let compiled = Compiled::new(&self.simulation())?;
        let theta = compiled.theta();
        let own = self.simulation.outputs.len();
        let mut series = vec![Vec::new(); self.expressions.len()];
        let mut frame = Signals::new(1.0, 0.0, BTreeMap::new());
        frame.stretches.clear();
        let (mut longest, mut low, mut high) = (0, f64::INFINITY, 0.0_f64);
        for stretch in stretches {
            let drive = Drive::from_recording(&compiled, stretch.recording, stretch.range.clone())?;
            let response = compiled.simulate(&Run::new(&drive, &theta).from(Start::Document(stretch.free)));
            let first = frame.stretches.last().map_or(0, |s| s.end);
            frame.stretches.push(first..first + drive.len());
            for (all, output) in series.iter_mut().zip(response.outputs.iter().skip(own)) {
                // Where the run diverged nothing is known: zeros keep the sizes finite.
                all.extend(output.iter().map(|v| if v.is_finite() { *v } else { 0.0 }));
            }
            if drive.len() > longest {
                longest = drive.len();
                frame.start_s = drive.start_s();
                frame.period_s = drive.period_s();
            }
            for input in drive.inputs() {
                let (l, h) = excited_band(input, drive.period_s());
                (low, high) = (low.min(l), high.max(h));
            }
        }
        if longest == 0 {
            return Err(SurveyError::Empty);
        }
        frame.band_hz = if high > 0.0 { (low, high) } else { (0.0, 0.5 / frame.period_s) };
        Ok(Runs { frame, series })
    }
}
