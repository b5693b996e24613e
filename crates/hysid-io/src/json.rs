//! JSON files: any value, or a model file with its `format` and `format_version` first.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use hysid_signal::tell::brief;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::atomic::write_bytes;
use crate::error::{InputError, InputProblem, WriteError};
use crate::json_place::key_at;

/// Bytes of the largest JSON file that is read.
const LARGEST_JSON: u64 = 1 << 24;

#[derive(Deserialize)]
struct Label {
    format: String,
    format_version: u64,
}

/// Writes a value as indented JSON. A number that is not finite becomes `null`.
///
/// # Errors
/// A path that cannot be written; a value that JSON cannot hold (a map whose keys are not text).
pub fn write_json<T: Serialize>(path: &Path, value: &T) -> Result<(), WriteError> {
    let mut bytes = serde_json::to_vec_pretty(value)
        .map_err(|e| WriteError { file: path.to_path_buf(), source: std::io::Error::other(e) })?;
    bytes.push(b'\n');
    write_bytes(path, &bytes)
}

/// Reads a value from a JSON file.
///
/// # Errors
/// A file that cannot be read, is not UTF-8, or does not hold this kind of value; the message names the line.
pub fn read_json<T: DeserializeOwned>(path: &Path) -> Result<T, InputError> {
    from_json(path, &read_text(path, LARGEST_JSON)?)
}

/// Writes a model file: the fields of `body`, which must be a struct or a map, after `format` and `format_version`.
///
/// # Errors
/// As [`write_json`]; a body that is not an object or that has a field of either name itself.
pub fn write_versioned<T: Serialize>(path: &Path, format: &str, version: u64, body: &T) -> Result<(), WriteError> {
    let refuse = |what: String| WriteError { file: path.to_path_buf(), source: std::io::Error::other(what) };
    let Value::Object(fields) = serde_json::to_value(body).map_err(|e| refuse(e.to_string()))? else {
        return Err(refuse("a model file must be an object".into()));
    };
    let mut object = Map::new();
    object.insert("format".into(), format.into());
    object.insert("format_version".into(), version.into());
    for (name, value) in fields {
        if object.insert(name.clone(), value).is_some() {
            return Err(refuse(format!("the body has a field `{name}` of its own")));
        }
    }
    write_json(path, &Value::Object(object))
}

/// Reads a model file of this format and of a version up to `newest`; returns its version and its body, which must let the fields `format`
/// and `format_version` pass.
///
/// # Errors
/// As [`read_json`]; another format; a newer version.
pub fn read_versioned<T: DeserializeOwned>(
    path: &Path,
    format: &'static str,
    newest: u64,
) -> Result<(u64, T), InputError> {
    let text = read_text(path, LARGEST_JSON)?;
    let label: Label = from_json(path, &text)?;
    if label.format != format {
        let problem = InputProblem::WrongFormat { found: label.format, expected: format };
        return Err(InputError::whole(path, problem));
    }
    if label.format_version > newest || label.format_version == 0 {
        let problem = InputProblem::UnknownVersion { found: label.format_version, newest };
        return Err(InputError::whole(path, problem));
    }
    Ok((label.format_version, from_json(path, &text)?))
}

/// The text of a file of at most `largest` bytes, without a byte-order mark. More than that is never read, however large the file is.
///
/// # Errors
/// A file that cannot be read, is larger, or is not UTF-8.
pub fn read_text(path: &Path, largest: u64) -> Result<String, InputError> {
    let whole = |problem| InputError::whole(path, problem);
    let io = |e: std::io::Error| whole(InputProblem::from_io(&e));
    let file = File::open(path).map_err(io)?;
    let mut bytes = Vec::new();
    file.take(largest + 1).read_to_end(&mut bytes).map_err(io)?;
    if bytes.len() as u64 > largest {
        return Err(whole(InputProblem::TooLarge(largest)));
    }
    let text = String::from_utf8(bytes).map_err(|_| whole(InputProblem::NotUtf8("")))?;
    Ok(text.strip_prefix('\u{feff}').map(str::to_owned).unwrap_or(text))
}

fn from_json<T: DeserializeOwned>(path: &Path, text: &str) -> Result<T, InputError> {
    serde_json::from_str(text).map_err(|e| json_error(path, text, &e))
}

/// The parser's message with the column and the key, in the words of the file and not of this program's types.
fn json_error(path: &Path, text: &str, error: &serde_json::Error) -> InputError {
    let (line, column) = (error.line(), error.column());
    let place = format!(" at line {line} column {column}");
    let said = error.to_string();
    let mut said = said.strip_suffix(&place).unwrap_or(&said).to_owned();
    for (ours, plain) in [
        ("expected usize", "expected a whole number"),
        ("expected u64", "expected a whole number"),
        ("expected f64", "expected a number"),
    ] {
        said = said.replace(ours, plain);
    }
    if let Some((before, _)) = said.split_once("expected struct ") {
        // Of an array in the place of an object the parser may count the elements.
        let array = before.starts_with("invalid length") || before.starts_with("invalid type: sequence");
        let before = if array { "this is an array, " } else { before };
        said = format!("{before}expected an object, `{{...}}`");
    }
    if line == 0 {
        return InputError::whole(path, InputProblem::Json(said));
    }
    let key = key_at(text, line, column);
    let key = if key.is_empty() { String::new() } else { format!(", `{}`", brief(&key)) };
    InputError::at(path, line as u64, None, InputProblem::Json(format!("column {column}{key}: {said}")))
}
