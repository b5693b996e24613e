//! Printing a simulation as TOML: `Simulation::parse(s.to_toml()) == s`.

use std::fmt::Write;

use super::{ClockSource, Hold, Initial, Simulation};
use crate::expr::number;
use crate::unit::Unit;

fn quoted(text: &str) -> String {
    let mut out = String::with_capacity(text.len() + 2);
    out.push('"');
    for c in text.chars() {
        match c {
            '"' => out.push_str("\\\""),
            '\\' => out.push_str("\\\\"),
            '\n' => out.push_str("\\n"),
            '\t' => out.push_str("\\t"),
            c if c.is_control() => {
                let _ = write!(out, "\\u{:04X}", u32::from(c));
            }
            c => out.push(c),
        }
    }
    out.push('"');
    out
}

fn key(text: &str) -> String {
    let bare = !text.is_empty() && text.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-');
    if bare { text.to_owned() } else { quoted(text) }
}

/// A TOML float: always with a point or an exponent.
fn float(value: f64) -> String {
    let text = number(value);
    if text.contains(['.', 'e']) { text } else { format!("{text}.0") }
}

fn unit_entry(unit: Option<&Unit>) -> String {
    unit.map(|u| format!(", unit = {}", quoted(&u.to_string()))).unwrap_or_default()
}

impl Simulation {
    /// The simulation as the text of a `.sim.toml` file.
    pub fn to_toml(&self) -> String {
        let mut out = String::new();
        // Writing to a `String` cannot fail.
        let _ = self.write(&mut out);
        out
    }

    fn write(&self, out: &mut String) -> std::fmt::Result {
        writeln!(out, "title = {}\n\n[time]", quoted(&self.title))?;
        match &self.time.clock {
            ClockSource::Column(column) => writeln!(out, "column = {}", quoted(column))?,
            ClockSource::Period(seconds) => writeln!(out, "period_s = {}", float(*seconds))?,
        }
        if self.time.hold == Hold::Zero {
            writeln!(out, "hold = \"zero\"")?;
        }
        if !self.inputs.is_empty() {
            writeln!(out, "\n[inputs]")?;
        }
        for input in &self.inputs {
            writeln!(out, "{} = {}", key(&input.symbol), quoted(&input.column))?;
        }
        if !self.parameters.is_empty() {
            writeln!(out, "\n[parameters]")?;
        }
        for p in &self.parameters {
            write!(out, "{} = {{ value = {}", key(&p.name), float(p.value))?;
            for (name, bound) in [("min", p.min), ("max", p.max)] {
                if let Some(bound) = bound {
                    write!(out, ", {name} = {}", float(bound))?;
                }
            }
            writeln!(out, "{}{} }}", if p.fixed { ", fixed = true" } else { "" }, unit_entry(p.unit.as_ref()))?;
        }
        if !self.states.is_empty() {
            writeln!(out, "\n[states]")?;
        }
        for s in &self.states {
            let initial = match &s.initial {
                Initial::Number(value) => float(*value),
                Initial::Free => quoted("free"),
                Initial::Expr(expr) => quoted(&expr.to_string()),
            };
            let derivative = quoted(&s.derivative.to_string());
            let unit = unit_entry(s.unit.as_ref());
            writeln!(out, "{} = {{ derivative = {derivative}, initial = {initial}{unit} }}", key(&s.name))?;
        }
        writeln!(out, "\n[outputs]")?;
        for output in &self.outputs {
            writeln!(out, "{} = {}", key(&output.column), quoted(&output.expression.to_string()))?;
        }
        Ok(())
    }
}
