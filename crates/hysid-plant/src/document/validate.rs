//! What a well-formed simulation is, beyond its syntax.

use std::collections::{BTreeMap, BTreeSet};

use super::{ClockSource, Initial, Output, Simulation};
use crate::error::{Error, ErrorKind};
use crate::expr::{Expr, is_identifier, is_reserved};
use crate::still::is_constant;

/// A place in the value of a key.
pub(crate) enum Within {
    /// All of it.
    Value,
    /// This byte of an expression.
    Byte(usize),
    /// A use of a symbol or operator in an expression, the first being number 0.
    Use(String, usize),
}

/// A fault before its place in the text is known.
pub(crate) struct Fault {
    /// The key, `#key` appended where the key itself is at fault and not its value.
    pub key: String,
    /// Where in the value of that key.
    pub within: Within,
    /// What is wrong.
    pub kind: ErrorKind,
}

impl Fault {
    /// A fault of the value at `key`.
    pub fn of(key: impl Into<String>, kind: ErrorKind) -> Self {
        Self { key: key.into(), within: Within::Value, kind }
    }

    /// A fault at one use of a symbol or operator in the expression at `key`, the first being number 0.
    pub fn at_use(key: impl Into<String>, symbol: &str, number: usize, kind: ErrorKind) -> Self {
        Self { key: key.into(), within: Within::Use(symbol.to_owned(), number), kind }
    }
}

fn fault(key: impl Into<String>, kind: ErrorKind) -> Fault {
    Fault::of(key, kind)
}

fn fault_in(key: &str, symbol: &str, kind: ErrorKind) -> Fault {
    Fault::at_use(key, symbol, 0, kind)
}

fn constant_output(output: &Output) -> Fault {
    let message = "this output depends on no state and no input: it is a constant".to_owned();
    fault(format!("outputs.{}", output.column), ErrorKind::NothingDrivesOutput(message))
}

impl Simulation {
    /// Checks the document: names, bounds, symbols, initial values, units, outputs.
    ///
    /// # Errors
    /// The first fault, without a file or place.
    pub fn validate(&self) -> Result<(), Error> {
        match self.first_fault() {
            None => Ok(()),
            Some(f) => {
                Err(Error { file: None, place: None, key: f.key.trim_end_matches("#key").to_owned(), kind: f.kind })
            }
        }
    }

    pub(crate) fn first_fault(&self) -> Option<Fault> {
        let checks = [
            Self::fault_in_time,
            Self::fault_in_names,
            Self::fault_in_parameters,
            Self::fault_in_symbols,
            Self::fault_in_initial_values,
            Self::fault_in_memory,
            Self::fault_in_units,
            Self::fault_in_outputs,
        ];
        checks.iter().find_map(|check| check(self))
    }

    fn fault_in_time(&self) -> Option<Fault> {
        match &self.time.clock {
            ClockSource::Period(period) if !(period.is_finite() && *period > 0.0) => {
                let allowed = "a finite number above 0 is needed".to_owned();
                Some(fault(
                    "time.period_s",
                    ErrorKind::BadNumber { what: "the sampling period", value: *period, allowed },
                ))
            }
            ClockSource::Column(column) if column.is_empty() => {
                Some(fault("time.column", ErrorKind::Missing("name of the time column")))
            }
            _ => None,
        }
    }

    fn fault_in_names(&self) -> Option<Fault> {
        let mut seen: BTreeMap<&str, String> = BTreeMap::new();
        let inputs = self.inputs.iter().map(|i| ("inputs", &i.symbol, "an input"));
        let parameters = self.parameters.iter().map(|p| ("parameters", &p.name, "a parameter"));
        let states = self.states.iter().map(|s| ("states", &s.name, "a state"));
        for (table, name, what) in inputs.chain(parameters).chain(states) {
            let key = format!("{table}.{name}#key");
            if is_reserved(name) {
                return Some(fault(key, ErrorKind::Reserved(name.clone())));
            }
            if !is_identifier(name) {
                return Some(fault(key, ErrorKind::BadSymbol(name.clone())));
            }
            if let Some(earlier) = seen.insert(name, what.to_owned()) {
                return Some(fault(key, ErrorKind::Duplicate { name: name.clone(), earlier }));
            }
        }
        let mut columns: BTreeMap<&str, String> = BTreeMap::new();
        if let ClockSource::Column(column) = &self.time.clock {
            columns.insert(column, "the time column".to_owned());
        }
        for input in &self.inputs {
            let key = format!("inputs.{}", input.symbol);
            if input.column.is_empty() {
                return Some(fault(key, ErrorKind::Missing("name of a column")));
            }
            // Two symbols may read one column; the time column is not an input (`t` is there for that).
            if let Some(earlier) = columns.get(input.column.as_str()).filter(|e| e.starts_with("the time")) {
                let name = input.column.clone();
                return Some(fault(key, ErrorKind::Duplicate { name, earlier: earlier.clone() }));
            }
        }
        for input in &self.inputs {
            columns.insert(&input.column, format!("the column of input `{}`", input.symbol));
        }
        for output in &self.outputs {
            let key = format!("outputs.{}#key", output.column);
            if output.column.is_empty() {
                return Some(fault(key, ErrorKind::Missing("name of a column")));
            }
            if let Some(earlier) = columns.insert(&output.column, "an output".to_owned()) {
                return Some(fault(key, ErrorKind::Duplicate { name: output.column.clone(), earlier }));
            }
        }
        None
    }

    fn fault_in_parameters(&self) -> Option<Fault> {
        for p in &self.parameters {
            let key = |field: &str| format!("parameters.{}.{field}", p.name);
            let bad = |field: &str, what, value, allowed: String| {
                Some(fault(key(field), ErrorKind::BadNumber { what, value, allowed }))
            };
            for (field, what, value) in [
                ("value", "the value", Some(p.value)),
                ("min", "the lower bound", p.min),
                ("max", "the upper bound", p.max),
            ] {
                if let Some(value) = value.filter(|v| !v.is_finite()) {
                    return bad(field, what, value, "a finite number is needed".to_owned());
                }
            }
            if let (Some(min), Some(max)) = (p.min, p.max)
                && (min > max || (min == max && !p.fixed))
            {
                return bad("min", "the lower bound", min, format!("it must be below the upper bound {max}"));
            }
            if let Some(min) = p.min.filter(|min| p.value < *min) {
                return bad("value", "the value", p.value, format!("it is below its lower bound {min}"));
            }
            if let Some(max) = p.max.filter(|max| p.value > *max) {
                return bad("value", "the value", p.value, format!("it is above its upper bound {max}"));
            }
            if !p.fixed && p.min.is_none() && p.max.is_none() {
                return Some(fault(format!("parameters.{}", p.name), ErrorKind::MissingBound));
            }
        }
        None
    }

    fn fault_in_symbols(&self) -> Option<Fault> {
        for (key, expr) in self.expressions() {
            let mut bad = None;
            expr.visit(&mut |e| {
                if let Expr::Number(value) = e
                    && !value.is_finite()
                {
                    bad = Some(*value);
                }
            });
            if let Some(value) = bad {
                let allowed = "only finite numbers can stand in an equation".to_owned();
                return Some(fault(key, ErrorKind::BadNumber { what: "a literal", value, allowed }));
            }
            for symbol in expr.symbols() {
                if symbol == "t" || symbol == "pi" || self.defines(&symbol) {
                    continue;
                }
                let hint = self.hint(&symbol);
                return Some(fault_in(&key, &symbol, ErrorKind::UnknownSymbol { symbol: symbol.clone(), hint }));
            }
        }
        None
    }

    fn hint(&self, symbol: &str) -> String {
        let known = self.inputs.iter().map(|i| &i.symbol).chain(self.parameters.iter().map(|p| &p.name));
        let known: Vec<&String> = known.chain(self.states.iter().map(|s| &s.name)).collect();
        if let Some(input) = self.inputs.iter().find(|i| i.column == symbol) {
            return format!("; the column `{symbol}` is called `{}` in the equations", input.symbol);
        }
        if let Some(near) = known.iter().find(|k| k.eq_ignore_ascii_case(symbol)) {
            return format!("; is `{near}` meant?");
        }
        let names: Vec<&str> = known.iter().map(|s| s.as_str()).collect();
        format!("; known: {} t pi", names.join(" "))
    }

    fn fault_in_initial_values(&self) -> Option<Fault> {
        let initial = |name: &str| match self.state(name).map(|s| &s.initial) {
            Some(Initial::Expr(e)) => e.symbols(),
            _ => BTreeSet::new(),
        };
        for state in &self.states {
            let key = format!("states.{}.initial", state.name);
            match &state.initial {
                Initial::Free => {}
                Initial::Number(value) => {
                    if !value.is_finite() {
                        let allowed = "a finite number is needed".to_owned();
                        return Some(fault(
                            key,
                            ErrorKind::BadNumber { what: "the initial value", value: *value, allowed },
                        ));
                    }
                }
                Initial::Expr(expr) => {
                    for symbol in expr.symbols() {
                        if self.state(&symbol).is_some() {
                            // Follow the uses: a ring is named as such.
                            let mut path = vec![state.name.clone(), symbol.clone()];
                            while let Some(next) =
                                path.last().and_then(|last| initial(last).into_iter().find(|s| self.state(s).is_some()))
                            {
                                let closed = path.contains(&next);
                                path.push(next);
                                if closed {
                                    return Some(fault_in(&key, &symbol, ErrorKind::Cycle(path.join(" -> "))));
                                }
                            }
                            if symbol == state.name {
                                let kind = ErrorKind::Cycle(format!("{symbol} -> {symbol}"));
                                return Some(fault_in(&key, &symbol, kind));
                            }
                            return Some(fault_in(&key, &symbol, ErrorKind::InitialUsesState(symbol.clone())));
                        }
                        if self.input(&symbol).is_some() || symbol == "t" {
                            return Some(fault_in(&key, &symbol, ErrorKind::InitialNotConstant(symbol.clone())));
                        }
                    }
                    if expr.has_memory() {
                        let message = "an initial value cannot contain an operator with memory".to_owned();
                        return Some(fault(key, ErrorKind::Memory(message)));
                    }
                }
            }
        }
        None
    }

    fn fault_in_units(&self) -> Option<Fault> {
        crate::dimension::first_clash(self).map(|(key, message)| fault(key, ErrorKind::UnitClash(message)))
    }

    /// An output whose states and inputs cancel (`x - x`). No fault of a simulation that is made to look at quantities, of which one may stand still:
    /// only files are held to it.
    pub(crate) fn cancelled_output(&self) -> Option<Fault> {
        let constant = |o: &&Output| is_constant(&o.expression, &|s| self.moves(s));
        self.outputs.iter().find(constant).map(constant_output)
    }

    /// Whether a symbol changes during a run.
    fn moves(&self, symbol: &str) -> bool {
        symbol == "t" || self.input(symbol).is_some() || self.state(symbol).is_some()
    }

    fn fault_in_outputs(&self) -> Option<Fault> {
        if self.outputs.is_empty() {
            return Some(fault("outputs", ErrorKind::NothingDrivesOutput("there is no output".to_owned())));
        }
        // What each symbol rests on, through the equations: states that a state's derivative uses.
        for output in &self.outputs {
            if !output.expression.symbols().iter().any(|s| self.moves(s)) {
                return Some(constant_output(output));
            }
        }
        let uses_state = |e: &Expr| e.symbols().iter().any(|s| self.state(s).is_some());
        if !self.is_static() && !self.outputs.iter().any(|o| uses_state(&o.expression)) {
            let message = "no output depends on any state: nothing could be learnt about the equations".to_owned();
            let key = self.outputs.first().map_or_else(String::new, |o| format!("outputs.{}", o.column));
            return Some(fault(key, ErrorKind::NothingDrivesOutput(message)));
        }
        None
    }
}
