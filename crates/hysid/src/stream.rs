//! Term selection from a CSV file of any size, in one pass and in memory that does not grow with the file.
//!
//! The file is read ahead and parsed by [`CsvStream`], the Gram matrix of the dictionary is added up by [`GramSums`] from the rows as they come,
//! and the selection is made from the Gram matrix ([`select_gram`], which says what that costs in precision). Neither the result nor an error
//! depends on the number of threads.

use std::path::{Path, PathBuf};

use hysid_dictionary::{Dictionary, DictionaryError, GramSums, Record};
use hysid_io::{Chunk, ClockWatch, CsvStream, InputError, InputProblem, require};
use hysid_select::{Options, SelectError, Selection, select_gram};

/// What a selection from a file found.
#[derive(Debug, Clone, PartialEq)]
pub struct Streamed {
    /// The selection; columns are the dictionary's terms.
    pub selection: Selection,
    /// Rows of numbers in the file; fewer have all their lags ([`Selection::samples`]).
    pub rows: u64,
    /// Bytes read.
    pub bytes: u64,
    /// The sampling period in seconds, where the file has a time column.
    pub period_s: Option<f64>,
    /// How many distinct sums the Gram matrix was made of.
    pub distinct_sums: usize,
}

/// Why a selection from a file failed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StreamError {
    /// The file.
    #[error(transparent)]
    Input(#[from] InputError),
    /// The dictionary.
    #[error(transparent)]
    Dictionary(#[from] DictionaryError),
    /// The options of the selection.
    #[error(transparent)]
    Options(#[from] SelectError),
    /// A file that reads well but holds nothing to select from.
    #[error("{}: {problem}", file.display())]
    Unfit {
        /// The file.
        file: PathBuf,
        /// What is wrong with it.
        problem: String,
    },
}

/// Selects terms of `dictionary`, whose signals name the columns, from a CSV file; `time` is the file's time column, if it has one.
///
/// `progress` is told the bytes read so far.
///
/// # Errors
/// The first thing wrong in the file, with line and column; an output that never changes; a dictionary that is too large or has no row with all
/// its lags; options out of range.
pub fn select_file(
    file: &Path,
    time: Option<&str>,
    dictionary: &Dictionary,
    options: &Options,
    progress: &dyn Fn(u64),
) -> Result<Streamed, StreamError> {
    options.check_without_samples(dictionary.len())?;
    let mut sums = GramSums::new(dictionary)?;
    let signals = dictionary.signals();
    let columns: Vec<&str> = std::iter::once(signals.output())
        .chain(signals.inputs())
        .map(|name| name.column.as_str())
        .chain(time)
        .collect();
    let mut clock = ClockWatch::new();
    let mut output = require::Values::default();
    let (rows, bytes) = for_each_chunk(file, &columns, progress, |chunk, stream| {
        if let (Some(name), Some(t)) = (time, chunk.columns.get(columns.len() - 1)) {
            clock.judge(t, stream.decimals(columns.len() - 1)).map_err(|(n, problem)| match chunk.lines.get(n) {
                Some(&line) => InputError::at(file, line, Some(name), problem),
                None => InputError::in_column(file, name, problem),
            })?;
        }
        output.see(&chunk.columns[0]);
        let inputs = chunk.columns[1..=signals.inputs().len()].iter().map(Vec::as_slice).collect();
        Ok(sums.push(&Record::new(&chunk.columns[0], inputs))?)
    })?;
    let distinct_sums = sums.distinct_sums();
    if rows == 0 {
        return Err(InputError::whole(file, InputProblem::HeaderOnly).into());
    }
    let unfit = |problem: String| StreamError::Unfit { file: file.to_path_buf(), problem };
    let gram = sums.finish().map_err(|e| unfit(e.to_string()))?;
    if let Some(problem) = output.problem() {
        return Err(InputError::in_column(file, &signals.output().column, problem).into());
    }
    let selection = select_gram(&gram, options).map_err(|e| unfit(e.to_string()))?;
    Ok(Streamed { selection, rows, bytes, period_s: clock.period_s(), distinct_sums })
}

/// Reads a file to its end, chunk by chunk; returns its rows and bytes.
///
/// # Errors
/// The first thing wrong in the file, or what `each` finds.
pub fn for_each_chunk(
    file: &Path,
    columns: &[&str],
    progress: &dyn Fn(u64),
    mut each: impl FnMut(&Chunk, &CsvStream) -> Result<(), StreamError>,
) -> Result<(u64, u64), StreamError> {
    let mut stream = CsvStream::open(file, Some(columns))?;
    let mut rows = 0;
    loop {
        let chunks = stream.next_chunks()?;
        if chunks.is_empty() {
            return Ok((rows, stream.bytes()));
        }
        for chunk in &chunks {
            rows += chunk.lines.len() as u64;
            each(chunk, &stream)?;
        }
        progress(stream.bytes());
    }
}
