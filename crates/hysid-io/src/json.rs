//! JSON files: any value, or a model file with its `format` and `format_version` first.

use std::fs;
use std::path::Path;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::atomic::write_bytes;
use crate::error::{InputError, InputProblem, WriteError};

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
    serde_json::from_str(&read_text(path)?).map_err(|e| json_error(path, &e))
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

/// Reads a model file of this format and of a version up to `newest`; returns its version and its body.
///
/// # Errors
/// As [`read_json`]; another format; a newer version.
pub fn read_versioned<T: DeserializeOwned>(
    path: &Path,
    format: &'static str,
    newest: u64,
) -> Result<(u64, T), InputError> {
    let text = read_text(path)?;
    let label: Label = serde_json::from_str(&text).map_err(|e| json_error(path, &e))?;
    if label.format != format {
        let problem = InputProblem::WrongFormat { found: label.format, expected: format };
        return Err(InputError::whole(path, problem));
    }
    if label.format_version > newest || label.format_version == 0 {
        let problem = InputProblem::UnknownVersion { found: label.format_version, newest };
        return Err(InputError::whole(path, problem));
    }
    let mut body: Value = serde_json::from_str(&text).map_err(|e| json_error(path, &e))?;
    if let Some(object) = body.as_object_mut() {
        object.shift_remove("format");
        object.shift_remove("format_version");
    }
    let body = serde_json::from_value(body).map_err(|e| json_error(path, &e))?;
    Ok((label.format_version, body))
}

fn read_text(path: &Path) -> Result<String, InputError> {
    let bytes = fs::read(path).map_err(|e| InputError::whole(path, InputProblem::from_io(&e)))?;
    String::from_utf8(bytes).map_err(|_| InputError::whole(path, InputProblem::NotUtf8("")))
}

fn json_error(path: &Path, error: &serde_json::Error) -> InputError {
    let problem = InputProblem::Json(error.to_string());
    match error.line() {
        0 => InputError::whole(path, problem),
        line => InputError::at(path, line as u64, None, problem),
    }
}
