//! Simulations against closed forms, other integrators and recordings.

mod bad_files;
mod calibrate;
mod closed_loop;
mod common;
mod document;
mod many_runs;
mod recordings;
mod sensitivities;
mod short_lag;
mod simulate;
mod stick_slip;
