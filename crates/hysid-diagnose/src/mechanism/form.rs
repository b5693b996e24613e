//! What a law is written for, and the forms that compete for a recording.

/// What a law is written for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Purpose {
    /// To be ranked: linear in its amplitudes, whose zero is the baseline; shapes lie on a grid.
    Screening,
    /// To be fitted and handed out: the physical parameters.
    Refit,
    /// The same in another form, which competes with the plain one by its evidence.
    Form(Form),
}

/// Another form of a law. A law that has no such form is written as the plain one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Form {
    /// A weight for each of a few terms, in place of a series with a few shape parameters: three plays for a smooth density; one term of two.
    Few,
    /// The law in another arrangement: plays that widen with the rate in place of a lag behind them, powers about the point of operation, a loop
    /// that stiffens where the plain one gives way.
    Other,
    /// More terms, for recordings that are sharp enough to tell: six plays in place of three, a lag that does not start settled.
    Finer,
    /// More terms, whose places are fitted too: six plays with a spacing of their own.
    Spaced,
    /// A memory that is not settled at the first sample: the current of a drive that is switched on, plays that an earlier input moved.
    Unsettled,
    /// Such a memory, of more terms.
    FinerUnsettled,
    /// Without a knee: a limit that is approached as a hyperbolic tangent approaches one.
    Soft,
    /// The same, as a hyperbola approaches one.
    Softer,
}

impl Purpose {
    /// What a law is fitted as, in the order in which the forms are tried.
    pub const FITTED: [Self; 9] = [
        Self::Refit,
        Self::Form(Form::Unsettled),
        Self::Form(Form::Other),
        Self::Form(Form::Few),
        Self::Form(Form::Finer),
        Self::Form(Form::FinerUnsettled),
        Self::Form(Form::Spaced),
        Self::Form(Form::Soft),
        Self::Form(Form::Softer),
    ];
}
