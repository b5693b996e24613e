//! The model file: its own structs, converted at the edge, so that the file outlives the types in memory.

use std::path::Path;

use hysid_dictionary::{SignalName, Signals};
use hysid_io::{InputError, WriteError};
use hysid_signal::tell::digits;
use serde::{Deserialize, Serialize};

use crate::model::{Coefficient, NoiseTerm, Parts};
use crate::{Derived, Law, NarxError, NarxModel, Past};

/// The name of the format in the file.
pub const MODEL_FORMAT: &str = "hysid.model";
/// The version of the format that is written.
pub const MODEL_VERSION: u64 = 1;

/// What can go wrong when a model file is read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LoadError {
    /// The file cannot be read or is not of this format.
    #[error(transparent)]
    Input(#[from] InputError),
    /// It does not describe a model.
    #[error("{file}: {source}")]
    Model {
        /// The file.
        file: String,
        /// What is wrong.
        source: NarxError,
    },
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(expecting = "an object with `symbol` and `column`")]
struct FileSignal {
    symbol: String,
    column: String,
    #[serde(default)]
    sign_threshold: f64,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(tag = "law", rename_all = "snake_case", expecting = "an object with `law`")]
enum FileLaw {
    Play {
        half_width: f64,
        #[serde(default, skip_serializing_if = "Option::is_none")]
        rested_at: Option<f64>,
        #[serde(default, skip_serializing_if = "Option::is_none")]
        turned_at: Option<f64>,
    },
    Dahl {
        length: f64,
    },
    Filter {
        a: Vec<f64>,
    },
    SoftThreshold {
        centre: f64,
        width: f64,
    },
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(expecting = "an object with `symbol`, `of` and `law`")]
struct FileDerived {
    symbol: String,
    of: String,
    #[serde(default)]
    sign_threshold: f64,
    #[serde(flatten)]
    law: FileLaw,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(expecting = "an object with `term` and `coefficient`")]
struct FileTerm {
    term: String,
    coefficient: f64,
    standard_error: Option<f64>,
    err: Option<f64>,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(expecting = "an object with `term`, `residual_lag` and `coefficient`")]
struct FileNoise {
    term: String,
    residual_lag: usize,
    coefficient: f64,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(expecting = "an object with the parts of a model")]
struct FileModel {
    output: FileSignal,
    inputs: Vec<FileSignal>,
    derived: Vec<FileDerived>,
    period_s: Option<f64>,
    decimation: usize,
    limit: f64,
    terms: Vec<FileTerm>,
    noise: Vec<FileNoise>,
}

impl NarxModel {
    /// Writes the model as JSON.
    ///
    /// # Errors
    /// A path that cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), WriteError> {
        hysid_io::write_versioned(path, MODEL_FORMAT, MODEL_VERSION, &to_file(self.parts()))
    }

    /// Reads a model that [`NarxModel::save`] wrote.
    ///
    /// # Errors
    /// A file that cannot be read, is of another format or a newer version, or does not describe a model.
    pub fn load(path: &Path) -> Result<Self, LoadError> {
        let (_, file): (u64, FileModel) = hysid_io::read_versioned(path, MODEL_FORMAT, MODEL_VERSION)?;
        let model = sense(&file).and_then(|()| from_file(file)).and_then(NarxModel::new);
        model.map_err(|source| LoadError::Model { file: path.display().to_string(), source })
    }
}

/// Steps of a model in samples of the recording, at most.
const LARGEST_DECIMATION: usize = 1_000_000;

/// Refuses what no identification writes, with the key.
fn sense(file: &FileModel) -> Result<(), NarxError> {
    let bad = |what: String| Err(NarxError::BadFile(what));
    if file.terms.is_empty() {
        return bad("`terms` is empty; a model has one term at least".into());
    }
    if let Some(period) = file.period_s.filter(|p| !(p.is_finite() && *p > 0.0)) {
        return bad(format!("`period_s` is {}; a number of seconds above 0 is needed", digits(period, 4)));
    }
    if !(1..=LARGEST_DECIMATION).contains(&file.decimation) {
        return bad(format!("`decimation` is {}; allowed is 1 to {LARGEST_DECIMATION}", file.decimation));
    }
    if file.limit.is_nan() || file.limit <= 0.0 {
        return bad(format!("`limit` is {}; a number above 0 is needed", digits(file.limit, 4)));
    }
    for (i, term) in file.terms.iter().enumerate() {
        if let Some(error) = term.standard_error.filter(|e| e.is_nan() || *e < 0.0) {
            return bad(format!("`terms[{i}].standard_error` is {}; it cannot be below 0", digits(error, 4)));
        }
    }
    if let Some(i) = file.noise.iter().position(|t| t.residual_lag == 0) {
        return bad(format!("`noise[{i}].residual_lag` is 0; it must be 1 or more"));
    }
    Ok(())
}

fn finite(x: f64) -> Option<f64> {
    x.is_finite().then_some(x)
}

fn to_file(parts: &Parts) -> FileModel {
    let name =
        |n: &SignalName| FileSignal { symbol: n.symbol.clone(), column: n.column.clone(), sign_threshold: n.threshold };
    let inputs = parts.signals.inputs();
    let recorded = inputs.len() - parts.derived.len();
    let derived = parts.derived.iter().zip(&inputs[recorded..]).map(|(d, n)| FileDerived {
        symbol: n.symbol.clone(),
        of: inputs[d.source].symbol.clone(),
        sign_threshold: n.threshold,
        law: match &d.law {
            Law::Play { half_width, past } => {
                let (rested_at, turned_at) = match *past {
                    Past::FirstSample => (None, None),
                    Past::RestedAt(level) => (Some(level), None),
                    Past::TurnedAt(level) => (None, Some(level)),
                };
                FileLaw::Play { half_width: *half_width, rested_at, turned_at }
            }
            Law::Dahl { length } => FileLaw::Dahl { length: *length },
            Law::Filter { a } => FileLaw::Filter { a: a.clone() },
            Law::SoftThreshold { centre, width } => FileLaw::SoftThreshold { centre: *centre, width: *width },
        },
    });
    FileModel {
        output: name(parts.signals.output()),
        inputs: inputs[..recorded].iter().map(name).collect(),
        derived: derived.collect(),
        period_s: parts.period_s,
        decimation: parts.decimation,
        limit: parts.limit,
        terms: parts
            .coefficients
            .iter()
            .map(|c| FileTerm {
                term: parts.signals.format(&c.term),
                coefficient: c.theta,
                standard_error: finite(c.standard_error),
                err: finite(c.err),
            })
            .collect(),
        noise: parts
            .noise
            .iter()
            .map(|t| FileNoise { term: parts.signals.format(&t.term), residual_lag: t.lag, coefficient: t.theta })
            .collect(),
    }
}

fn from_file(file: FileModel) -> Result<Parts, NarxError> {
    let name = |s: FileSignal| SignalName { symbol: s.symbol, column: s.column, threshold: s.sign_threshold };
    let mut inputs: Vec<SignalName> = file.inputs.into_iter().map(name).collect();
    let mut derived = Vec::new();
    for d in file.derived {
        let Some(source) = inputs.iter().position(|n| n.symbol == d.of) else {
            let problem = format!("there is no input `{}` before it", d.of);
            return Err(NarxError::BadDerived { symbol: d.symbol, problem });
        };
        let law = match d.law {
            FileLaw::Play { half_width, rested_at, turned_at } => {
                let past = match (rested_at, turned_at) {
                    (None, None) => Past::FirstSample,
                    (Some(level), None) => Past::RestedAt(level),
                    (None, Some(level)) => Past::TurnedAt(level),
                    (Some(_), Some(_)) => {
                        let problem = "it has both `rested_at` and `turned_at`".into();
                        return Err(NarxError::BadDerived { symbol: d.symbol, problem });
                    }
                };
                Law::Play { half_width, past }
            }
            FileLaw::Dahl { length } => Law::Dahl { length },
            FileLaw::Filter { a } => Law::Filter { a },
            FileLaw::SoftThreshold { centre, width } => Law::SoftThreshold { centre, width },
        };
        inputs.push(SignalName { symbol: d.symbol.clone(), column: d.symbol.clone(), threshold: d.sign_threshold });
        derived.push(Derived { symbol: d.symbol, source, law });
    }
    let signals = Signals::new(name(file.output), inputs)?;
    let coefficients = file
        .terms
        .into_iter()
        .map(|t| {
            Ok(Coefficient {
                term: signals.parse(&t.term)?,
                theta: t.coefficient,
                standard_error: t.standard_error.unwrap_or(f64::NAN),
                err: t.err.unwrap_or(f64::NAN),
            })
        })
        .collect::<Result<Vec<_>, NarxError>>()?;
    let noise = file
        .noise
        .into_iter()
        .map(|t| Ok(NoiseTerm { term: signals.parse(&t.term)?, lag: t.residual_lag, theta: t.coefficient }))
        .collect::<Result<Vec<_>, NarxError>>()?;
    Ok(Parts {
        signals,
        derived,
        coefficients,
        noise,
        limit: file.limit,
        period_s: file.period_s,
        decimation: file.decimation,
    })
}
