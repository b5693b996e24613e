//! The command line as a user meets it: files in, files out, one message for bad input.

mod bad_diagnosis;
mod bad_input;
mod column_mode;
mod common;
mod diagnosis_file;
mod files;
mod fit;
mod fuzz_diagnosis;
mod generate;
mod recordings;
mod select;
mod simulate;
