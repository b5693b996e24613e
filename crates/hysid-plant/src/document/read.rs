//! Reading a `.sim.toml`: every key is known or an error, and every error has its place.

use std::collections::HashMap;
use std::ops::Range;

use hysid_signal::tell::brief;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::validate::{Fault, Within};
use super::{ClockSource, Hold, Initial, Input, Output, Parameter, Simulation, State, Time};
use crate::error::{Error, ErrorKind, Place};
use crate::expr::Expr;
use crate::unit::Unit;

/// Bytes of the largest simulation file that is read.
pub const LARGEST_FILE: usize = 1 << 20;

type Value<'a> = Spanned<DeValue<'a>>;

/// Where each key's value stands in the text.
struct Reader {
    spans: HashMap<String, Range<usize>>,
}

fn fault<T>(key: &str, kind: ErrorKind) -> Result<T, Fault> {
    Err(Fault::of(key, kind))
}

fn wrong_type<T>(key: &str, expected: &'static str, found: &Value<'_>) -> Result<T, Fault> {
    fault(key, ErrorKind::WrongType { expected, found: found.get_ref().type_str().to_owned() })
}

fn join(parent: &str, key: &str) -> String {
    if parent.is_empty() { key.to_owned() } else { format!("{parent}.{key}") }
}

impl Reader {
    /// The entries of a table, each with its full key; the places are remembered.
    fn entries<'v, 'a>(&mut self, parent: &str, table: &'v DeTable<'a>) -> Vec<(String, &'v str, &'v Value<'a>)> {
        let mut out = Vec::new();
        for (name, value) in table {
            let key = join(parent, name.get_ref());
            self.spans.insert(format!("{key}#key"), name.span());
            self.spans.insert(key.clone(), value.span());
            out.push((key, name.get_ref().as_ref(), value));
        }
        out
    }

    fn table<'v, 'a>(
        &mut self,
        key: &str,
        value: &'v Value<'a>,
    ) -> Result<Vec<(String, &'v str, &'v Value<'a>)>, Fault> {
        match value.get_ref().as_table() {
            Some(table) => Ok(self.entries(key, table)),
            None => wrong_type(key, "a table", value),
        }
    }
}

fn text<'v>(key: &str, value: &'v Value<'_>) -> Result<&'v str, Fault> {
    match value.get_ref().as_str() {
        Some(text) => Ok(text),
        None => wrong_type(key, "a text in quotes", value),
    }
}

fn number(key: &str, value: &Value<'_>) -> Result<f64, Fault> {
    let parsed = match value.get_ref() {
        DeValue::Integer(i) if i.radix() == 10 => i.as_str().replace('_', "").parse::<f64>().ok(),
        DeValue::Float(f) => f.as_str().replace('_', "").parse::<f64>().ok(),
        _ => return wrong_type(key, "a number", value),
    };
    match parsed {
        Some(number) if number.is_finite() => Ok(number),
        other => fault(
            key,
            ErrorKind::BadNumber {
                what: "the value",
                value: other.unwrap_or(f64::NAN),
                allowed: "a finite number is needed".to_owned(),
            },
        ),
    }
}

fn expression(key: &str, value: &Value<'_>) -> Result<Expr, Fault> {
    if value.get_ref().is_integer() || value.get_ref().is_float() {
        return number(key, value).map(Expr::Number);
    }
    let Some(source) = value.get_ref().as_str() else {
        return wrong_type(key, "an expression in quotes", value);
    };
    Expr::parse(source)
        .map_err(|e| Fault { within: Within::Byte(e.at), ..Fault::of(key, ErrorKind::Expression(e.message)) })
}

fn unit(key: &str, value: &Value<'_>) -> Result<Unit, Fault> {
    Unit::parse(text(key, value)?).or_else(|e| fault(key, ErrorKind::Unit(e.to_string())))
}

fn unknown<T>(key: &str, allowed: &'static str) -> Result<T, Fault> {
    fault(&format!("{key}#key"), ErrorKind::UnknownKey { allowed })
}

fn read_time(reader: &mut Reader, key: &str, value: &Value<'_>) -> Result<Time, Fault> {
    let (mut column, mut period, mut hold) = (None, None, Hold::default());
    for (key, name, value) in reader.table(key, value)? {
        match name {
            "column" => column = Some(text(&key, value)?.to_owned()),
            "period_s" => period = Some(number(&key, value)?),
            "hold" => {
                hold = match text(&key, value)? {
                    "zero" => Hold::Zero,
                    "linear" => Hold::Linear,
                    _ => {
                        let found = value.get_ref().as_str().unwrap_or_default();
                        return fault(
                            &key,
                            ErrorKind::WrongType { expected: "\"linear\" or \"zero\"", found: format!("\"{found}\"") },
                        );
                    }
                }
            }
            _ => return unknown(&key, "column, period_s, hold"),
        }
    }
    let clock = match (column, period) {
        (Some(column), None) => ClockSource::Column(column),
        (None, Some(period)) => ClockSource::Period(period),
        (None, None) => return fault(key, ErrorKind::Missing("column` or `period_s")),
        (Some(_), Some(_)) => {
            return fault(
                "time.period_s",
                ErrorKind::Duplicate { name: "time".to_owned(), earlier: "given by `column`".to_owned() },
            );
        }
    };
    Ok(Time { clock, hold })
}

fn read_parameter(reader: &mut Reader, key: &str, name: &str, value: &Value<'_>) -> Result<Parameter, Fault> {
    let mut parameter = Parameter::new(name, 0.0);
    let mut given = None;
    for (key, field, value) in reader.table(key, value)? {
        match field {
            "value" => given = Some(number(&key, value)?),
            "min" => parameter.min = Some(number(&key, value)?),
            "max" => parameter.max = Some(number(&key, value)?),
            "fixed" => match value.get_ref().as_bool() {
                Some(fixed) => parameter.fixed = fixed,
                None => return wrong_type(&key, "true or false", value),
            },
            "unit" => parameter.unit = Some(unit(&key, value)?),
            _ => return unknown(&key, "value, min, max, fixed, unit"),
        }
    }
    match given {
        Some(value) => Ok(Parameter { value, ..parameter }),
        None => fault(key, ErrorKind::Missing("value")),
    }
}

fn read_state(reader: &mut Reader, key: &str, name: &str, value: &Value<'_>) -> Result<State, Fault> {
    let (mut derivative, mut initial, mut state_unit) = (None, None, None);
    for (key, field, value) in reader.table(key, value)? {
        match field {
            "derivative" => derivative = Some(expression(&key, value)?),
            "initial" => {
                initial = Some(match value.get_ref().as_str() {
                    Some("free") => Initial::Free,
                    Some(_) => Initial::Expr(expression(&key, value)?),
                    None => Initial::Number(number(&key, value)?),
                });
            }
            "unit" => state_unit = Some(unit(&key, value)?),
            _ => return unknown(&key, "derivative, initial, unit"),
        }
    }
    let Some(derivative) = derivative else { return fault(key, ErrorKind::Missing("derivative")) };
    let Some(initial) = initial else { return fault(key, ErrorKind::Missing("initial")) };
    Ok(State { name: name.to_owned(), derivative, initial, unit: state_unit })
}

fn read(reader: &mut Reader, root: &DeTable<'_>) -> Result<Simulation, Fault> {
    let mut title = String::new();
    let (mut time, mut outputs_given) = (None, false);
    let (mut inputs, mut parameters, mut states, mut outputs) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for (key, name, value) in reader.entries("", root) {
        match name {
            "title" => title = text(&key, value)?.to_owned(),
            "time" => time = Some(read_time(reader, &key, value)?),
            "inputs" => {
                for (key, symbol, value) in reader.table(&key, value)? {
                    inputs.push(Input { symbol: symbol.to_owned(), column: text(&key, value)?.to_owned() });
                }
            }
            "parameters" => {
                for (key, name, value) in reader.table(&key, value)? {
                    parameters.push(read_parameter(reader, &key, name, value)?);
                }
            }
            "states" => {
                for (key, name, value) in reader.table(&key, value)? {
                    states.push(read_state(reader, &key, name, value)?);
                }
            }
            "outputs" => {
                outputs_given = true;
                for (key, column, value) in reader.table(&key, value)? {
                    outputs.push(Output { column: column.to_owned(), expression: expression(&key, value)? });
                }
            }
            _ => return unknown(&key, "title, time, inputs, parameters, states, outputs"),
        }
    }
    let Some(time) = time else { return fault("", ErrorKind::Missing("[time]")) };
    if !outputs_given {
        return fault("", ErrorKind::Missing("[outputs]"));
    }
    Ok(Simulation { title, time, inputs, parameters, states, outputs })
}

fn place(text: &str, offset: usize) -> Place {
    let before = text.get(..offset.min(text.len())).unwrap_or(text);
    let line_start = before.rfind('\n').map_or(0, |i| i + 1);
    Place {
        line: before.matches('\n').count() + 1,
        column: before.get(line_start..).unwrap_or_default().chars().count() + 1,
    }
}

/// A message of the TOML reader about the text at its place; it takes a word without quotes for the beginning of `true` or `false`.
fn told(message: &str, place: &str) -> String {
    if message == "duplicate key" {
        return format!("duplicate key `{}`", brief(place.trim()));
    }
    if message.contains("boolean") || message.contains("quoted") {
        return "a text stands in quotes, as in \"free\" or \"-k*x\"".to_owned();
    }
    message.trim().replace('\n', "; ")
}

impl Simulation {
    /// The simulation that a `.sim.toml` file's text stands for; `file_name` is for messages only.
    ///
    /// # Errors
    /// The first thing that is wrong: TOML syntax, an unknown or missing key, anything that [`Simulation::validate`] finds, or an
    /// output that is a constant although it names what moves (`x - x`).
    pub fn parse(text: &str, file_name: &str) -> Result<Self, Error> {
        let file = Some(file_name.to_owned());
        if text.len() > LARGEST_FILE {
            let kind = ErrorKind::Toml(format!("the file is larger than {LARGEST_FILE} bytes"));
            return Err(Error { file, place: None, key: String::new(), kind });
        }
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let root = DeTable::parse(text).map_err(|e| Error {
            file: file.clone(),
            place: e.span().map(|span| place(text, span.start)),
            key: String::new(),
            kind: ErrorKind::Toml(told(e.message(), e.span().and_then(|span| text.get(span)).unwrap_or_default())),
        })?;
        let mut reader = Reader { spans: HashMap::new() };
        let simulation = read(&mut reader, root.get_ref());
        let judged = |s: Simulation| s.first_fault().or_else(|| s.cancelled_output()).map_or(Ok(s), Err);
        simulation.and_then(judged).map_err(|fault| {
            let key = fault.key.trim_end_matches("#key").to_owned();
            let span = reader.spans.get(&fault.key).or_else(|| reader.spans.get(&key));
            let offset = span.map(|span| {
                let source = text.get(span.clone()).unwrap_or_default();
                let quotes = if source.starts_with("\"\"\"") || source.starts_with("'''") { 3 } else { 1 };
                let inside = match &fault.within {
                    Within::Value => None,
                    Within::Byte(at) => Some(*at),
                    Within::Use(symbol, number) => source
                        .get(quotes..source.len().saturating_sub(quotes))
                        .and_then(|inner| crate::expr::place_of_use(inner, symbol, *number)),
                };
                inside.map_or(span.start, |i| span.start + quotes + i)
            });
            Error { file, place: offset.map(|o| place(text, o)), key, kind: fault.kind }
        })
    }
}
