//! What a caller may need of a recording, judged with one clear message: a column that exists, varies and is long enough.
//!
//! `file` is the path by which messages name the recording: that which the user gave, with its folders.

use std::path::Path;

use hysid_signal::{Channel, Recording};

use crate::error::{InputError, InputProblem, listed};

/// The channel of this name.
///
/// # Errors
/// [`InputProblem::MissingColumn`], with the names that there are.
pub fn channel<'a>(file: &Path, recording: &'a Recording, name: &str) -> Result<&'a Channel, InputError> {
    recording.channel(name).ok_or_else(|| {
        let has = listed(recording.channels().iter().map(|c| c.name.as_str()));
        InputError::in_column(file, name, InputProblem::MissingColumn(has))
    })
}

/// The channel of this name, which must take at least two values.
///
/// # Errors
/// As [`channel`]; [`InputProblem::AllMissing`]; [`InputProblem::Constant`].
pub fn varying<'a>(file: &Path, recording: &'a Recording, name: &str) -> Result<&'a Channel, InputError> {
    let found = channel(file, recording, name)?;
    let mut values = Values::default();
    values.see(&found.samples);
    match values.problem() {
        Some(problem) => Err(InputError::in_column(file, name, problem)),
        None => Ok(found),
    }
}

/// Whether a column takes more than one value, told of it in as many parts as it comes in.
#[derive(Debug, Default)]
pub struct Values {
    first: Option<f64>,
    vary: bool,
}

impl Values {
    /// Takes more of the column in; what is not finite is missing.
    pub fn see(&mut self, samples: &[f64]) {
        for &x in samples.iter().filter(|x| x.is_finite()) {
            self.vary |= *self.first.get_or_insert(x) != x;
        }
    }

    /// What is wrong with the column that was seen: no value at all, or one only.
    pub fn problem(&self) -> Option<InputProblem> {
        match self.first {
            None => Some(InputProblem::AllMissing),
            Some(value) => (!self.vary).then_some(InputProblem::Constant(value)),
        }
    }
}

/// The number of samples at which none of the named channels is missing, which must be at least `needed`.
///
/// # Errors
/// As [`channel`]; [`InputProblem::TooFewSamples`].
pub fn samples(file: &Path, recording: &Recording, names: &[&str], needed: usize) -> Result<usize, InputError> {
    for name in names {
        channel(file, recording, name)?;
    }
    let found = recording.segments(names).iter().map(ExactSizeIterator::len).sum();
    if found < needed {
        let problem = InputProblem::TooFewSamples { found, needed };
        return Err(InputError::whole(file, problem));
    }
    Ok(found)
}
