//! Models: estimated, run freely, written and read.

mod common;
mod estimation;
mod export;
mod model;
