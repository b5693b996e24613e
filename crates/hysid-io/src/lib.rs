//! Files: recordings as CSV with errors that name file, line and column; versioned model files; write, then rename.
//!
//! * [`read_recording`] turns a CSV file into a [`hysid_signal::Recording`]; [`CsvChunks`] reads one that does not fit into memory by blocks of rows,
//!   [`CsvStream`] on threads and as fast as it can.
//! * [`require`] judges a recording against what a caller needs of it: a column that exists, that varies, that is long enough.
//! * [`write_csv`], [`write_text`] and [`write_json`] put a file in place by a rename, so that no reader sees half of it; a pipe or device is written
//!   to as it is.
//! * [`read_versioned`] and [`write_versioned`] keep a `format_version` in every model file.
//! * [`read_npy`] reads arrays that NumPy saved.
//!
//! Nothing here prints. In-memory types are not file formats: a crate that saves something converts it to a struct of its own.

mod atomic;
mod chunks;
mod clock;
mod clock_watch;
mod error;
mod json;
mod json_place;
mod npy;
mod number;
mod read;
pub mod require;
mod rows;
mod stream;
mod text;
mod write;

pub use atomic::{check_writable, write_bytes};
pub use chunks::CsvChunks;
pub use clock::{ClockFit, fit_clock};
pub use clock_watch::ClockWatch;
pub use error::{InputError, InputProblem, WriteError};
pub use json::{read_json, read_text, read_versioned, write_json, write_versioned};
pub use npy::{Npy, NpyError, read_npy};
pub use number::LARGEST_VALUE;
pub use read::{ReadOptions, TimeSource, read_recording};
pub use rows::Chunk;
pub use stream::CsvStream;
pub use write::{format_number, write_csv, write_recording, write_text};
