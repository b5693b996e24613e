//! The in-memory recording and what can be said of a signal without a model: excitations, spectra, turning points.
//!
//! A [`Recording`] is a table of named channels on one uniform clock. A missing sample is `NaN`; [`Recording::segments`]
//! gives the stretches without one. There are no files here (see `hysid-io`) and no models.

mod recording;

pub use recording::{Channel, Clock, Recording, RecordingError, Segment};
