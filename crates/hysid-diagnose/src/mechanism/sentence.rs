//! The sentence for people, with values and units filled in.

use hysid_plant::Unit;

use super::Mechanism;
use crate::slot::Slot;

/// A reported number.
#[derive(Debug, Clone, PartialEq)]
pub struct Value {
    /// The name in the report.
    pub name: String,
    /// The value.
    pub value: f64,
    /// The unit, where the simulation settles it.
    pub unit: Option<Unit>,
}

/// The number with three significant digits and its unit: `20.3 N`, `1.25e-5 m`, `0.3`.
pub fn number_with_unit(value: f64, unit: Option<&Unit>) -> String {
    let number = if value == 0.0 || !value.is_finite() {
        format!("{value}")
    } else if (1e-3..1e5).contains(&value.abs()) {
        let digits = (2 - value.abs().log10().floor() as i32).max(0);
        let text = format!("{value:.*}", digits as usize);
        if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
    } else {
        format!("{value:.2e}")
    };
    match unit {
        Some(unit) if !unit.is_none() => format!("{number} {unit}"),
        _ => number,
    }
}

impl Mechanism {
    /// What to tell people: the values with their units, and where the effect is.
    ///
    /// A value that is not given is left out of the sentence together with its braces, and with the brackets around it where there are any:
    /// not every form of a law has it. `{|F|}` is the size of a value, `{F:grows/falls}` the word for its sign.
    pub fn tell(&self, slot: &Slot, values: &[Value]) -> String {
        let mut told = String::with_capacity(self.sentence.len() + 40);
        for (i, part) in self.sentence.split(['[', ']']).enumerate() {
            let (text, complete) = filled(part, slot, values);
            // Every other part stands in brackets.
            if complete || i % 2 == 0 {
                told.push_str(&text);
            }
        }
        told
    }
}

/// The name of the value that stands between braces.
pub(super) fn name_in(braces: &str) -> &str {
    let name = braces.split_once(':').map_or(braces, |(name, _)| name);
    name.trim_matches('|')
}

/// A part of a sentence with its values, and whether all of them were given.
fn filled(part: &str, slot: &Slot, values: &[Value]) -> (String, bool) {
    let (mut told, mut complete) = (String::new(), true);
    let mut rest = part;
    while let Some((before, after)) = rest.split_once('{') {
        told.push_str(before);
        let (inside, behind) = after.split_once('}').unwrap_or((after, ""));
        let name = name_in(inside);
        let words = inside.split_once(':').and_then(|(_, words)| words.split_once('/'));
        match (name, values.iter().find(|v| v.name == name), words) {
            ("place" | "parameter", ..) => told.push_str(&slot.whereabouts),
            (_, Some(found), Some((upwards, downwards))) => {
                told.push_str(if found.value < 0.0 { downwards } else { upwards });
            }
            (_, Some(found), None) => {
                let value = if name == inside { found.value } else { found.value.abs() };
                told.push_str(&number_with_unit(value, found.unit.as_ref()));
            }
            (_, None, _) => complete = false,
        }
        rest = behind;
    }
    told.push_str(rest);
    (told, complete)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mechanism::conformance::slot_where;

    #[test]
    fn numbers_have_three_digits_and_a_unit() {
        let newton = Unit::parse("N").unwrap();
        let check = |value: f64, expected: &str| assert_eq!(number_with_unit(value, Some(&newton)), expected);
        check(20.34, "20.3 N");
        check(0.5, "0.5 N");
        check(1234.5, "1234 N");
        check(1.2345e-5, "1.23e-5 N");
        check(0.0, "0 N");
        check(-0.25, "-0.25 N");
    }

    #[test]
    fn a_friction_that_grows_with_the_speed_is_told_as_one() {
        let friction = crate::mechanism::mechanism("stribeck_friction").unwrap();
        let slot = slot_where(friction, |_| true).unwrap();
        let told = |at_rest: f64| {
            let value = |name: &str, value: f64| Value { name: name.to_owned(), value, unit: None };
            friction.tell(&slot, &[value("F_c", 3.0), value("F_d", at_rest), value("v_s", 0.5)])
        };
        assert!(
            told(2.0).ends_with(", 3 at speed, is 2 larger at rest than when sliding and falls over 0.5."),
            "{}",
            told(2.0)
        );
        assert!(
            told(-2.0).ends_with(", 3 at speed, is 2 smaller at rest than when sliding and grows over 0.5."),
            "{}",
            told(-2.0)
        );
    }
}
