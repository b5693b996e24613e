//! The evidence space: everything that could explain a residual, seen as columns in one whitened output space.
//!
//! Rows are samples of all outputs of all recordings, stacked (see [`Layout`]). A residual `e` and the response of an effect to a
//! unit amplitude live in the same space; both are whitened by the noise model ([`Whitener`]) and projected off what
//! the simulation's own parameters and initial states can do ([`Projector`]). What is left of the residual is judged against what is
//! left of each effect ([`score`]), and the largest score against surrogates of the residual ([`surrogate_test`]).
//!
//! Nothing here knows a mechanism or a simulation: the algebra is tested on synthetic linear plants.
//!
//! Reference: efficient score tests (Neyman C(alpha)); circular-shift surrogates for dependent data.

mod below;
mod blocks;
mod common;
mod constancy;
mod driven;
mod layout;
mod noise;
mod projector;
mod quantile;
mod response;
mod score;
mod shape;
mod shared;
mod surrogate;

pub use blocks::{better_by_chance, difference};
pub use constancy::{Wander, lines};
pub use layout::{Layout, Series, Whitener};
pub use noise::NoiseModel;
pub use projector::{Projector, doubly, norm2};
pub use quantile::quantile;
pub use response::{CommonPath, Course, ForcePath, ForcePaths, between};
pub use score::{FeatureGroup, INSIDE, detectable_amplitude, score, surprise};
pub use surrogate::{Contender, SurrogateTest, TestOptions, correlation_time, surrogate_test};
