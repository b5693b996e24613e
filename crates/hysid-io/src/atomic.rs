//! A file put in place by a rename, so that a reader sees all of it or nothing.

use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::Path;

use crate::error::WriteError;

/// Calls `fill` with a writer for a new file and renames that file to `path` once all of it is on the disk.
pub(crate) fn replace(
    path: &Path,
    fill: impl FnOnce(&mut BufWriter<File>) -> std::io::Result<()>,
) -> Result<(), WriteError> {
    let failed = |source| WriteError { file: path.to_path_buf(), source };
    let name = path
        .file_name()
        .ok_or_else(|| failed(std::io::Error::new(std::io::ErrorKind::InvalidInput, "the path names no file")))?;
    let mut partial = name.to_os_string();
    partial.push(format!(".{}.partial", std::process::id()));
    let partial = path.with_file_name(partial);
    let written = File::create(&partial).and_then(|file| {
        let mut writer = BufWriter::with_capacity(1 << 16, file);
        fill(&mut writer)?;
        writer.into_inner().map_err(std::io::IntoInnerError::into_error)?.sync_all()?;
        fs::rename(&partial, path)
    });
    written.map_err(|source| {
        let _ = fs::remove_file(&partial);
        failed(source)
    })
}

/// Writes these bytes to `path`, by way of a file beside it that is renamed at the end.
///
/// # Errors
/// The folder does not exist or may not be written, the disk is full, the path is a directory.
pub fn write_bytes(path: &Path, bytes: &[u8]) -> Result<(), WriteError> {
    replace(path, |w| w.write_all(bytes))
}
