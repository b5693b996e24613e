//! Where a law's text ends up in the equations.

use hysid_plant::Expr;

/// Where a law's text ends up.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Target {
    /// Taken from the derivatives of these states, above the line of a quotient by a mass.
    Derivatives(Vec<Pull>),
    /// Added to this output.
    Output(String),
    /// What each of these outputs sees is added to it.
    Outputs(Vec<Seen>),
    /// Replaces this symbol in every equation.
    Symbol(String),
    /// Replaces this symbol in the derivatives of these states. Where the signal is a sum, the expression is what it holds besides the
    /// symbol.
    SymbolIn(String, Vec<String>, Option<Expr>),
    /// Replaces this part of the derivatives of these states.
    PartIn(Expr, Vec<String>),
    /// Replaces the half-width of every play of this symbol; `r` stands for what it was.
    HalfWidths(String),
}

/// An output that sees the motion of a part.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Seen {
    /// Its column.
    pub column: String,
    /// Which derivative of the displacement it measures.
    pub rate: Rate,
}

/// Which derivative of a displacement is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Rate {
    Displacement,
    Velocity,
    Acceleration,
}

/// A state whose derivative a force changes, and how.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Pull {
    /// The state.
    pub state: String,
    /// Whether the force is taken from it (1) or added to it (-1).
    pub sign: f64,
    /// What the force is multiplied by where that is not one: the ratio of a gear, the resistance over which a current drops.
    pub lever: Option<Expr>,
}

impl Pull {
    /// A force that is taken from this state, times the sign.
    pub(super) fn new(state: &str, sign: f64) -> Self {
        Self { state: state.to_owned(), sign, lever: None }
    }

    /// The part of a force that this state feels.
    pub fn of(&self, force: &Expr) -> Expr {
        match &self.lever {
            Some(lever) => lever.clone() * force.clone(),
            None => force.clone(),
        }
    }

    /// A sum in which the state feels this part; `resists` is -1 for what drives.
    pub fn join(&self, sum: Expr, part: Expr, resists: f64) -> Expr {
        if self.sign * resists > 0.0 { sum - part } else { sum + part }
    }
}
