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
    let mut present = found.samples.iter().copied().filter(|x| x.is_finite());
    let Some(first) = present.next() else {
        return Err(InputError::in_column(file, name, InputProblem::AllMissing));
    };
    if present.all(|x| x == first) {
        return Err(InputError::in_column(file, name, InputProblem::Constant(first)));
    }
    Ok(found)
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
