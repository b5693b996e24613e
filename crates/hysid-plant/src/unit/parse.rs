//! Reading a unit as people write it.

use super::{ONE, Unit, UnitError, exponents};

impl Unit {
    /// The unit that `text` stands for: see [`Unit`] for what may be written.
    ///
    /// # Errors
    /// A character or an exponent that does not belong there, a missing factor, a parenthesis without its partner.
    pub fn parse(text: &str) -> Result<Self, UnitError> {
        let trimmed = text.trim();
        if matches!(trimmed, "" | "-" | "1") {
            return Ok(Self::none());
        }
        let mut reader = Reader { left: trimmed, depth: 0 };
        let unit = reader.product().and_then(|unit| match reader.left {
            "" => Ok(unit),
            _ => Err("a `)` has no `(`"),
        });
        unit.map_err(|reason| UnitError { text: text.to_owned(), reason })
    }
}

type Read<T> = Result<T, &'static str>;

/// Parentheses within each other beyond which a text is no unit.
const DEEPEST: usize = 8;

/// What is left of a text, and the parentheses that are open there.
struct Reader<'a> {
    left: &'a str,
    depth: usize,
}

impl<'a> Reader<'a> {
    fn peek(&self) -> Option<char> {
        self.left.chars().next()
    }

    fn take_if(&mut self, wanted: impl Fn(char) -> bool) -> Option<char> {
        let c = self.peek().filter(|c| wanted(*c))?;
        self.left = &self.left[c.len_utf8()..];
        Some(c)
    }

    fn take_while(&mut self, wanted: impl Fn(char) -> bool) -> &'a str {
        let end = self.left.find(|c| !wanted(c)).unwrap_or(self.left.len());
        let (taken, left) = self.left.split_at(end);
        self.left = left;
        taken
    }

    /// Whether something stands between two factors; `**` before an exponent is none of it.
    fn separated(&mut self) -> bool {
        let before = self.left.len();
        while !self.left.starts_with("**")
            && self.take_if(|c| c.is_whitespace() || matches!(c, '*' | '.' | '·' | '⋅' | '×' | '-')).is_some()
        {}
        self.left.len() < before
    }

    /// Factors up to the end or to a `)`; behind the first `/` every one divides.
    fn product(&mut self) -> Read<Unit> {
        let mut unit = Unit::none();
        let mut divides = false;
        self.separated();
        loop {
            let factor = match self.peek() {
                None | Some(')' | '/') => return Err("a factor is missing"),
                Some(_) => self.factor()?,
            };
            unit = if divides { unit.per(&factor) } else { unit.times(&factor) };
            self.separated();
            match self.peek() {
                None | Some(')') => return Ok(unit),
                Some('/') => {
                    self.take_if(|_| true);
                    divides = true;
                    self.separated();
                }
                Some(_) => {}
            }
        }
    }

    /// A name, a number or a product in parentheses, with its exponent; `sqrt` takes the root of the parentheses behind it.
    fn factor(&mut self) -> Read<Unit> {
        if self.left.starts_with('(') {
            let inner = self.parenthesis()?;
            let exponent = self.exponent()?.unwrap_or(ONE);
            return scaled(&inner, exponent);
        }
        if self.left.starts_with(|c: char| c.is_ascii_digit()) {
            return self.number();
        }
        let name = self.take_while(|c| c.is_alphabetic() || matches!(c, '%' | '_' | '°'));
        if name.is_empty() {
            return Err("a factor is not a name");
        }
        if name == "sqrt" && self.left.starts_with('(') {
            let inner = self.parenthesis()?;
            return scaled(&inner, ONE / 2);
        }
        // `m2` is a square metre; of a name that is not known the digit may be a part.
        let known = exponents(name).is_some();
        let digits = if known { self.decimal() } else { self.take_while(|c| c.is_ascii_digit()) };
        if !known || digits.is_empty() {
            let exponent = self.exponent()?.unwrap_or(ONE);
            return Ok(Unit { factors: vec![(format!("{name}{digits}"), exponent)] });
        }
        let power = Unit { factors: vec![(name.to_owned(), sixtieths(digits)?)] };
        let exponent = self.exponent()?.unwrap_or(ONE);
        scaled(&power, exponent)
    }

    /// A number, which tells a scale (`1e-8 W/K^4`); a `1` tells nothing.
    fn number(&mut self) -> Read<Unit> {
        let whole = self.left;
        self.decimal();
        let power = self.left.strip_prefix(['e', 'E']).map(|rest| rest.strip_prefix(['-', '+']).unwrap_or(rest));
        if let Some(rest) = power.filter(|rest| rest.starts_with(|c: char| c.is_ascii_digit())) {
            self.left = rest;
            self.take_while(|c| c.is_ascii_digit());
        }
        let text = &whole[..whole.len() - self.left.len()];
        let exponent = self.exponent()?.unwrap_or(ONE);
        match text.parse::<f64>() {
            Ok(1.0) => Ok(Unit::none()),
            Ok(value) if value > 0.0 && value.is_finite() => Ok(Unit { factors: vec![(text.to_owned(), exponent)] }),
            _ => Err("a number in it is not positive"),
        }
    }

    /// Digits, with a point between two of them: another one separates factors.
    fn decimal(&mut self) -> &'a str {
        let whole = self.left;
        self.take_while(|c| c.is_ascii_digit());
        let behind = self.left.strip_prefix('.').filter(|rest| rest.starts_with(|c: char| c.is_ascii_digit()));
        if let Some(rest) = behind.filter(|_| self.left.len() < whole.len()) {
            self.left = rest;
            self.take_while(|c| c.is_ascii_digit());
        }
        &whole[..whole.len() - self.left.len()]
    }

    fn parenthesis(&mut self) -> Read<Unit> {
        self.take_if(|c| c == '(');
        self.depth += 1;
        if self.depth > DEEPEST {
            return Err("there are too many parentheses within each other");
        }
        let inner = self.product()?;
        self.depth -= 1;
        self.take_if(|c| c == ')').map(|_| inner).ok_or("a `(` has no `)`")
    }

    /// What stands as an exponent here, in units of [`ONE`].
    fn exponent(&mut self) -> Read<Option<i32>> {
        let raised: String = self.take_while(|c| raised(c).is_some()).chars().filter_map(raised).collect();
        let text = if !raised.is_empty() {
            raised
        } else if self.left.starts_with("**") {
            self.left = &self.left[2..];
            self.exponent_text()
        } else if self.take_if(|c| c == '^').is_some() {
            self.exponent_text()
        } else {
            return Ok(None);
        };
        sixtieths(&text).map(Some)
    }

    fn exponent_text(&mut self) -> String {
        if self.take_if(|c| c == '(').is_some() {
            let text = self.take_while(|c| c != ')').to_owned();
            self.take_if(|c| c == ')');
            return text;
        }
        let sign = self.take_if(|c| matches!(c, '-' | '+'));
        sign.map(String::from).unwrap_or_default() + self.decimal()
    }
}

/// An exponent, a number or a quotient of two, in units of [`ONE`].
fn sixtieths(text: &str) -> Read<i32> {
    let number = |text: &str| text.trim().parse::<f64>().map_err(|_| "an exponent is not a number");
    let exponent = match text.split_once('/') {
        Some((above, below)) => number(above)? / number(below)?,
        None => number(text)?,
    };
    if !(exponent != 0.0 && exponent.abs() <= 12.0) {
        return Err("an exponent is 0 or larger than 12");
    }
    let parts = f64::from(ONE) * exponent;
    if (parts - parts.round()).abs() > 1e-6 {
        return Err("only exponents such as 2, 0.5, 0.6 or 1/3 are read");
    }
    Ok(parts.round() as i32)
}

/// A unit to a power in units of [`ONE`].
fn scaled(unit: &Unit, exponent: i32) -> Read<Unit> {
    let factors = unit.factors.iter().map(|(name, e)| {
        let product = i64::from(*e) * i64::from(exponent);
        let exact = product % i64::from(ONE) == 0 && (product / i64::from(ONE)).abs() <= i64::from(12 * ONE);
        exact.then(|| (name.clone(), (product / i64::from(ONE)) as i32))
    });
    let factors: Option<Vec<_>> = factors.collect();
    factors.map(|factors| Unit { factors }).ok_or("only exponents such as 2, 0.5, 0.6 or 1/3 are read")
}

/// A raised digit or sign as the plain one.
fn raised(c: char) -> Option<char> {
    let at = "⁰¹²³⁴⁵⁶⁷⁸⁹⁻".chars().position(|r| r == c)?;
    "0123456789-".chars().nth(at)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_read_as_people_write_them() {
        let check = |text: &str, expected: &str| match Unit::parse(text) {
            Ok(unit) => assert_eq!(unit.to_string(), expected, "{text}"),
            Err(e) => panic!("{e}"),
        };
        for text in ["N s/m", "N*s/m", "N·s/m", "N.s/m", "N-s/m", " N s / m ", "N/(m/s)", "(N s)/m", "(N*s)/(m)"] {
            check(text, "N s/m");
        }
        for text in ["kg m^2", "kg·m²", "kg*m**2", "kg m2", "kg m^2.0", "kg.m^2", "kg × m²"] {
            check(text, "kg m^2");
        }
        for text in ["m/s^2", "m/s/s", "m/s²", "m s^-2", "m·s⁻²", "m/(s s)", "m/s2"] {
            check(text, "m/s^2");
        }
        check("W/m^2/K", "W/(m^2 K)");
        check("J/kg K", "J/(kg K)");
        check("N/(m/s)^2", "N s^2/m^2");
        check("N*(s/m)^0.6", "N s^0.6/m^0.6");
        check("m^(5/2)/s", "m^2.5/s");
        check("cm^2.5/s", "cm^2.5/s");
        check("sqrt(m)/s", "m^0.5/s");
        check("m^(1/3)", "m^0.3333333333333333");
        check("1/rad", "1/rad");
        check("1", "-");
        check("V/V", "-");
        check("kgm2", "kgm2");
        check("cm2.5/s", "cm^2.5/s");
        check("N.m2.s", "N m^2 s");
        check("m N", "N m");
        check("1/(m K)", "1/(K m)");
        check("1e-8 W/K4", "1e-8 W/K^4");
        check("10^-8 W/(m2 K4)", "W/(10^8 m^2 K^4)");
        check("1.0 m", "m");
        check("ft3", "ft3");
        check("µm/V", "µm/V");
    }

    #[test]
    fn what_is_printed_is_read_again() {
        for text in [
            "N s/m",
            "N*(s/m)^0.6",
            "m^(1/3)",
            "W/m^2/K",
            "sqrt(m)/s",
            "1/s^2",
            "kg m^2",
            "-",
            "(m s)^(1/3)/A",
            "1e-8 W/K4",
        ] {
            let unit = Unit::parse(text).unwrap();
            assert_eq!(Unit::parse(&unit.to_string()).as_ref(), Ok(&unit), "{text} as {unit}");
        }
    }

    #[test]
    fn what_is_no_unit_is_told() {
        let check = |text: &str, reason: &str| match Unit::parse(text) {
            Ok(unit) => panic!("{text} is read as {unit}"),
            Err(e) => assert!(e.to_string().contains(reason), "{text}: {e}"),
        };
        check("kg//m", "factor is missing");
        check("N/", "factor is missing");
        check("/s", "factor is missing");
        check("N (s", "`(` has no `)`");
        check("N s)", "`)` has no `(`");
        check("#N", "not a name");
        check("0 N", "not positive");
        check("1e999 N", "not positive");
        check("N^x", "not a number");
        check("N^", "not a number");
        check("m^0", "0 or larger");
        check("m^99", "0 or larger");
        check("m^(1/0)", "0 or larger");
        check("m^0.37", "only exponents");
        check("(m^0.05)^0.05", "only exponents");
        check(&"(".repeat(100_000), "too many parentheses");
    }
}
