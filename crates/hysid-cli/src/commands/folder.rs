//! The folder of the results: claimed before the work begins, left as it was where the work fails.
//!
//! A diagnosis can take a minute: that its folder cannot be written must be known at once. What is claimed is therefore tried out with
//! files, and folders that had to be made for it go again unless results were put in.

use std::path::{Path, PathBuf};

use anyhow::Context;
use serde::Serialize;

use crate::failure::Failure;

/// A folder that results can be written to.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    /// Folders that were made for it, outermost first.
    made: Vec<PathBuf>,
}

impl Folder {
    /// Makes the folder where it is not there, and tries out whether the files of these names can be written in it.
    ///
    /// # Errors
    /// A path that is there and is not a folder, or one that cannot be made or written.
    pub fn claim(path: &Path, names: &[&str]) -> Result<Self, Failure> {
        let refused = |why: &dyn std::fmt::Display| Failure::BadInput(format!("--out {}: {why}", path.display()));
        if path.as_os_str().is_empty() {
            return Err(refused(&"the name is empty; name a folder"));
        }
        if path.exists() && !path.is_dir() {
            return Err(refused(&"it is there and is not a folder"));
        }
        let mut made: Vec<PathBuf> =
            path.ancestors().take_while(|p| !p.as_os_str().is_empty() && !p.exists()).map(Path::to_path_buf).collect();
        made.reverse();
        // Dropped on the way out of an error, it takes away what was made.
        let folder = Self { path: path.to_path_buf(), made };
        std::fs::create_dir_all(path).map_err(|e| refused(&format!("the folder cannot be made: {e}")))?;
        for name in names {
            hysid_io::check_writable(&path.join(name)).map_err(|e| refused(&e))?;
        }
        Ok(folder)
    }

    /// Puts a text in.
    ///
    /// # Errors
    /// The program's, as the folder could be written a moment ago.
    pub fn text(&self, name: &str, text: &str) -> Result<(), Failure> {
        hysid_io::write_text(&self.path.join(name), text).with_context(|| format!("writing {name}"))?;
        Ok(())
    }

    /// Puts a value in as JSON.
    ///
    /// # Errors
    /// As of [`Folder::text`].
    pub fn json(&self, name: &str, value: &impl Serialize) -> Result<(), Failure> {
        hysid_io::write_json(&self.path.join(name), value).with_context(|| format!("writing {name}"))?;
        Ok(())
    }

    /// Takes out a file of an earlier run, which would contradict what is there now.
    ///
    /// # Errors
    /// The file is there and cannot be removed.
    pub fn without(&self, name: &str) -> Result<(), Failure> {
        match std::fs::remove_file(self.path.join(name)) {
            Err(e) if e.kind() != std::io::ErrorKind::NotFound => {
                Err(Failure::Internal(anyhow::Error::new(e).context(format!("removing the {name} of an earlier run"))))
            }
            _ => Ok(()),
        }
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // A folder that holds something is not removed by this.
        for path in self.made.iter().rev() {
            if std::fs::remove_dir(path).is_err() {
                break;
            }
        }
    }
}
