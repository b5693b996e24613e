//! Parameters by name: what kinds there are, and reading them from text.

use crate::ParameterError;

/// A parameter of a catalogue entry.
#[derive(Debug, Clone, Copy)]
pub struct Parameter {
    /// Its name.
    pub name: &'static str,
    /// What it is, and its default.
    pub kind: Kind,
    /// What it means, with its unit.
    pub meaning: &'static str,
    /// Another parameter and the value that it must have for this one to matter, if there is one.
    pub matters_with: Option<(&'static str, &'static str)>,
}

impl Parameter {
    pub(super) const fn number(name: &'static str, default: f64, meaning: &'static str) -> Self {
        Self { name, kind: Kind::Number(default), meaning, matters_with: None }
    }

    pub(super) const fn count(name: &'static str, default: usize, meaning: &'static str) -> Self {
        Self { name, kind: Kind::Count(default), meaning, matters_with: None }
    }

    pub(super) const fn choice(name: &'static str, choices: &'static [&'static str], meaning: &'static str) -> Self {
        Self { name, kind: Kind::Choice(choices), meaning, matters_with: None }
    }

    pub(super) const fn with(self, name: &'static str, value: &'static str) -> Self {
        Self { matters_with: Some((name, value)), ..self }
    }

    /// The default as text.
    pub fn default_text(&self) -> String {
        match self.kind {
            Kind::Number(v) => v.to_string(),
            Kind::Count(c) => c.to_string(),
            Kind::Choice(choices) => choices[0].to_string(),
        }
    }
}

/// What kind of value a parameter has.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    /// A number, with its default.
    Number(f64),
    /// A whole number of 0 or more, with its default.
    Count(usize),
    /// One of several words; the first is the default.
    Choice(&'static [&'static str]),
}

/// Why a catalogue entry could not be built.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CatalogueError {
    /// The operator has no parameter of this name.
    #[error("{operator} has no parameter `{name}`; it has {known}")]
    UnknownParameter {
        /// The operator.
        operator: &'static str,
        /// The name given.
        name: String,
        /// The names it has.
        known: String,
    },
    /// A value that is not allowed.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Value {
    Number(f64),
    Count(usize),
    Choice(&'static str),
}

/// The values of an entry's parameters.
#[derive(Debug, Clone)]
pub struct Values {
    values: Vec<(&'static str, Value)>,
}

impl Values {
    pub(super) fn new(
        operator: &'static str,
        parameters: &'static [Parameter],
        set: &[(String, String)],
    ) -> Result<Self, CatalogueError> {
        if let Some((name, _)) = set.iter().find(|(name, _)| parameters.iter().all(|p| p.name != name)) {
            let known = parameters.iter().map(|p| p.name).collect::<Vec<_>>().join(", ");
            return Err(CatalogueError::UnknownParameter { operator, name: name.clone(), known });
        }
        let values = parameters.iter().map(|parameter| {
            let text = set.iter().rev().find(|(name, _)| parameter.name == name).map(|(_, text)| text.trim());
            let refuse = |what: String| {
                let given = format!("{} = {}", parameter.name, text.unwrap_or_default());
                ParameterError { operator, given, allowed: format!("{} must be {what}", parameter.name) }
            };
            let value = match (parameter.kind, text) {
                (Kind::Number(default), None) => Value::Number(default),
                (Kind::Number(_), Some(text)) => Value::Number(text.parse().map_err(|_| refuse("a number".into()))?),
                (Kind::Count(default), None) => Value::Count(default),
                (Kind::Count(_), Some(text)) => {
                    Value::Count(whole(text).ok_or_else(|| refuse("a whole number of 0 or more".into()))?)
                }
                (Kind::Choice(choices), None) => Value::Choice(choices[0]),
                (Kind::Choice(choices), Some(text)) => match choices.iter().find(|choice| **choice == text) {
                    Some(choice) => Value::Choice(choice),
                    None => return Err(refuse(format!("one of {}", choices.join(", ")))),
                },
            };
            Ok((parameter.name, value))
        });
        Ok(Self { values: values.collect::<Result<_, _>>()? })
    }

    fn value(&self, name: &str) -> Option<Value> {
        self.values.iter().find(|(n, _)| *n == name).map(|(_, value)| *value)
    }

    /// A number; not a number where the entry has none of this name, which every operator then refuses.
    pub(super) fn number(&self, name: &str) -> f64 {
        if let Some(Value::Number(v)) = self.value(name) { v } else { f64::NAN }
    }

    /// A whole number; 0 where the entry has none of this name.
    pub(super) fn count(&self, name: &str) -> usize {
        if let Some(Value::Count(c)) = self.value(name) { c } else { 0 }
    }

    /// A word; empty where the entry has none of this name.
    pub(super) fn choice(&self, name: &str) -> &'static str {
        if let Some(Value::Choice(c)) = self.value(name) { c } else { "" }
    }
}

/// A whole number, however it is written: `1e3` is one.
fn whole(text: &str) -> Option<usize> {
    let as_number = || {
        let value: f64 = text.parse().ok()?;
        // The largest `usize` stands for all beyond it, which every operator refuses.
        (value >= 0.0 && value.fract() == 0.0).then_some(value as usize)
    };
    text.parse().ok().or_else(as_number)
}
