//! What can be wrong with a simulation file, and where.

use std::fmt::{self, Display, Formatter};

use hysid_signal::tell::{brief, digits};

/// A place in a text file; both counts start at 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Place {
    /// Line.
    pub line: usize,
    /// Column, in characters.
    pub column: usize,
}

/// A fault in a simulation: which file and place (where it was read from a text), which key, and what.
#[derive(Debug, Clone, PartialEq)]
pub struct Error {
    /// The file's name as given to [`crate::Simulation::parse`].
    pub file: Option<String>,
    /// Where in the file.
    pub place: Option<Place>,
    /// The key at fault, as in `states.v.derivative`; empty for a fault of the file as a whole.
    pub key: String,
    /// What is wrong.
    pub kind: ErrorKind,
}

impl Display for Error {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        if let Some(file) = &self.file {
            f.write_str(file)?;
            if let Some(place) = self.place {
                write!(f, ":{}:{}", place.line, place.column)?;
            }
            f.write_str(": ")?;
        }
        if !self.key.is_empty() {
            write!(f, "`{}`: ", brief(&self.key))?;
        }
        write!(f, "{}", self.kind)
    }
}

impl std::error::Error for Error {}

/// What is wrong with a simulation.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ErrorKind {
    /// The text is not TOML.
    #[error("this is not TOML: {0}")]
    Toml(String),
    /// A key that the format does not have.
    #[error("unknown key; allowed here: {allowed}")]
    UnknownKey {
        /// The keys that the format has there.
        allowed: &'static str,
    },
    /// A key that must be there is not.
    #[error("`{0}` is missing")]
    Missing(&'static str),
    /// A value of the wrong type.
    #[error("{expected} is expected, not {found}")]
    WrongType {
        /// What the format has there.
        expected: &'static str,
        /// The TOML type that was found.
        found: String,
    },
    /// An expression that cannot be parsed.
    #[error("{0}")]
    Expression(String),
    /// A unit that cannot be parsed.
    #[error("{0}")]
    Unit(String),
    /// A symbol that is not an input, parameter, state, `t` or `pi`.
    #[error("unknown symbol `{}`{hint}", brief(symbol))]
    UnknownSymbol {
        /// What was used.
        symbol: String,
        /// A likely intention, or what is allowed there.
        hint: String,
    },
    /// A name that cannot be a symbol.
    #[error("`{}` cannot be a symbol: a symbol is a letter followed by letters, digits or `_`", brief(.0))]
    BadSymbol(String),
    /// A symbol that already has a meaning.
    #[error("`{0}` is reserved: it is the name of a function, of time or of pi")]
    Reserved(String),
    /// The same symbol or column twice.
    #[error("`{}` is already {earlier}", brief(name))]
    Duplicate {
        /// The symbol or column.
        name: String,
        /// What it is already.
        earlier: String,
    },
    /// A number that is not finite, or not in the range allowed.
    #[error("{what} is {}; {allowed}", digits(*value, 6))]
    BadNumber {
        /// Whose number.
        what: &'static str,
        /// What was given.
        value: f64,
        /// What is allowed.
        allowed: String,
    },
    /// A parameter that is estimated needs a bound at least on one side.
    #[error("an estimated parameter needs `min` or `max` (both are better), or `fixed = true`")]
    MissingBound,
    /// Initial values that depend on states.
    #[error("an initial value is a number, \"free\" or an expression of parameters; this one uses the state `{}`", brief(.0))]
    InitialUsesState(String),
    /// Initial values that depend on each other.
    #[error("the initial values depend on each other in a cycle: {0}")]
    Cycle(String),
    /// An initial value that uses an input or time.
    #[error("an initial value is a number, \"free\" or an expression of parameters; `{}` changes with time", brief(.0))]
    InitialNotConstant(String),
    /// An operator with memory where none can be.
    #[error("{0}")]
    Memory(String),
    /// Two quantities that cannot be added or compared, or an equation whose sides differ.
    #[error("units clash: {0}")]
    UnitClash(String),
    /// A result that is not finite when the simulation starts.
    #[error("{0}")]
    NotFinite(String),
    /// An output that nothing drives.
    #[error("{0}")]
    NothingDrivesOutput(String),
}
