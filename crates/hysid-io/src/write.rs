//! CSV out: shortest decimal form that reads back as the same number, `NaN` for a missing sample.

use std::io::{Error, ErrorKind, Write};
use std::path::Path;

use hysid_signal::Recording;

use crate::atomic::{replace, write_bytes};
use crate::error::WriteError;

/// The shortest text that reads back as the same `f64`; with an exponent where the plain form would be long; `NaN` for a missing sample.
pub fn format_number(x: f64) -> String {
    if x == 0.0 || (1e-5..1e16).contains(&x.abs()) { format!("{x}") } else { format!("{x:e}") }
}

/// Writes columns of equal length under their names.
///
/// # Errors
/// Columns of unequal length or a name that needs quoting (a comma, a quote, a line end); a path that cannot be written.
pub fn write_csv(path: &Path, columns: &[(&str, &[f64])]) -> Result<(), WriteError> {
    let refuse =
        |what: String| WriteError { file: path.to_path_buf(), source: Error::new(ErrorKind::InvalidInput, what) };
    let rows = columns.first().map_or(0, |c| c.1.len());
    for (name, samples) in columns {
        if samples.len() != rows {
            return Err(refuse(format!("column `{name}` has {} rows, the first column {rows}", samples.len())));
        }
        if name.contains([',', '"', '\n', '\r']) {
            return Err(refuse(format!("the column name `{name}` holds a comma, a quote or a line end")));
        }
    }
    replace(path, |w| {
        let header: Vec<&str> = columns.iter().map(|c| c.0).collect();
        writeln!(w, "{}", header.join(","))?;
        let mut line = String::new();
        for n in 0..rows {
            line.clear();
            for (i, (_, samples)) in columns.iter().enumerate() {
                if i > 0 {
                    line.push(',');
                }
                line.push_str(&format_number(samples[n]));
            }
            line.push('\n');
            w.write_all(line.as_bytes())?;
        }
        Ok(())
    })
}

/// Writes a recording with a time column `t_s` first.
///
/// # Errors
/// As [`write_csv`].
pub fn write_recording(path: &Path, recording: &Recording) -> Result<(), WriteError> {
    let clock = recording.clock();
    // The decimal that a person would write: the sum of start and n periods, without the last two digits of the rounding.
    let tidy = |t: f64| format!("{t:.13e}").parse::<f64>().unwrap_or(t);
    let time: Vec<f64> = (0..recording.len()).map(|n| tidy(clock.time(n))).collect();
    let mut columns: Vec<(&str, &[f64])> = vec![("t_s", &time)];
    columns.extend(recording.channels().iter().map(|c| (c.name.as_str(), c.samples.as_slice())));
    write_csv(path, &columns)
}

/// Writes text (a page, a program, an equation) to `path`, then renames it into place.
///
/// # Errors
/// A path that cannot be written.
pub fn write_text(path: &Path, text: &str) -> Result<(), WriteError> {
    write_bytes(path, text.as_bytes())
}
