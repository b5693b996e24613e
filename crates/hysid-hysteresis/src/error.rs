//! What can be wrong with an operator's parameters, and the checks that find it.

use std::fmt;

/// A parameter, or a relation between parameters, that an operator does not allow.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{operator}: {given} is not allowed; {allowed}")]
pub struct ParameterError {
    /// The operator's name, as in `bouc-wen`.
    pub operator: &'static str,
    /// What was given, as in `beta = -1`.
    pub given: String,
    /// What is allowed, as in `beta must be above 0`.
    pub allowed: String,
}

/// Collects the checks of one operator's parameters: the first that fails is the error.
pub(crate) struct Check(pub(crate) &'static str);

impl Check {
    /// The error for `given`.
    pub(crate) fn refuse(&self, given: impl fmt::Display, allowed: impl fmt::Display) -> ParameterError {
        ParameterError { operator: self.0, given: given.to_string(), allowed: allowed.to_string() }
    }

    /// A finite number.
    pub(crate) fn finite(&self, name: &str, value: f64) -> Result<(), ParameterError> {
        self.require(name, value, value.is_finite(), "a finite number")
    }

    /// A finite number above zero.
    pub(crate) fn positive(&self, name: &str, value: f64) -> Result<(), ParameterError> {
        self.require(name, value, value.is_finite() && value > 0.0, "a finite number above 0")
    }

    /// A finite number that is zero or above.
    pub(crate) fn not_negative(&self, name: &str, value: f64) -> Result<(), ParameterError> {
        self.require(name, value, value.is_finite() && value >= 0.0, "a finite number of 0 or more")
    }

    /// A value for which `holds`; otherwise the error says that it must be `what`.
    pub(crate) fn require(&self, name: &str, value: f64, holds: bool, what: &str) -> Result<(), ParameterError> {
        if holds {
            Ok(())
        } else {
            Err(self.refuse(format_args!("{name} = {value}"), format_args!("{name} must be {what}")))
        }
    }
}
