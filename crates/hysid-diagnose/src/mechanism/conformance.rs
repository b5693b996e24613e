//! What every mechanism must satisfy, as a suite that can be run on any simulation.

mod derivatives;
mod motion;
mod recovery;
#[cfg(test)]
mod screened;

use std::collections::BTreeMap;

use hysid_plant::{Expr, Simulation};

use super::sentence::name_in;
use super::{Mechanism, Purpose, Signals, Value, catalogue};
use crate::slot::{Slot, Structure, with_turns};

pub use motion::{Bench, example_recording, jumping_recording};

/// Base simulations of every kind of plant that the catalogue knows.
pub fn specimens() -> Vec<Simulation> {
    let prepared = |text: &str, name: &str| Some(with_turns(&Simulation::parse(text, name).ok()?));
    SPECIMENS.iter().filter_map(|(name, text)| prepared(text, name)).collect()
}

macro_rules! specimens {
    ($($name:literal),* $(,)?) => {
        /// Name and text of each.
        pub const SPECIMENS: &[(&str, &str)] = &[$(($name, include_str!(concat!("specimens/", $name, ".sim.toml")))),*];
    };
}
specimens!(
    "oscillator",
    "servo",
    "two_masses",
    "tank",
    "thermal",
    "actuator",
    "damper",
    "pendulum",
    "wing",
    "motor",
    "filter",
    "controlled_damper",
    "stalling_wing",
    "cylinder",
    "shaker",
    "shaft",
    "stage",
    "brace",
    "bearing",
    "stack",
    "tower",
    "iron"
);

/// A breach of the suite's laws.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Breach {
    /// The mechanism.
    pub mechanism: &'static str,
    /// The simulation's title and the slot.
    pub at: String,
    /// The law that is broken.
    pub what: String,
}

/// Signals as they might be at a slot: a sum of sines for everything that moves, the parameters' values for the rest.
pub fn example_signals(simulation: &Simulation, slot: &Slot) -> Signals {
    let samples = 2000;
    let period_s = 0.01;
    let mut series = BTreeMap::new();
    let mut constants = BTreeMap::new();
    for (i, (symbol, quantity)) in slot.symbols().enumerate() {
        let mut values = quantity.expression.clone();
        for parameter in &simulation.parameters {
            values = values.substitute(&parameter.name, &Expr::Number(parameter.value));
        }
        values = values.substitute("pi", &Expr::Number(std::f64::consts::PI));
        let probe = Signals::new(period_s, 0.0, BTreeMap::new());
        match probe.size_of(&values) {
            Some(value) => {
                constants.insert(symbol.to_owned(), value);
            }
            None => {
                let wave = |n: usize| {
                    let t = period_s * n as f64;
                    let phase = i as f64;
                    (1.0 + 0.5 * (0.7 * t).sin()) * ((3.1 * t + phase).sin() + 0.6 * (11.3 * t + 2.0 * phase).sin())
                };
                series.insert(symbol.to_owned(), (0..samples).map(wave).collect());
            }
        }
    }
    let mut signals = Signals::new(period_s, 0.0, series).held(simulation.time.hold);
    signals.constants = constants;
    signals
}

/// Everything that can be checked without running a simulation: the rewritten file is valid, its units agree, it survives
/// printing and parsing, values are within bounds, the report and the sentence are complete, the needs can be evaluated.
pub fn check_form(
    mechanism: &'static Mechanism,
    simulation: &Simulation,
    slot: &Slot,
    signals: &Signals,
) -> Vec<Breach> {
    let mut breaches = Vec::new();
    let mut breach = |what: String| {
        breaches.push(Breach {
            mechanism: mechanism.id,
            at: format!("{} at {} ({})", simulation.title, slot.label, slot.whereabouts),
            what,
        });
    };
    for purpose in std::iter::once(Purpose::Screening).chain(mechanism.forms(slot).into_iter().map(|(form, _)| form)) {
        let written = match mechanism.rewrite(simulation, slot, signals, purpose) {
            Ok(written) => written,
            Err(e) => {
                breach(e.to_string());
                continue;
            }
        };
        let new = &written.simulation;
        if let Err(e) = new.validate() {
            breach(format!("{purpose:?}: not valid: {e}"));
        }
        match Simulation::parse(&new.to_toml(), "printed") {
            Ok(read) if read == *new => {}
            Ok(_) => breach(format!("{purpose:?}: printed and read again it is another simulation")),
            Err(e) => breach(format!("{purpose:?}: printed it cannot be read: {e}")),
        }
        for name in written.parameters(simulation) {
            let Some(p) = new.parameter(&name) else { continue };
            if !(p.value.is_finite() && p.value >= p.lower() && p.value <= p.upper()) {
                breach(format!("{purpose:?}: {name} = {} is outside {} to {}", p.value, p.lower(), p.upper()));
            }
            if !p.fixed && !(p.lower() < p.upper() && p.lower().is_finite() && p.upper().is_finite()) {
                breach(format!("{purpose:?}: the bounds {} to {} of {name} are not a range", p.lower(), p.upper()));
            }
            let declared = |symbol: &str| slot.quantity(symbol).is_none_or(|q| q.unit.is_some());
            let all_declared = ["x", "v", "u", "y", "F", "s", "m", "k"].iter().all(|s| declared(s));
            if all_declared && p.unit.is_none() {
                breach(format!("{purpose:?}: {name} has no unit although the slot's signals have"));
            }
        }
        for shape in &written.shapes {
            let Some(p) = new.parameter(&shape.name) else { continue };
            if shape.grid.is_empty() || shape.grid.iter().any(|v| !(*v >= p.lower() && *v <= p.upper())) {
                breach(format!("{purpose:?}: the grid of {} leaves its bounds", shape.name));
            }
        }
        if written.starts().is_empty() {
            breach(format!("{purpose:?}: there is no start"));
        }
        if purpose == Purpose::Screening && written.amplitudes.is_empty() {
            breach("nothing to screen: there is no amplitude".to_owned());
        }
        for reported in &written.report {
            for symbol in reported.value.symbols() {
                if symbol != "pi" && new.parameter(&symbol).is_none() {
                    breach(format!("{purpose:?}: the reported {} uses {symbol}, which is no parameter", reported.name));
                }
            }
        }
        if purpose != Purpose::Screening {
            let values: Vec<Value> = written
                .report
                .iter()
                .map(|r| Value { name: r.name.clone(), value: 1.0, unit: r.unit.clone() })
                .collect();
            for named in placeholders(mechanism.sentence, false) {
                if named != "place" && named != "parameter" && !values.iter().any(|v| v.name == named) {
                    breach(format!("the sentence names {named}, which is not reported"));
                }
            }
            let told = mechanism.tell(slot, &values);
            if told.contains(['{', '[']) || told.contains("  ") || !told.ends_with('.') {
                breach(format!("the sentence is not complete: {told}"));
            }
        }
    }
    let _ = mechanism.lacking(signals);
    breaches
}

/// The values that a sentence names: whatever the form is, or those in brackets, which some forms have.
fn placeholders(sentence: &str, in_brackets: bool) -> Vec<&str> {
    let parts = sentence.split(['[', ']']).enumerate().filter(|(i, _)| (i % 2 == 1) == in_brackets);
    let named = parts.flat_map(|(_, part)| part.split('{').skip(1));
    named.filter_map(|part| part.split_once('}').map(|(inside, _)| name_in(inside))).collect()
}

/// [`check_form`] for every mechanism at every slot of a simulation.
pub fn check_simulation(simulation: &Simulation) -> Vec<Breach> {
    let structure = Structure::of(simulation);
    let mut breaches = Vec::new();
    for mechanism in catalogue() {
        for slot in mechanism.slots(&structure) {
            let signals = example_signals(simulation, &slot);
            breaches.extend(check_form(mechanism, simulation, &slot, &signals));
        }
    }
    breaches
}

/// The specimens' sampling period in seconds and the size of their inputs: what moves each through its range.
const EXCITATION: &[(f64, f64)] = &[
    (0.02, 10.0),
    (0.01, 60.0),
    (0.01, 1.0),
    (0.2, 2.0),
    (5.0, 200.0),
    (0.01, 40.0),
    (0.01, 4.0),
    (0.02, 1.0),
    (0.01, 12.0),
    (0.02, 6.0),
    (1e-5, 0.5),
    (0.01, 4.0),
    (0.01, 16.0),
    (0.002, 100.0),
    (0.0004, 10.0),
    (0.01, 1.0),
    (0.01, 4.0),
    (0.002, 20.0),
    (0.002, 4.0),
    (0.01, 40.0),
    (0.02, 10.0),
    (0.01, 300.0),
];

/// A bench for each specimen.
pub fn benches() -> Vec<Bench> {
    specimens().iter().zip(EXCITATION).filter_map(|(s, (period_s, size))| Bench::new(s, *period_s, *size)).collect()
}

/// The first slot of a mechanism in the specimens for which something holds.
#[cfg(test)]
pub(crate) fn slot_where(mechanism: &Mechanism, wanted: impl Fn(&Slot) -> bool) -> Option<Slot> {
    specimens().iter().flat_map(|s| mechanism.slots(&Structure::of(s))).find(wanted)
}

#[cfg(test)]
mod tests;
