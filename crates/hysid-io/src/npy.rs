//! Arrays of doubles in NumPy's `.npy` files (format 1 to 3, little-endian `f8` and `f4`, one or two dimensions).
//!
//! Reference: NumPy Enhancement Proposal 1, "A simple file format for NumPy arrays".

use std::fs;
use std::path::Path;

/// A table of columns read from a `.npy` file.
#[derive(Debug, Clone, PartialEq)]
pub struct Npy {
    /// The columns; a one-dimensional array is one column.
    pub columns: Vec<Vec<f64>>,
}

/// Why a `.npy` file was not read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NpyError {
    /// The file could not be opened or read.
    #[error("{path}: {source}")]
    Io {
        /// The file.
        path: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// The file's content is not what this reader knows.
    #[error("{path}: {problem}")]
    Content {
        /// The file.
        path: String,
        /// What is wrong, and what is allowed.
        problem: String,
    },
}

/// The columns of a `.npy` file.
///
/// # Errors
/// A file that cannot be read, is no `.npy` file, or holds other than `<f8` or `<f4` in one or two dimensions.
pub fn read_npy(path: &Path) -> Result<Npy, NpyError> {
    let name = path.display().to_string();
    let bytes = fs::read(path).map_err(|source| NpyError::Io { path: name.clone(), source })?;
    parse(&bytes).map_err(|problem| NpyError::Content { path: name, problem })
}

fn parse(bytes: &[u8]) -> Result<Npy, String> {
    let cut = || "the file ends within its header".to_string();
    if bytes.get(..6) != Some(b"\x93NUMPY") {
        return Err("this is not a .npy file (its first bytes are not \\x93NUMPY)".into());
    }
    let (from, length) = match bytes.get(6).ok_or_else(cut)? {
        1 => (10, usize::from(u16::from_le_bytes([*bytes.get(8).ok_or_else(cut)?, *bytes.get(9).ok_or_else(cut)?]))),
        2 | 3 => {
            let size: [u8; 4] = bytes.get(8..12).and_then(|b| b.try_into().ok()).ok_or_else(cut)?;
            (12, u32::from_le_bytes(size) as usize)
        }
        v => return Err(format!("format version {v} is not known; versions 1 to 3 are")),
    };
    let end = from + length;
    let header = std::str::from_utf8(bytes.get(from..end).ok_or_else(cut)?).map_err(|e| e.to_string())?;
    let after = |key: &str| header.split_once(key).map(|(_, rest)| rest.trim_start_matches([':', ' ']));
    let kind = after("'descr'").ok_or("the header has no 'descr'")?;
    let width = match kind {
        k if k.starts_with("'<f8'") => 8,
        k if k.starts_with("'<f4'") => 4,
        k => return Err(format!("values are {}; '<f8' and '<f4' are read", k.split(',').next().unwrap_or("?"))),
    };
    let by_column = after("'fortran_order'").is_some_and(|f| f.starts_with("True"));
    let shape = after("'shape'").and_then(|s| s.strip_prefix('(')).and_then(|s| s.split_once(')')).map(|(s, _)| s);
    let shape: Vec<usize> = shape
        .ok_or("the header has no 'shape'")?
        .split(',')
        .map(str::trim)
        .filter(|s| !s.is_empty())
        .map(|s| s.parse().map_err(|_| format!("`{s}` in the shape is no number")))
        .collect::<Result<_, String>>()?;
    let (rows, cols) = match shape[..] {
        [n] => (n, 1),
        [n, m] => (n, m),
        _ => return Err(format!("an array of {} dimensions; one or two are read", shape.len())),
    };
    let data = &bytes[end..];
    let count = rows.checked_mul(cols).filter(|c| c.checked_mul(width) == Some(data.len()));
    let Some(count) = count else {
        return Err(format!("{rows} x {cols} values of {width} bytes are announced, {} bytes follow", data.len()));
    };
    let value = |i: usize| {
        let at = &data[i * width..(i + 1) * width];
        match *at {
            [a, b, c, d, e, f, g, h] => f64::from_le_bytes([a, b, c, d, e, f, g, h]),
            [a, b, c, d] => f64::from(f32::from_le_bytes([a, b, c, d])),
            _ => f64::NAN,
        }
    };
    debug_assert_eq!(count, rows * cols);
    let column =
        |j: usize| (0..rows).map(|i| value(if by_column { j * rows + i } else { i * cols + j })).collect::<Vec<f64>>();
    Ok(Npy { columns: (0..cols).map(column).collect() })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(header: &str, values: &[f64]) -> Vec<u8> {
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.extend(values.iter().flat_map(|v| v.to_le_bytes()));
        bytes
    }

    #[test]
    fn tables_by_row_and_by_column() {
        let header =
            |order: &str, shape: &str| format!("{{'descr': '<f8', 'fortran_order': {order}, 'shape': {shape}, }}\n");
        let cases = [
            (header("False", "(2, 2)"), vec![vec![1.0, 3.0], vec![2.0, 4.0]]),
            (header("True", "(2, 2)"), vec![vec![1.0, 2.0], vec![3.0, 4.0]]),
            (header("False", "(4,)"), vec![vec![1.0, 2.0, 3.0, 4.0]]),
        ];
        for (header, columns) in cases {
            assert_eq!(parse(&file(&header, &[1.0, 2.0, 3.0, 4.0])).unwrap(), Npy { columns }, "{header}");
        }
    }

    #[test]
    fn other_content_is_refused() {
        let good = "{'descr': '<f8', 'fortran_order': False, 'shape': (2, 2), }";
        let cases = [
            b"u,y\n1,2\n".to_vec(),
            b"\x93NUMPY".to_vec(),
            file(good, &[1.0]),
            file(&good.replace("<f8", "<i8"), &[1.0; 4]),
            file(&good.replace("(2, 2)", "(1, 2, 2)"), &[1.0; 4]),
            file(&good.replace("(2, 2)", "(9999999999999, 9999999999999)"), &[1.0; 4]),
            file("{}", &[]),
        ];
        for (i, bytes) in cases.iter().enumerate() {
            assert!(parse(bytes).is_err(), "case {i}");
        }
    }
}
