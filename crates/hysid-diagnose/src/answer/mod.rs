//! What the user is told: the verdict as a file, the series behind it for a report, numbers with their intervals, sentences.

pub(crate) mod bootstrap;
pub(crate) mod draw;
mod locate;
pub mod picture;
pub mod reached;
pub(crate) mod records;
mod region;
mod report_values;
