//! The names of the signals, and terms as text: writing and reading.

use std::iter::Peekable;
use std::str::Chars;

use crate::{DictionaryError, Factor, Quantity, Signal, Term};

/// The largest lag that is accepted anywhere.
pub(crate) const LARGEST_LAG: usize = 100_000;

/// How one signal is called.
#[derive(Debug, Clone, PartialEq)]
pub struct SignalName {
    /// The symbol in equations: `y`, `u`, `u1`.
    pub symbol: String,
    /// The column of the recording; the symbol itself where nothing else is known.
    pub column: String,
    /// A difference of at most this size does not change the sign of the difference; in the signal's unit, from 0.
    pub threshold: f64,
}

impl SignalName {
    fn new(symbol: impl Into<String>, column: impl Into<String>) -> Self {
        Self { symbol: symbol.into(), column: column.into(), threshold: 0.0 }
    }
}

/// The output and the inputs of a system, by name.
#[derive(Debug, Clone, PartialEq)]
pub struct Signals {
    output: SignalName,
    inputs: Vec<SignalName>,
}

impl Signals {
    /// One input `u` and the output `y`.
    pub fn siso() -> Self {
        Self { output: SignalName::new("y", "y"), inputs: vec![SignalName::new("u", "u")] }
    }

    /// The output and the inputs from these columns: symbols `y`, and `u` or `u1`, `u2`, ...
    ///
    /// # Errors
    /// A name that stands for two signals, or holds a backtick, or is empty.
    pub fn from_columns(output: &str, inputs: &[&str]) -> Result<Self, DictionaryError> {
        let symbol = |i: usize| if inputs.len() == 1 { "u".to_string() } else { format!("u{}", i + 1) };
        Self::new(
            SignalName::new("y", output),
            inputs.iter().enumerate().map(|(i, c)| SignalName::new(symbol(i), *c)).collect(),
        )
    }

    /// Signals with symbols of one's own.
    ///
    /// # Errors
    /// A name that stands for two signals; a symbol that is not a letter followed by letters, digits and `_`.
    pub fn new(output: SignalName, inputs: Vec<SignalName>) -> Result<Self, DictionaryError> {
        let signals = Self { output, inputs };
        let all: Vec<&SignalName> = signals.all().map(|(_, n)| n).collect();
        for (i, name) in all.iter().enumerate() {
            if !is_word(&name.symbol) || name.symbol == "sgn" {
                return Err(DictionaryError::BadName(name.symbol.clone()));
            }
            if name.column.is_empty() || name.column.contains('`') {
                return Err(DictionaryError::BadName(name.column.clone()));
            }
            for other in &all[..i] {
                // A column may repeat a symbol of another signal only if nobody could mean it: symbols win.
                if other.symbol == name.symbol {
                    return Err(DictionaryError::AmbiguousName(name.symbol.clone()));
                }
                if other.column == name.column {
                    return Err(DictionaryError::AmbiguousName(name.column.clone()));
                }
                if other.symbol == format!("d{}", name.symbol) || name.symbol == format!("d{}", other.symbol) {
                    return Err(DictionaryError::AmbiguousName(format!("d{}", name.symbol.trim_start_matches('d'))));
                }
            }
        }
        Ok(signals)
    }

    /// The same signals with this noise threshold for the differences of `signal`.
    #[must_use]
    pub fn with_threshold(mut self, signal: Signal, threshold: f64) -> Self {
        match signal {
            Signal::Output => self.output.threshold = threshold,
            Signal::Input(i) => {
                if let Some(input) = self.inputs.get_mut(i) {
                    input.threshold = threshold;
                }
            }
        }
        self
    }

    /// The output's name.
    pub fn output(&self) -> &SignalName {
        &self.output
    }

    /// The inputs' names.
    pub fn inputs(&self) -> &[SignalName] {
        &self.inputs
    }

    /// The name of a signal; `None` for an input that there is not.
    pub fn name(&self, signal: Signal) -> Option<&SignalName> {
        match signal {
            Signal::Output => Some(&self.output),
            Signal::Input(i) => self.inputs.get(i),
        }
    }

    fn all(&self) -> impl Iterator<Item = (Signal, &SignalName)> {
        let inputs = self.inputs.iter().enumerate().map(|(i, n)| (Signal::Input(i), n));
        std::iter::once((Signal::Output, &self.output)).chain(inputs)
    }

    /// The signal of this symbol or column.
    pub fn find(&self, name: &str) -> Option<Signal> {
        let by = |key: fn(&SignalName) -> &str| self.all().find(|(_, n)| key(n) == name).map(|(s, _)| s);
        by(|n| &n.symbol).or_else(|| by(|n| &n.column))
    }

    /// The term as text, with symbols: `y[n-1]^2*u[n]`.
    pub fn format(&self, term: &Term) -> String {
        let mut parts: Vec<String> = Vec::new();
        let factors = term.factors();
        let mut i = 0;
        while i < factors.len() {
            let power = factors[i..].iter().take_while(|f| **f == factors[i]).count();
            let atom = self.format_factor(factors[i]);
            parts.push(if power > 1 { format!("{atom}^{power}") } else { atom });
            i += power;
        }
        if parts.is_empty() { "1".into() } else { parts.join("*") }
    }

    /// One factor as text.
    pub fn format_factor(&self, factor: Factor) -> String {
        let symbol = self.name(factor.quantity.signal()).map_or("?", |n| n.symbol.as_str());
        let time = if factor.lag == 0 { "n".to_string() } else { format!("n-{}", factor.lag) };
        match factor.quantity {
            Quantity::Value(_) => format!("{symbol}[{time}]"),
            Quantity::Difference(_) => format!("d{symbol}[{time}]"),
            Quantity::Sign(_) => format!("sgn(d{symbol}[{time}])"),
        }
    }

    /// The term that `text` says; the grammar is in the crate's documentation.
    ///
    /// # Errors
    /// Text that does not follow the grammar, with the place; a signal that there is not.
    pub fn parse(&self, text: &str) -> Result<Term, DictionaryError> {
        Parser { signals: self, text, rest: text.chars().peekable(), at: 1 }.term()
    }
}

fn is_word(s: &str) -> bool {
    s.starts_with(|c: char| c.is_alphabetic()) && s.chars().all(|c| c.is_alphanumeric() || c == '_')
}

struct Parser<'a> {
    signals: &'a Signals,
    text: &'a str,
    rest: Peekable<Chars<'a>>,
    at: usize,
}

impl Parser<'_> {
    fn term(mut self) -> Result<Term, DictionaryError> {
        let mut factors = Vec::new();
        loop {
            self.space();
            if self.rest.peek().is_some_and(char::is_ascii_digit) {
                if self.number()? != 1 {
                    return Err(self.fail("the only number that is a factor is 1"));
                }
            } else {
                let factor = self.atom()?;
                self.space();
                let power = if self.accept('^') { self.power()? } else { 1 };
                factors.extend(std::iter::repeat_n(factor, power));
            }
            self.space();
            if self.rest.peek().is_none() {
                return Ok(Term::new(factors));
            }
            self.expect('*')?;
        }
    }

    fn power(&mut self) -> Result<usize, DictionaryError> {
        self.space();
        match self.number()? {
            p @ 1..=99 => Ok(p),
            _ => Err(self.fail("a power must be 1 to 99")),
        }
    }

    fn atom(&mut self) -> Result<Factor, DictionaryError> {
        let (name, quoted) = self.name()?;
        self.space();
        if name == "sgn" && !quoted && self.accept('(') {
            self.space();
            let (name, quoted) = self.name()?;
            let inner = self.indexed(&name, quoted)?;
            self.space();
            self.expect(')')?;
            return match inner.quantity {
                Quantity::Difference(s) => Ok(Factor::sign(s, inner.lag)),
                _ => Err(self.fail("a sign is that of a difference, as in sgn(du[n])")),
            };
        }
        self.indexed(&name, quoted)
    }

    fn indexed(&mut self, name: &str, quoted: bool) -> Result<Factor, DictionaryError> {
        let quantity = self.quantity(name, quoted)?;
        self.space();
        self.expect('[')?;
        self.space();
        if !["n", "k", "t"].iter().any(|t| self.accept_str(t)) {
            return Err(self.fail("expected the time `n` or `n-1`"));
        }
        self.space();
        let lag = if self.accept('-') {
            self.space();
            self.number()?
        } else {
            0
        };
        self.space();
        self.expect(']')?;
        if lag > LARGEST_LAG {
            return Err(DictionaryError::LagTooLarge { lag, largest: LARGEST_LAG });
        }
        if lag == 0 && quantity.signal() == Signal::Output {
            return Err(DictionaryError::OutputLagZero);
        }
        Ok(Factor { quantity, lag })
    }

    /// What a name in front of `[` stands for: a signal before the difference of one.
    fn quantity(&mut self, name: &str, quoted: bool) -> Result<Quantity, DictionaryError> {
        if let Some(signal) = self.signals.find(name) {
            return Ok(Quantity::Value(signal));
        }
        // `d` in front of backticks arrives here as "d" followed by a quoted name.
        if name == "d" && !quoted && self.rest.peek() == Some(&'`') {
            let (inner, _) = self.name()?;
            if let Some(signal) = self.signals.find(&inner) {
                return Ok(Quantity::Difference(signal));
            }
            return Err(self.fail(&format!("there is no signal `{inner}`")));
        }
        match name.strip_prefix('d').filter(|_| !quoted).and_then(|n| self.signals.find(n)) {
            Some(signal) => Ok(Quantity::Difference(signal)),
            None => Err(self.fail(&format!("there is no signal `{name}`"))),
        }
    }

    fn name(&mut self) -> Result<(String, bool), DictionaryError> {
        if self.accept('`') {
            let mut name = String::new();
            loop {
                match self.next() {
                    Some('`') => return Ok((name, true)),
                    Some(c) => name.push(c),
                    None => return Err(self.fail("a backtick is not closed")),
                }
            }
        }
        let mut name = String::new();
        while let Some(&c) = self.rest.peek().filter(|c| c.is_alphanumeric() || **c == '_') {
            name.push(c);
            self.next();
        }
        if name.is_empty() { Err(self.fail("expected a signal")) } else { Ok((name, false)) }
    }

    fn number(&mut self) -> Result<usize, DictionaryError> {
        let mut digits = String::new();
        while let Some(&c) = self.rest.peek().filter(|c| c.is_ascii_digit()) {
            digits.push(c);
            self.next();
        }
        digits.parse().map_err(|_| self.fail("expected a whole number"))
    }

    fn space(&mut self) {
        while self.rest.peek().is_some_and(|c| c.is_whitespace()) {
            self.next();
        }
    }

    fn next(&mut self) -> Option<char> {
        self.at += 1;
        self.rest.next()
    }

    fn accept(&mut self, c: char) -> bool {
        let found = self.rest.peek() == Some(&c);
        if found {
            self.next();
        }
        found
    }

    fn accept_str(&mut self, s: &str) -> bool {
        s.chars().all(|c| self.accept(c))
    }

    fn expect(&mut self, c: char) -> Result<(), DictionaryError> {
        if self.accept(c) { Ok(()) } else { Err(self.fail(&format!("expected `{c}`"))) }
    }

    fn fail(&self, problem: &str) -> DictionaryError {
        DictionaryError::BadTerm { text: self.text.into(), problem: problem.into(), at: self.at }
    }
}
