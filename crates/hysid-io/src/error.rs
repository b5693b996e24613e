//! What can be wrong with a file, told with its name, line and column.

use std::fmt;
use std::path::{Path, PathBuf};

use hysid_signal::tell::{brief, counted, digits};

/// Names of columns that a message lists at most.
const MOST_NAMES: usize = 20;

/// Bad input: which file, where in it, and what is wrong there.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub struct InputError {
    /// The file.
    pub file: PathBuf,
    /// The line, counted from 1 (the header is line 1), where one line is at fault.
    pub line: Option<u64>,
    /// The column's name (or its number from 1, where it has no name), where one column is at fault.
    pub column: Option<String>,
    /// What is wrong.
    pub problem: InputProblem,
}

impl fmt::Display for InputError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.file.display())?;
        if let Some(line) = self.line {
            write!(f, ", line {line}")?;
        }
        if let Some(column) = &self.column {
            write!(f, ", column `{}`", brief(column))?;
        }
        write!(f, ": {}", self.problem)
    }
}

impl InputError {
    /// An error about the file as a whole.
    pub fn whole(file: &Path, problem: InputProblem) -> Self {
        Self { file: file.to_path_buf(), line: None, column: None, problem }
    }

    /// An error about one column.
    pub fn in_column(file: &Path, column: &str, problem: InputProblem) -> Self {
        Self { file: file.to_path_buf(), line: None, column: Some(column.to_owned()), problem }
    }

    /// An error at one line and, where one is at fault, one column.
    pub fn at(file: &Path, line: u64, column: Option<&str>, problem: InputProblem) -> Self {
        Self { file: file.to_path_buf(), line: Some(line), column: column.map(str::to_owned), problem }
    }
}

/// What is wrong with the input, with what was given and what is allowed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum InputProblem {
    /// There is no such file.
    #[error("there is no such file")]
    NotFound,
    /// The path is a pipe or a device, where a file is needed that can be read twice.
    #[error("this is a pipe or a device; a recording is read more than once and must be a file")]
    NotAFile,
    /// The file is larger than anything of its kind.
    #[error("the file is larger than {0} bytes, which no file of this kind is")]
    TooLarge(u64),
    /// The path is a directory.
    #[error("this is a directory; a file is needed")]
    IsDirectory,
    /// The file may not be read.
    #[error("permission denied")]
    PermissionDenied,
    /// Another failure while reading.
    #[error("cannot be read: {0}")]
    Io(String),
    /// The file has no bytes (or only blank lines).
    #[error("the file is empty; a header line and at least two lines of numbers are needed")]
    Empty,
    /// There is a header and nothing below it.
    #[error("there is a header line but not one line of numbers")]
    HeaderOnly,
    /// The text is not UTF-8.
    #[error("the text is not UTF-8{0}")]
    NotUtf8(&'static str),
    /// The line ends are those of an old Macintosh.
    #[error(
        "the lines end in a carriage return (CR) alone; they must end in LF or CR LF: save the file with the line ends of Unix or Windows"
    )]
    CarriageReturns,
    /// The first line holds numbers.
    #[error("the first line holds numbers; it must name the columns")]
    NoHeader,
    /// The columns are separated by something else than a comma.
    #[error("the columns look separated by {0}; commas are needed (and points in numbers)")]
    WrongSeparator(&'static str),
    /// A column has an empty name.
    #[error("a column has no name")]
    UnnamedColumn,
    /// Two columns share a name.
    #[error("two columns have this name")]
    DuplicateColumn,
    /// A needed column is not there.
    #[error("there is no such column; the file has {0}")]
    MissingColumn(String),
    /// No time column and no period.
    #[error(
        "there is no time column `t_s`, and no sampling period was given; the file has {0}: name the column of the time in seconds `t_s`, \
         or give the period (`--period-s`, or `period_s` in [time] of a simulation)"
    )]
    NoClock(String),
    /// A row with too few or too many fields.
    #[error("{} where the header has {expected}", counted(*found, "field"))]
    RaggedRow {
        /// Fields in this row.
        found: u64,
        /// Fields in the header.
        expected: u64,
    },
    /// A field that is not a number.
    #[error("`{0}` is not a number (an empty field or `NaN` stands for a missing sample)")]
    NotANumber(String),
    /// A value that no recording holds.
    #[error("`{0}` is out of range (the largest magnitude allowed is 1e100)")]
    OutOfRange(String),
    /// A time stamp is missing.
    #[error("a time stamp is missing")]
    MissingTime,
    /// Time goes back.
    #[error("time goes back, from {} s to {} s", stamp(*before), stamp(*here))]
    DecreasingTime {
        /// The time stamp before.
        before: f64,
        /// The time stamp at fault.
        here: f64,
    },
    /// The same time stamp twice.
    #[error("the time stamp {} s stands twice", stamp(*.0))]
    DuplicateTime(f64),
    /// The clock is not uniform.
    #[error(
        "the clock is not uniform: {} s where a period of {} s since the first sample leads to {} s (rows are missing, \
         or the recording must be resampled)",
        stamp(*here),
        digits(*period, 4),
        stamp(*expected)
    )]
    NonUniformClock {
        /// The time stamp found.
        here: f64,
        /// The time stamp expected.
        expected: f64,
        /// The period of the whole recording.
        period: f64,
    },
    /// Too few samples for what is asked.
    #[error("{}; at least {needed} are needed", counted(*found, "sample"))]
    TooFewSamples {
        /// Number of samples found.
        found: usize,
        /// Number of samples needed.
        needed: usize,
    },
    /// Not one sample is there.
    #[error("not one sample is there (all are missing)")]
    AllMissing,
    /// The column never changes.
    #[error("the column is constant ({}); nothing can be learnt from it", digits(*.0, 4))]
    Constant(f64),
    /// A period given by the caller that is no period.
    #[error("the sampling period is {0} s; it must be a finite number above zero")]
    BadPeriod(f64),
    /// A JSON file that does not parse, with its column in the line and the key there where they are known.
    #[error("not the JSON that is needed: {0}")]
    Json(String),
    /// A model file of another kind.
    #[error("the file holds `{}`; `{expected}` is needed", brief(found))]
    WrongFormat {
        /// The `format` found.
        found: String,
        /// The `format` needed.
        expected: &'static str,
    },
    /// A model file of a version that this program does not know.
    #[error("format version {found}; this program reads version {newest} and older")]
    UnknownVersion {
        /// The version found.
        found: u64,
        /// The newest version known.
        newest: u64,
    },
}

impl InputProblem {
    /// The problem that a failed read tells of.
    pub(crate) fn from_io(error: &std::io::Error) -> Self {
        match error.kind() {
            std::io::ErrorKind::NotFound => Self::NotFound,
            std::io::ErrorKind::PermissionDenied => Self::PermissionDenied,
            std::io::ErrorKind::IsADirectory => Self::IsDirectory,
            _ => Self::Io(error.to_string()),
        }
    }
}

/// A time stamp for a message: the digits that tell it from its neighbours, without those of the arithmetic.
fn stamp(seconds: f64) -> String {
    digits(seconds, 10)
}

/// The names for a message, of many columns the first ones.
pub(crate) fn listed<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    let mut names = names.into_iter();
    let shown: Vec<String> = names.by_ref().take(MOST_NAMES).map(|n| format!("`{}`", brief(n))).collect();
    match names.count() {
        0 => shown.join(", "),
        more => format!("{} and {more} more", shown.join(", ")),
    }
}

/// A file that could not be written; nothing is left where it should have been.
#[derive(Debug, thiserror::Error)]
#[error("{} cannot be written: {source}", file.display())]
pub struct WriteError {
    /// The file.
    pub file: PathBuf,
    /// Why.
    #[source]
    pub source: std::io::Error,
}
