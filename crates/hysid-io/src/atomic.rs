//! A file put in place by a rename, so that a reader sees all of it or nothing.
//!
//! A device or a pipe (`/dev/stdout`) is never replaced: it is written to. A link is followed, so that it stays a link.

use std::fs::{self, File};
use std::io::{BufWriter, Error, ErrorKind, Result, Write};
use std::path::Path;

use crate::error::WriteError;

/// Bytes that are collected before they are written.
const BUFFER: usize = 1 << 16;

/// Calls `fill` with a writer for a new file and renames that file to `path` once all of it is on the disk.
pub(crate) fn replace(
    path: &Path,
    fill: impl FnOnce(&mut BufWriter<File>) -> Result<()>,
) -> std::result::Result<(), WriteError> {
    let written = match fs::metadata(path) {
        Ok(there) if there.is_dir() => Err(is_folder()),
        Ok(there) if !there.is_file() => through(path, fill),
        Ok(_) => fs::canonicalize(path).and_then(|file| put(&file, fill)),
        Err(_) => put(path, fill),
    };
    written.map_err(|source| WriteError { file: path.to_path_buf(), source })
}

/// Whether a file could be put at `path` now, found out by a file beside it that goes again: what takes long is asked this before it begins.
///
/// # Errors
/// The folder does not exist or may not be written, the path is a directory.
pub fn check_writable(path: &Path) -> std::result::Result<(), WriteError> {
    let possible = match fs::metadata(path) {
        Ok(there) if there.is_dir() => Err(is_folder()),
        // A device or a pipe is only opened to be written to.
        Ok(there) if !there.is_file() => Ok(()),
        Ok(_) => fs::canonicalize(path).and_then(|file| beside(&file, |_| Ok(()))),
        Err(_) => beside(path, |_| Ok(())),
    };
    possible.map_err(|source| WriteError { file: path.to_path_buf(), source })
}

fn is_folder() -> Error {
    Error::new(ErrorKind::IsADirectory, "it is a folder; name a file")
}

/// Writes into what is there.
fn through(path: &Path, fill: impl FnOnce(&mut BufWriter<File>) -> Result<()>) -> Result<()> {
    let mut writer = BufWriter::with_capacity(BUFFER, File::options().write(true).open(path)?);
    fill(&mut writer)?;
    writer.flush()
}

/// Writes a file beside `path` and renames it.
fn put(path: &Path, fill: impl FnOnce(&mut BufWriter<File>) -> Result<()>) -> Result<()> {
    beside(path, |partial| {
        let mut writer = BufWriter::with_capacity(BUFFER, File::options().write(true).open(partial)?);
        fill(&mut writer)?;
        writer.into_inner().map_err(std::io::IntoInnerError::into_error)?.sync_all()?;
        fs::rename(partial, path)
    })
}

/// Makes an empty file beside `path` for `work`; it is gone at the end unless it was renamed.
fn beside(path: &Path, work: impl FnOnce(&Path) -> Result<()>) -> Result<()> {
    let name = path.file_name().ok_or_else(|| Error::new(ErrorKind::InvalidInput, "the path names no file"))?;
    let mut partial = name.to_os_string();
    partial.push(format!(".{}.partial", std::process::id()));
    let partial = path.with_file_name(partial);
    let done = File::create(&partial).and_then(|_| work(&partial));
    let _ = fs::remove_file(&partial);
    done
}

/// Writes these bytes to `path`, by way of a file beside it that is renamed at the end.
///
/// # Errors
/// The folder does not exist or may not be written, the disk is full, the path is a directory.
pub fn write_bytes(path: &Path, bytes: &[u8]) -> std::result::Result<(), WriteError> {
    replace(path, |w| w.write_all(bytes))
}
