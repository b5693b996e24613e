//! Where a law's text goes: into the equations at its slot.

use std::collections::BTreeMap;

use hysid_plant::{Expr, Memory, Output, Simulation};

use super::Change;
use super::copies::{follow, renewed};
use crate::slot::{Felt, ForcePath, Pull, Slot, Target, force_path, play_of};

/// The law's own names and the names that they have in the simulation.
pub(super) struct Writer<'a> {
    pub slot: &'a Slot,
    pub own: BTreeMap<String, String>,
}

impl Writer<'_> {
    /// The same for a text in which these names stand for parts of the equations that are put in later, written `?name`: no symbol of a user's is so called.
    fn beside(&self, names: &[&str]) -> Self {
        let mut own = self.own.clone();
        own.extend(names.iter().map(|name| ((*name).to_owned(), format!("?{name}"))));
        Self { slot: self.slot, own }
    }

    /// A text of the law in the simulation's symbols.
    pub fn text(&self, text: &str) -> Result<Expr, String> {
        let parsed = Expr::parse(text).map_err(|e| format!("`{text}`: {e}"))?;
        let mut unknown = None;
        let written = parsed.map(&mut |e| match e {
            Expr::Symbol(name) if name != "t" && name != "pi" => {
                if let Some(own) = self.own.get(&name) {
                    Expr::symbol(own)
                } else if let Some(quantity) = self.slot.quantity(&name) {
                    quantity.expression.clone()
                } else {
                    unknown = Some(name.clone());
                    Expr::Symbol(name)
                }
            }
            other => other,
        });
        match unknown {
            Some(name) => Err(format!("`{text}` uses `{name}`, which is not offered here")),
            None => Ok(written.simplified()),
        }
    }
}

/// The outputs that measure the derivative of a state, or what holds it, each with the multiple.
fn sensors<'s>(
    simulation: &'s mut Simulation,
    slot: &'s Slot,
    state: &'s str,
) -> impl Iterator<Item = (&'s mut Output, &'s Felt, f64)> {
    let sensed = move |o: &Output| slot.sensed.iter().find(|s| s.state == state && s.column == o.column);
    simulation.outputs.iter_mut().filter_map(move |o| sensed(o).map(|s| (o, &s.felt, s.times)))
}

/// Gives a state another derivative, and to whatever else holds the old one. The outputs that measure it have been seen to.
fn derive(simulation: &mut Simulation, slot: &Slot, name: &str, before: &Expr, after: Expr) {
    let seen: Vec<&str> = slot.sensed.iter().filter(|s| s.state == name).map(|s| s.column.as_str()).collect();
    follow(simulation, name, before, &after, &seen);
    if let Some(state) = simulation.state_mut(name) {
        state.derivative = after;
    }
}

/// An expression that is changed but for the rates of inputs in it: those of what a law makes of an input are none.
fn with_its_rates(e: &Expr, change: impl Fn(Expr) -> Expr) -> Expr {
    let mut rates = Vec::new();
    let name = |i: usize| Expr::symbol(format!("?rate{i}"));
    let hidden = e.clone().map(&mut |part| match part {
        Expr::Memory(Memory::Derivative, _) => {
            rates.push(part);
            name(rates.len() - 1)
        }
        other => other,
    });
    rates.iter().enumerate().fold(change(hidden), |e, (i, rate)| e.replace(&name(i), rate))
}

/// Writes the law's text at its target.
pub(super) fn enter(
    simulation: &mut Simulation,
    slot: &Slot,
    change: &Change,
    writer: &Writer<'_>,
) -> Result<(), String> {
    match (&slot.target, change) {
        (Target::Symbol(symbol), Change::Replace(text)) => {
            let by = writer.text(text)?;
            simulation.map_equations(|e| with_its_rates(e, |e| e.substitute(symbol, &by)));
            Ok(())
        }
        (Target::SymbolIn(symbol, states, others), Change::Replace(text)) => {
            let by = match others {
                // The sum is replaced where the symbol stands; its other members stay in the equations and are taken off here.
                Some(others) => writer.text(text)? - others.clone(),
                None => writer.text(text)?,
            };
            for name in states {
                let state = simulation.state_mut(name).ok_or("the state is gone")?;
                state.derivative = state.derivative.substitute(symbol, &by);
            }
            Ok(())
        }
        (Target::PartIn(part, states), Change::Replace(text)) => {
            let by = writer.text(text)?;
            for name in states {
                let state = simulation.state_mut(name).ok_or("the state is gone")?;
                state.derivative = state.derivative.replace(part, &by);
            }
            Ok(())
        }
        (Target::HalfWidths(symbol), Change::Replace(text)) => {
            let by = writer.beside(&["r"]).text(text)?;
            let widened = |(w, r): (&Expr, &Expr)| w.clone().play(by.substitute("?r", r));
            simulation.map_equations(|e| e.map(&mut |part| play_of(&part, symbol).map(widened).unwrap_or(part)));
            Ok(())
        }
        (Target::Output(column), Change::Replace(text)) => {
            let by = writer.text(text)?;
            let output = simulation.output_mut(column).ok_or("the output is gone")?;
            output.expression = by;
            Ok(())
        }
        (Target::Output(column), Change::Force(text) | Change::Drive(text)) => {
            let force = writer.text(text)?;
            let output = simulation.output_mut(column).ok_or("the output is gone")?;
            let taken = slot.pulls && matches!(change, Change::Force(_));
            let before = output.expression.clone();
            output.expression = if taken { before - force.clone() } else { before + force.clone() };
            if let Some(pull) = &slot.feeds_back {
                let derivative = simulation.state(&pull.state).ok_or("the state is gone")?.derivative.clone();
                let felt = pull.join(derivative.clone(), pull.of(&force), if taken { -1.0 } else { 1.0 });
                derive(simulation, slot, &pull.state, &derivative, felt);
            }
            Ok(())
        }
        (Target::Outputs(seen), Change::Outputs(texts)) => {
            for (seen, text) in seen.iter().zip(texts) {
                let output = simulation.output_mut(&seen.column).ok_or("the output is gone")?;
                output.expression = output.expression.clone() + writer.text(text)?;
            }
            Ok(())
        }
        (Target::Derivatives(states), Change::Force(text) | Change::Drive(text) | Change::Outflow(text)) => {
            let force = writer.text(text)?;
            let resists = if matches!(change, Change::Drive(_)) { -1.0 } else { 1.0 };
            for pull in states {
                let (name, whole, force) = (&pull.state, &force, pull.of(&force));
                let derivative = simulation.state(name).ok_or("the state is gone")?.derivative.clone();
                let joined = |sum: Expr, part: &Expr| pull.join(sum, part.clone(), resists);
                let (written, rate) = match force_path(simulation, &derivative) {
                    ForcePath::Quotient(above, below) => {
                        (joined(above.clone(), &force) / below.clone(), force.clone() / below.clone())
                    }
                    ForcePath::Divided(mass) => {
                        let rate = force.clone() / mass.clone();
                        (joined(derivative.clone(), &rate), rate)
                    }
                    ForcePath::Bare => (joined(derivative.clone(), &force), force.clone()),
                };
                for (output, felt, times) in sensors(simulation, slot, name) {
                    let (part, resists) = match felt {
                        Felt::Rate => (Expr::Number(times) * rate.clone(), resists),
                        Felt::Force => {
                            ((Expr::Number(times.abs()) * force.clone()).simplified(), resists * times.signum())
                        }
                        Felt::Share(share) => ((share.clone() * whole.clone()).simplified(), resists * times.signum()),
                    };
                    output.expression = pull.join(output.expression.clone(), part, resists);
                }
                derive(simulation, slot, name, &derivative, written);
            }
            Ok(())
        }
        (_, Change::Separation { at, by }) => separation(simulation, slot, (at, by), writer),
        (Target::Derivatives(states), Change::Inertia { force, mass }) => {
            let (force, more) = (writer.text(force)?, writer.text(mass)?);
            for Pull { state: name, .. } in states {
                let derivative = simulation.state(name).ok_or("the state is gone")?.derivative.clone();
                let written = match force_path(simulation, &derivative) {
                    ForcePath::Quotient(above, below) => {
                        (above.clone() - force.clone()) / (below.clone() + more.clone())
                    }
                    ForcePath::Divided(mass) => {
                        (derivative.clone() - force.clone() / mass.clone())
                            / (Expr::Number(1.0) + more.clone() / mass.clone())
                    }
                    ForcePath::Bare => (derivative.clone() - force.clone()) / (Expr::Number(1.0) + more.clone()),
                };
                // A cell that feels what holds the part feels nothing of its inertia.
                for (output, _, times) in sensors(simulation, slot, name).filter(|(_, felt, _)| **felt == Felt::Rate) {
                    let change = Expr::Number(times) * (written.clone() - derivative.clone());
                    output.expression = output.expression.clone() + change;
                }
                derive(simulation, slot, name, &derivative, written);
            }
            Ok(())
        }
        _ => Err("this kind of law cannot stand at this kind of slot".to_owned()),
    }
}

/// The separation of the slot's equations, wherever it stands, as the law has it.
fn separation(
    simulation: &mut Simulation,
    slot: &Slot,
    (at, by): (&str, &str),
    writer: &Writer<'_>,
) -> Result<(), String> {
    let steady = slot.separation().ok_or("the equations here have no separation")?;
    let Some(Expr::Symbol(angle)) = slot.quantity("x").map(|q| q.expression.clone()) else {
        return Err("the angle is no signal of its own".to_owned());
    };
    let ahead = steady.substitute(&angle, &writer.text(at)?);
    let mut by = writer.beside(&["steady", "ahead"]).text(by)?;
    for (name, part) in [("?steady", &steady), ("?ahead", &ahead)] {
        by = by.substitute(name, part);
    }
    // What was put in is not looked through again: it holds the function that it stands for.
    let held = Expr::symbol("?held");
    simulation.map_equations(|e| e.map(&mut |part| renewed(part, &steady, &held)).substitute("?held", &by));
    Ok(())
}
