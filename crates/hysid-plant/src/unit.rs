//! Units as products of named factors (`N s/m`, `1/s^2`, `-`), with enough algebra to build new ones and to compare.
//!
//! A unit keeps the names that the user wrote. Two units are [comparable](Unit::same_dimension) when they reduce to the same
//! dimension (`mm` and `m`, `N` and `kg m/s^2`); angles are dimensionless. A name that is not known is a dimension of its own,
//! of which nothing is certain: it [clashes](Unit::clashes) with nothing.

mod parse;

use std::collections::BTreeMap;
use std::fmt::{self, Display, Formatter};

use hysid_signal::tell::brief;

/// A product of named factors with exponents that are multiples of a sixtieth.
///
/// Text form: factors separated by spaces, `*`, `.`, `·` or `-`; behind a `/` every factor divides (`W/m^2/K`, `J/kg K`), but for what stands in
/// parentheses (`V/(rad/s)`); `^`, `**` or raised digits before an exponent (`cm^2.5/s`, `m^(1/3)`, `kg·m²`), also behind parentheses
/// (`N*(s/m)^0.6`); `m3` is `m^3`; `sqrt(m)`; a number is a scale (`1e-8 W/K^4`); `-` or `1` or nothing is dimensionless.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Unit {
    /// Names with their exponents in units of [`ONE`].
    factors: Vec<(String, i32)>,
}

/// The exponent one: whole numbers, halves, thirds, quarters, fifths and tenths are multiples of its parts.
const ONE: i32 = 60;

/// Why a text is not a unit.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{}` is not a unit: {reason}; units look like `N s/m`, `1/s^2`, `deg` or `-`", brief(text))]
pub struct UnitError {
    /// What was given.
    pub text: String,
    /// What is wrong with it.
    pub reason: &'static str,
}

/// The base dimensions, as exponents by name, in units of [`ONE`] where they are those of a [`Unit`].
type Dimension = BTreeMap<&'static str, i32>;

/// Known names: exponents of (m, kg, s, A, K).
const KNOWN: &[(&str, [i32; 5])] = &[
    ("m", [1, 0, 0, 0, 0]),
    ("kg", [0, 1, 0, 0, 0]),
    ("g", [0, 1, 0, 0, 0]),
    ("t", [0, 1, 0, 0, 0]),
    ("s", [0, 0, 1, 0, 0]),
    ("min", [0, 0, 1, 0, 0]),
    ("h", [0, 0, 1, 0, 0]),
    ("A", [0, 0, 0, 1, 0]),
    ("K", [0, 0, 0, 0, 1]),
    ("degC", [0, 0, 0, 0, 1]),
    ("N", [1, 1, -2, 0, 0]),
    ("Nm", [2, 1, -2, 0, 0]),
    ("Pa", [-1, 1, -2, 0, 0]),
    ("bar", [-1, 1, -2, 0, 0]),
    ("J", [2, 1, -2, 0, 0]),
    ("W", [2, 1, -3, 0, 0]),
    ("Hz", [0, 0, -1, 0, 0]),
    ("V", [2, 1, -3, -1, 0]),
    ("Ohm", [2, 1, -3, -2, 0]),
    ("ohm", [2, 1, -3, -2, 0]),
    ("S", [-2, -1, 3, 2, 0]),
    ("H", [2, 1, -2, -2, 0]),
    ("F", [-2, -1, 4, 2, 0]),
    ("C", [0, 0, 1, 1, 0]),
    ("Wb", [2, 1, -2, -1, 0]),
    ("T", [0, 1, -2, -1, 0]),
    ("L", [3, 0, 0, 0, 0]),
    ("l", [3, 0, 0, 0, 0]),
    ("rad", [0; 5]),
    ("deg", [0; 5]),
    ("rev", [0; 5]),
    ("turn", [0; 5]),
    ("percent", [0; 5]),
    ("rpm", [0, 0, -1, 0, 0]),
];
/// Names of units of which each is a product of the others without a factor.
const COHERENT: [&str; 20] =
    ["m", "kg", "s", "A", "K", "N", "Nm", "Pa", "J", "W", "Hz", "V", "Ohm", "ohm", "S", "H", "F", "C", "Wb", "T"];
/// What forces and what circuits have is mostly told in.
const USUAL: [&str; 12] = ["N", "N m", "Pa", "V", "A", "ohm", "m", "m/s", "m/s^2", "N/m", "N s/m", "1/A^2"];
const BASES: [&str; 5] = ["m", "kg", "s", "A", "K"];
const PREFIXES: [&str; 8] = ["n", "u", "m", "c", "d", "k", "M", "G"];

fn exponents(name: &str) -> Option<[i32; 5]> {
    let find = |n: &str| KNOWN.iter().find(|(known, _)| *known == n).map(|(_, e)| *e);
    find(name).or_else(|| {
        PREFIXES.iter().find_map(|p| {
            let rest = name.strip_prefix(p)?;
            // Only units that take prefixes.
            (!matches!(rest, "kg" | "min" | "h" | "degC" | "rpm" | "t" | "percent" | "rev" | "turn"))
                .then(|| find(rest))?
        })
    })
}

impl Unit {
    /// The dimensionless unit, printed `-`.
    pub fn none() -> Self {
        Self::default()
    }

    fn multiply(&mut self, name: &str, exponent: i32) {
        match self.factors.iter_mut().find(|(n, _)| n == name) {
            Some((_, e)) => *e = e.saturating_add(exponent),
            None => self.factors.push((name.to_owned(), exponent)),
        }
        self.factors.retain(|(_, e)| *e != 0);
    }

    /// The product.
    pub fn times(&self, other: &Self) -> Self {
        let mut unit = self.clone();
        other.factors.iter().for_each(|(name, e)| unit.multiply(name, *e));
        unit
    }

    /// The quotient.
    pub fn per(&self, other: &Self) -> Self {
        self.times(&other.power(-1))
    }

    /// The integer power.
    pub fn power(&self, exponent: i32) -> Self {
        let mut factors = self.factors.clone();
        factors.iter_mut().for_each(|(_, e)| *e = e.saturating_mul(exponent));
        factors.retain(|(_, e)| *e != 0);
        Self { factors }
    }

    /// The square root, where every exponent is even; elsewhere it is left open, so that a coefficient before a root whose unit was not
    /// thought out clashes with nothing.
    pub fn root(&self) -> Option<Self> {
        let roots = self.factors.iter().map(|(n, e)| (e % (2 * ONE) == 0).then(|| (n.clone(), e / 2)));
        Some(Self { factors: roots.collect::<Option<_>>()? })
    }

    /// The same unit by one of the usual names where that takes fewer factors: `N` for `m^2 Pa`, `N m` for `N m V/(A ohm)`. Units that are multiples of
    /// others (`mm`, `bar`) stay as they are, and so does what holds an angle, but for radians where the name takes two factors fewer: `N m` for `A V s/rad`,
    /// and `N m/rad` as it is.
    pub fn briefly(&self) -> Self {
        let (radians, others): (Vec<&str>, Vec<&str>) =
            self.factors.iter().map(|(n, _)| n.as_str()).partition(|n| *n == "rad");
        if others.iter().all(|name| COHERENT.contains(name)) {
            let usual = USUAL.iter().filter_map(|text| Self::parse(text).ok());
            let mut shorter = usual.filter(|u| u.factors.len() + radians.len() < self.factors.len());
            if let Some(unit) = shorter.find(|u| u.same_dimension(self)) {
                return unit;
            }
        }
        self.clone()
    }

    /// Whether no named factor is left.
    pub fn is_none(&self) -> bool {
        self.factors.is_empty()
    }

    /// Whether it is told for each of something, and of nothing else (`1/deg`).
    pub(crate) fn is_for_each(&self) -> bool {
        !self.factors.is_empty() && self.factors.iter().all(|(_, exponent)| *exponent < 0)
    }

    fn dimension(&self) -> (Dimension, BTreeMap<&str, i32>) {
        let mut known = Dimension::new();
        let mut unknown = BTreeMap::new();
        for (name, exponent) in &self.factors {
            match exponents(name) {
                Some(e) => {
                    for (base, power) in BASES.iter().zip(e) {
                        *known.entry(base).or_insert(0) += power.saturating_mul(*exponent);
                    }
                }
                // A scale, as a prefix is.
                None if matches!(name.as_str(), "%" | "°") || name.starts_with(|c: char| c.is_ascii_digit()) => {}
                None => *unknown.entry(name.as_str()).or_insert(0) += exponent,
            }
        }
        known.retain(|_, e| *e != 0);
        unknown.retain(|_, e| *e != 0);
        (known, unknown)
    }

    /// Whether both reduce to the same dimension; scale (`mm` against `m`) does not matter.
    pub fn same_dimension(&self, other: &Self) -> bool {
        self.dimension() == other.dimension()
    }

    /// Whether the two are certainly of different dimensions: they differ in what is known of them, and agree in the names that are not known (`psi`
    /// against `lbf` or `Pa` may be right).
    pub fn clashes(&self, other: &Self) -> bool {
        let ((known, unknown), (others, strange)) = (self.dimension(), other.dimension());
        unknown == strange && known != others
    }
}

impl Display for Unit {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        if self.factors.is_empty() {
            return f.write_str("-");
        }
        let side = |positive: bool| {
            let mut chosen: Vec<_> = self.factors.iter().filter(|(_, e)| (*e > 0) == positive).collect();
            // A metre before another unit would be read as a thousandth of that.
            if chosen.first().is_some_and(|(name, e)| name == "m" && e.abs() == ONE) {
                chosen.rotate_left(1);
            }
            let text = chosen.into_iter().map(|(name, exponent)| match exponent.abs() {
                ONE => name.clone(),
                exponent => format!("{name}^{}", f64::from(exponent) / f64::from(ONE)),
            });
            text.collect::<Vec<_>>()
        };
        let (above, below) = (side(true), side(false));
        f.write_str(if above.is_empty() { "1" } else { "" })?;
        f.write_str(&above.join(" "))?;
        match below.as_slice() {
            [] => Ok(()),
            [one] => write!(f, "/{one}"),
            several => write!(f, "/({})", several.join(" ")),
        }
    }
}

impl Unit {
    /// The unit that a column's name ends in: `force_N` gives `N`, `v_mm_s` gives `mm/s`, `inflow_m3_s` gives `m^3/s`, `conc_mol_L` gives `mol/L`,
    /// `H_A_per_m` gives `A/m`; nothing where the end is not known or may be read in two ways (`torque_N_m`, `H_A_m`).
    pub fn of_column(column: &str) -> Option<Self> {
        let parts: Vec<&str> = column.split('_').skip(1).collect();
        if let Some(per) = parts.iter().rposition(|p| *p == "per") {
            return Self::of_quotient(&parts[..per], &parts[per + 1..]);
        }
        let (&last, before) = parts.split_last()?;
        let above = before.last().copied().unwrap_or_default();
        // A time after a unit divides by it; alone it is a time.
        let time = match last {
            "s" | "min" | "h" => Some((last, 1)),
            "s2" => Some(("s", 2)),
            _ => None,
        };
        if let Some((above, time)) = powered(above).zip(time) {
            return Some(Self::quotient(&[above], &[time]));
        }
        // Capitals before a time may be a unit that is not known, as normal litres: `supply_NL_s`.
        if time.is_some() && above.contains(|c: char| c.is_ascii_uppercase()) {
            return None;
        }
        match (above, powered(last)) {
            ("mol", Some(below)) => return Some(Self::quotient(&[(above, 1)], &[below])),
            // One letter may be the name of a part as well as a unit.
            ("A" | "V" | "W" | "N" | "J", Some(_)) => return None,
            (_, Some(below)) if above.len() > 1 && exponents(above).is_some() => {
                return Some(Self::quotient(&[(above, 1)], &[below]));
            }
            _ => {}
        }
        // `x_m2` is more likely the place of a second mass than an area.
        exponents(last).map(|_| Self { factors: vec![(last.to_owned(), ONE)] })
    }

    /// The units that the one list ends in over all of the other; `None` where any of these is not known.
    fn of_quotient(above: &[&str], below: &[&str]) -> Option<Self> {
        let mut above: Vec<(&str, i32)> = above.iter().rev().map_while(|name| powered(name)).collect();
        above.reverse();
        let below: Vec<(&str, i32)> = below.iter().map(|name| powered(name)).collect::<Option<_>>()?;
        (!above.is_empty() && !below.is_empty()).then(|| Self::quotient(&above, &below))
    }

    /// Known names with their powers over others.
    fn quotient(above: &[(&str, i32)], below: &[(&str, i32)]) -> Self {
        let factor = |sign: i32| move |(name, power): &(&str, i32)| ((*name).to_owned(), sign * ONE * power);
        Self { factors: above.iter().map(factor(1)).chain(below.iter().map(factor(-1))).collect() }
    }
}

/// A known name with the power that may follow it: `m3` is a cubic metre.
fn powered(text: &str) -> Option<(&str, i32)> {
    let to_the = |digit: char, power: i32| text.strip_suffix(digit).map(|name| (name, power));
    let (name, exponent) = to_the('2', 2).or_else(|| to_the('3', 3)).unwrap_or((text, 1));
    exponents(name).map(|_| (name, exponent))
}
