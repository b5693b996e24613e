//! The in-memory recording and what can be said of a signal without a model: excitations, spectra, the colour of a noise, turning
//! points.
//!
//! A [`Recording`] is a table of named channels on one uniform clock. A missing sample is `NaN`; [`Recording::segments`]
//! gives the stretches without one. There are no files here (see `hysid-io`) and no models.

mod autoregression;
mod cosine;
mod excitation;
mod median;
mod mix;
mod noise;
mod overlap;
mod range;
mod recording;
mod spectrum;
pub mod tell;
mod turning_points;

pub use autoregression::Autoregression;
pub use cosine::{cosine_transform, inverse_cosine_transform};
pub use excitation::{Excitation, ExcitationError, modulate};
pub use median::median;
pub use mix::mixed;
pub use noise::{NoiseError, autoregressive_noise, variance_for_snr, white_noise};
pub use overlap::{rows_in_both, rows_seen};
pub use range::range;
pub use recording::{Channel, Clock, Recording, RecordingError, Segment};
pub use spectrum::{
    CrossSpectrum, SpectrumError, correlation, cross_spectrum, fourier, inverse_fourier, power_spectrum,
};
pub use turning_points::{Turn, TurningPoint, turning_points};
