//! What can be wrong with the input of a diagnosis. Numerical events (a diverging candidate) are results and never come here.

/// Bad input: what was given, and what is allowed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DiagnoseError {
    /// There is nothing to estimate from.
    #[error("no recording to estimate from: give at least one")]
    NoRecording,
    /// A column that the simulation names is not in the recording.
    #[error("{recording}: there is no column `{column}`, which the simulation names; the columns are {available}")]
    MissingColumn {
        /// The recording.
        recording: String,
        /// The column.
        column: String,
        /// What there is.
        available: String,
    },
    /// A recording with too few complete samples.
    #[error(
        "{recording}: {found} usable samples (rows with all inputs and an output); the simulation has {parameters} free parameters and initial states, and at least {needed} samples are needed"
    )]
    TooFewSamples {
        /// The recording.
        recording: String,
        /// Usable samples.
        found: usize,
        /// Free parameters.
        parameters: usize,
        /// Samples needed.
        needed: usize,
    },
    /// A recording with so many gaps that nothing can be simulated in one go.
    #[error(
        "{recording}: samples are missing so often that only {found} of them lie in runs that can be simulated (at least {run} rows with all inputs, of them {measured} measured in a row); at least {needed} are needed"
    )]
    TooManyGaps {
        /// The recording.
        recording: String,
        /// Samples in such runs.
        found: usize,
        /// Rows with all inputs in a row.
        run: usize,
        /// Rows of them with an output in a row.
        measured: usize,
        /// Samples needed.
        needed: usize,
    },
    /// A measured output that never changes.
    #[error("{recording}: column `{column}` is constant ({value}); a constant output cannot be diagnosed")]
    ConstantOutput {
        /// The recording.
        recording: String,
        /// The column.
        column: String,
        /// Its value.
        value: f64,
    },
    /// Inputs that never change, where a clone of the simulator must be found.
    #[error("{recording}: `{columns}` never changes: what the simulator makes of its input cannot be seen")]
    NothingDrives {
        /// The recording.
        recording: String,
        /// The inputs.
        columns: String,
    },
    /// A hold-out of which half or more is in a recording that is learnt from.
    #[error(
        "{recording}: {rows} of its rows stand in {learnt}, too, which is learnt from; the hold-out must be data that the estimation never sees"
    )]
    SeenBefore {
        /// The hold-out.
        recording: String,
        /// The recording for estimation.
        learnt: String,
        /// How many rows: all of them where one is a copy of the other.
        rows: usize,
    },
    /// The simulation cannot be used.
    #[error("{file}: {problem}")]
    Simulation {
        /// The file.
        file: String,
        /// What is wrong.
        problem: String,
    },
    /// An output that nothing can change.
    #[error("{file}: output `{column}` depends on no state, input or parameter; there is nothing to diagnose in it")]
    DeadOutput {
        /// The simulation file.
        file: String,
        /// The output.
        column: String,
    },
    /// The simulation diverges for every start that was tried.
    #[error(
        "{file}: the simulation diverges on {recording} (at {at_s} s with the values in the file) and no set of parameters within the bounds was found where it does not"
    )]
    Explodes {
        /// The simulation file.
        file: String,
        /// The recording.
        recording: String,
        /// When, in seconds on the recording's clock.
        at_s: f64,
    },
    /// A question about an effect that the simulation cannot have.
    #[error("--consider {asked}: {why}")]
    Question {
        /// The effect, as it was written.
        asked: String,
        /// What is wrong, and what would be right.
        why: String,
    },
    /// An option outside its range.
    #[error("{option} is {given}; allowed is {allowed}")]
    Option {
        /// The option.
        option: &'static str,
        /// What was given.
        given: String,
        /// What is allowed.
        allowed: &'static str,
    },
}
