//! The document model: a simulation as the user wrote it, public, ordered and editable.
//!
//! Whoever edits a [`Simulation`] calls [`Simulation::validate`] before use; [`crate::Compiled::new`] does so too.

mod memory;
mod read;
mod validate;
mod write;

use crate::expr::Expr;
use crate::unit::Unit;

pub use read::LARGEST_FILE;

/// An ordinary differential equation or static relation, with its parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct Simulation {
    /// One line for people.
    pub title: String,
    /// The clock.
    pub time: Time,
    /// What drives it, in the order of the file.
    pub inputs: Vec<Input>,
    /// Constants, estimated or fixed.
    pub parameters: Vec<Parameter>,
    /// Differential equations; none for a static relation.
    pub states: Vec<State>,
    /// What is measured.
    pub outputs: Vec<Output>,
}

/// Where time comes from and what an input does between samples.
#[derive(Debug, Clone, PartialEq)]
pub struct Time {
    /// The clock.
    pub clock: ClockSource,
    /// The inputs between samples.
    pub hold: Hold,
}

/// Where the clock comes from.
#[derive(Debug, Clone, PartialEq)]
pub enum ClockSource {
    /// A column of the recording, in seconds.
    Column(String),
    /// A sampling period in seconds: the recording has no time column.
    Period(f64),
}

/// The value of an input between two samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Hold {
    /// On the straight line between them.
    #[default]
    Linear,
    /// That of the earlier one.
    Zero,
}

/// An input: symbol in the equations, column in the recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Input {
    /// The symbol.
    pub symbol: String,
    /// The recording's column.
    pub column: String,
}

/// A constant of the equations.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// The symbol.
    pub name: String,
    /// The user's value.
    pub value: f64,
    /// Lower bound, if any.
    pub min: Option<f64>,
    /// Upper bound, if any.
    pub max: Option<f64>,
    /// Known: never recalibrated.
    pub fixed: bool,
    /// Its unit, if given.
    pub unit: Option<Unit>,
}

impl Parameter {
    /// An estimated parameter without bounds yet.
    pub fn new(name: impl Into<String>, value: f64) -> Self {
        Self { name: name.into(), value, min: None, max: None, fixed: false, unit: None }
    }

    /// The same with these bounds.
    pub fn within(self, min: f64, max: f64) -> Self {
        Self { min: Some(min), max: Some(max), ..self }
    }

    /// The same, never recalibrated.
    pub fn fixed(self) -> Self {
        Self { fixed: true, ..self }
    }

    /// The same with this unit.
    pub fn with_unit(self, unit: Unit) -> Self {
        Self { unit: Some(unit), ..self }
    }

    /// Lower bound, minus infinity where there is none.
    pub fn lower(&self) -> f64 {
        self.min.unwrap_or(f64::NEG_INFINITY)
    }

    /// Upper bound, infinity where there is none.
    pub fn upper(&self) -> f64 {
        self.max.unwrap_or(f64::INFINITY)
    }
}

/// A state and its differential equation.
#[derive(Debug, Clone, PartialEq)]
pub struct State {
    /// The symbol.
    pub name: String,
    /// Its time derivative.
    pub derivative: Expr,
    /// Its value at the first sample.
    pub initial: Initial,
    /// Its unit, if given.
    pub unit: Option<Unit>,
}

/// A state's value at the first sample.
#[derive(Debug, Clone, PartialEq)]
pub enum Initial {
    /// Known.
    Number(f64),
    /// Estimated, for each recording its own.
    Free,
    /// An expression of parameters.
    Expr(Expr),
}

/// An output: column in the recording, expression of states, inputs and parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct Output {
    /// The recording's column.
    pub column: String,
    /// Its value.
    pub expression: Expr,
}

impl Simulation {
    /// The parameter of that name.
    pub fn parameter(&self, name: &str) -> Option<&Parameter> {
        self.parameters.iter().find(|p| p.name == name)
    }

    /// The parameter of that name, to edit.
    pub fn parameter_mut(&mut self, name: &str) -> Option<&mut Parameter> {
        self.parameters.iter_mut().find(|p| p.name == name)
    }

    /// The state of that name.
    pub fn state(&self, name: &str) -> Option<&State> {
        self.states.iter().find(|s| s.name == name)
    }

    /// The state of that name, to edit.
    pub fn state_mut(&mut self, name: &str) -> Option<&mut State> {
        self.states.iter_mut().find(|s| s.name == name)
    }

    /// The input with that symbol.
    pub fn input(&self, symbol: &str) -> Option<&Input> {
        self.inputs.iter().find(|i| i.symbol == symbol)
    }

    /// The output with that column.
    pub fn output(&self, column: &str) -> Option<&Output> {
        self.outputs.iter().find(|o| o.column == column)
    }

    /// The output with that column, to edit.
    pub fn output_mut(&mut self, column: &str) -> Option<&mut Output> {
        self.outputs.iter_mut().find(|o| o.column == column)
    }

    /// Whether there are no differential equations.
    pub fn is_static(&self) -> bool {
        self.states.is_empty()
    }

    /// Whether the symbol already has a meaning here.
    pub fn defines(&self, symbol: &str) -> bool {
        self.input(symbol).is_some() || self.parameter(symbol).is_some() || self.state(symbol).is_some()
    }

    /// `wanted`, or `wanted_2`, `wanted_3`, ...: the first that is a legal symbol and not yet defined.
    pub fn fresh_symbol(&self, wanted: &str) -> String {
        let free = |name: &str| crate::expr::is_legal_symbol(name) && !self.defines(name);
        if free(wanted) {
            return wanted.to_owned();
        }
        let base = if crate::expr::is_identifier(wanted) { wanted } else { "p" };
        (2..).map(|i| format!("{base}_{i}")).find(|name| free(name)).unwrap_or_default()
    }

    /// Every expression of the document, with the key it stands under (`states.v.derivative`).
    pub fn expressions(&self) -> Vec<(String, &Expr)> {
        let mut all = Vec::new();
        for state in &self.states {
            all.push((format!("states.{}.derivative", state.name), &state.derivative));
            if let Initial::Expr(e) = &state.initial {
                all.push((format!("states.{}.initial", state.name), e));
            }
        }
        all.extend(self.outputs.iter().map(|o| (format!("outputs.{}", o.column), &o.expression)));
        all
    }

    /// Rebuilds every derivative and every output (not the initial values) with `rebuild`.
    pub fn map_equations(&mut self, mut rebuild: impl FnMut(&Expr) -> Expr) {
        self.states.iter_mut().for_each(|s| s.derivative = rebuild(&s.derivative));
        self.outputs.iter_mut().for_each(|o| o.expression = rebuild(&o.expression));
    }

    /// The unit of a symbol: as declared for a parameter or state, from the end of the column's name for an input and for a state of which nothing is
    /// declared that is written out as it stands.
    pub fn unit_of(&self, symbol: &str) -> Option<Unit> {
        self.declared_unit(symbol).or_else(|| {
            if self.state(symbol).is_some() {
                let own = |o: &&Output| matches!(&o.expression, Expr::Symbol(s) if s == symbol);
                return self.outputs.iter().find(own).and_then(|o| Unit::of_column(&o.column));
            }
            Unit::of_column(&self.input(symbol)?.column)
        })
    }

    /// The unit that the file declares for a symbol.
    pub(crate) fn declared_unit(&self, symbol: &str) -> Option<Unit> {
        match symbol {
            "t" => Unit::parse("s").ok(),
            "pi" => Some(Unit::none()),
            _ => match self.parameter(symbol) {
                Some(parameter) => parameter.unit.clone(),
                None => self.state(symbol)?.unit.clone(),
            },
        }
    }
}
