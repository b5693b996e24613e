//! How a command fails: bad input (exit status 2) or a failure of the program itself (exit status 1).

use std::fmt::Display;
use std::process::ExitCode;

/// What ended a command before its result was written.
#[derive(Debug)]
pub enum Failure {
    /// The user's files or options are at fault; the message names file, line and column where there are any.
    BadInput(String),
    /// The program is at fault.
    Internal(anyhow::Error),
}

impl Failure {
    /// Bad input, told by an error of one of our libraries.
    pub fn bad_input(error: impl Display) -> Self {
        Self::BadInput(error.to_string())
    }

    /// Prints the message to stderr and returns the exit status.
    pub fn report(self) -> ExitCode {
        match self {
            Self::BadInput(message) => {
                eprintln!("hysid: {message}");
                ExitCode::from(2)
            }
            Self::Internal(error) => {
                eprintln!("hysid: this is a failure of the program itself: {error:#}");
                ExitCode::from(1)
            }
        }
    }
}

impl From<anyhow::Error> for Failure {
    fn from(error: anyhow::Error) -> Self {
        Self::Internal(error)
    }
}
