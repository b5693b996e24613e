//! Writing a mechanism's law into a simulation.

use std::collections::BTreeMap;

use hysid_plant::{Expr, Initial, Parameter, Simulation, State, Unit};

use super::enter::{Writer, enter};
use super::rewritten::{Amplitude, Places, Reported, Rewritten, Shape};
use super::signals::Signals;
use super::{Amplitudes, Change, Grid, Law, Mechanism, Purpose, Role, Start};
use crate::slot::Slot;

/// Why a law could not be written into a simulation: a fault of the catalogue, not of the user.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("`{mechanism}` at `{slot}`: {reason}")]
pub struct RewriteError {
    /// The mechanism.
    pub mechanism: &'static str,
    /// The slot.
    pub slot: String,
    /// What is wrong.
    pub reason: String,
}

/// The unit of a measure at a slot, its factors in the order in which they are printed.
fn unit_of_measure(slot: &Slot, measure: &Expr) -> Option<Unit> {
    Unit::parse(&product_of_units(slot, measure)?.to_string()).ok()
}

fn product_of_units(slot: &Slot, measure: &Expr) -> Option<Unit> {
    use hysid_plant::BinaryOp::{Div, Mul, Pow};
    match measure {
        Expr::Number(_) => Some(Unit::none()),
        Expr::Symbol(s) if matches!(s.as_str(), "t" | "T" | "h" | "h_u") => Unit::parse("s").ok(),
        Expr::Symbol(s) => slot.quantity(s)?.unit.clone(),
        Expr::Binary(Mul, a, b) => Some(product_of_units(slot, a)?.times(&product_of_units(slot, b)?)),
        Expr::Binary(Div, a, b) => Some(product_of_units(slot, a)?.per(&product_of_units(slot, b)?)),
        Expr::Binary(Pow, a, b) => match **b {
            Expr::Number(0.5) => product_of_units(slot, a)?.root(),
            Expr::Number(n) if n.fract() == 0.0 && n.abs() < 9.0 => Some(product_of_units(slot, a)?.power(n as i32)),
            _ => None,
        },
        _ => None,
    }
}

/// The unit that a reported quantity is told in, in few names. What a law measures in turns per time is a frequency: `Hz`, not `1/s`.
fn unit_told(slot: &Slot, measure: &str) -> Option<Unit> {
    let unit = unit_of_measure(slot, &Expr::parse(measure).ok()?)?;
    if measure == "1/t" && unit.to_string() == "1/s" { Unit::parse("Hz").ok() } else { Some(unit.briefly()) }
}

impl Mechanism {
    /// The simulation with this mechanism at a slot.
    ///
    /// Amplitudes and shapes are scaled by what is known of the slot's signals. Names that the simulation already uses get a
    /// number, so that a simulation can be rewritten again and again. With [`Purpose::Screening`] every amplitude at zero is
    /// the baseline bit for bit; with [`Purpose::Refit`] the values of [`Rewritten::neutral`] are.
    ///
    /// # Errors
    /// A law that does not fit its slot: the conformance suite holds that this does not happen for the slots that
    /// [`Mechanism::slots`] gives.
    pub fn rewrite(
        &self,
        simulation: &Simulation,
        slot: &Slot,
        signals: &Signals,
        purpose: Purpose,
    ) -> Result<Rewritten, RewriteError> {
        let law = self.law_at(slot, purpose);
        let mut written = write_law(simulation, slot, signals, &law, purpose).map_err(|reason| RewriteError {
            mechanism: self.id,
            slot: slot.label.clone(),
            reason,
        })?;
        // What takes the place of another leaves nothing of it, whatever the user took for its least value.
        let own = self.stands_for(slot).filter(|_| purpose != Purpose::Screening);
        if let Some(least) = own.and_then(|own| written.simulation.parameter_mut(own)).and_then(|p| p.min.as_mut()) {
            *least = least.min(0.0);
        }
        Ok(written)
    }
}

/// Takes the units from what a law added to a simulation. Where a column's name ends in what is not its unit (`valve_A` for the first of two
/// valves), units made of it clash with those that the file declares, and no law would be compared there.
fn without_units(written: &mut Simulation, before: &Simulation) {
    written.parameters.iter_mut().filter(|p| before.parameter(&p.name).is_none()).for_each(|p| p.unit = None);
    written.states.iter_mut().filter(|s| before.state(&s.name).is_none()).for_each(|s| s.unit = None);
}

fn write_law(
    simulation: &Simulation,
    slot: &Slot,
    signals: &Signals,
    law: &Law,
    purpose: Purpose,
) -> Result<Rewritten, String> {
    let mut written = simulation.clone();
    let mut writer = Writer { slot, own: BTreeMap::new() };
    let mut amplitudes = Vec::new();
    let mut shapes = Vec::new();
    let mut neutral = Vec::new();
    let multiple = |times: f64, measure: &str| {
        let size = Expr::parse(measure).ok().and_then(|m| signals.size_of(&m));
        size.map(|size| times * size)
    };
    for parameter in &law.parameters {
        let measure = Expr::parse(&parameter.measure).map_err(|e| format!("`{}`: {e}", parameter.measure))?;
        let size = signals.size_of(&measure).filter(|s| s.is_finite() && *s > 0.0).unwrap_or(1.0);
        let name = written.fresh_symbol(&parameter.name);
        writer.own.insert(parameter.name.clone(), name.clone());
        let mut new = Parameter::new(&name, 0.0);
        new.unit = unit_of_measure(slot, &measure);
        match &parameter.role {
            Role::Amplitude => {
                let (low, high) = parameter.range.unwrap_or((-1.0, 1.0));
                new = new.within(low * size, high * size);
                amplitudes.push(Amplitude { name: name.clone(), size });
            }
            Role::Shape(grid) => {
                let mut values = signals.values(grid, size);
                let (mut low, mut high) = match parameter.range {
                    Some((low, high)) => (low * size, high * size),
                    None => signals.bounds(grid, &values),
                };
                if let Grid::Turns(..) = grid {
                    low = low.max(signals.shortest_period);
                    high = high.max(low);
                }
                if let Some((measure, times)) = &parameter.floor {
                    low = low.max(multiple(*times, measure).unwrap_or(low));
                    high = high.max(3.0 * low);
                }
                values.iter_mut().for_each(|v| *v = v.clamp(low, high));
                values.dedup();
                new.value = values.get(values.len() / 2).copied().unwrap_or(size);
                new = new.within(low, high);
                let (searched, places) = (parameter.searched, Places::of(grid));
                let from = parameter.told_from.as_ref();
                let told_from = from.and_then(|(measure, times, below)| Some((multiple(*times, measure)?, *below)));
                let travel = parameter.elastic.then(|| 2.0 * signals.reach("x")).filter(|travel| *travel > 0.0);
                let (name, grid, pointed, over) =
                    (name.clone(), values, signals.pointed(grid).to_vec(), signals.over(grid));
                shapes.push(Shape { name, grid, pointed, searched, places, over, told_from, travel });
            }
            Role::Constant(grid) => {
                new.value = signals.values(grid, size).first().copied().unwrap_or(size);
                new.fixed = true;
            }
        }
        if let Some(value) = parameter.neutral {
            neutral.push((name.clone(), value * size));
        }
        written.parameters.push(new);
    }
    for state in &law.states {
        let name = written.fresh_symbol(&state.name);
        writer.own.insert(state.name.clone(), name.clone());
        let measure = Expr::parse(&state.measure).map_err(|e| format!("`{}`: {e}", state.measure))?;
        let like = |symbol: &str| match slot.quantity(symbol).map(|q| &q.expression) {
            Some(Expr::Symbol(s)) => simulation.state(s).map(|s| s.initial.clone()),
            _ => None,
        };
        let initial = match state.start {
            Start::Zero => Initial::Number(0.0),
            Start::Like(symbol) => like(symbol).unwrap_or(Initial::Number(0.0)),
            Start::Free => Initial::Free,
        };
        written.states.push(State {
            name,
            derivative: Expr::Number(0.0),
            initial,
            unit: unit_of_measure(slot, &measure),
        });
    }
    let mut states = Vec::new();
    for state in &law.states {
        let derivative = writer.text(&state.derivative)?;
        if let Some(name) = writer.own.get(&state.name) {
            states.push(name.clone());
            if let Some(state) = written.state_mut(name) {
                state.derivative = derivative;
            }
        }
    }
    enter(&mut written, slot, &law.change, &writer)?;
    if !written.units_agree() {
        without_units(&mut written, simulation);
    }
    let mut report = Vec::new();
    for parameter in law.parameters.iter().filter(|p| p.reported) {
        let value = writer.text(&parameter.name)?;
        let unit = unit_told(slot, &parameter.measure);
        report.push(Reported { name: parameter.name.clone(), unit, value });
    }
    for derived in &law.derived {
        let unit = unit_told(slot, &derived.measure);
        report.push(Reported { name: derived.name.clone(), unit, value: writer.text(&derived.value)? });
    }
    if law.never_baseline {
        neutral.clear();
    } else if !amplitudes.is_empty() {
        neutral.retain(|(name, _)| amplitudes.iter().any(|a| a.name == *name));
    }
    let linear = purpose == Purpose::Screening && !matches!(law.change, Change::Inertia { .. });
    Ok(Rewritten {
        simulation: written,
        amplitudes,
        shapes,
        neutral,
        apart: law.amplitudes == Amplitudes::Apart,
        linear,
        report,
        states,
        sum_of_others: law.sum_of_others,
        purpose,
    })
}
