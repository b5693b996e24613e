//! One file for each command: its arguments (`Args`), and `run`, which returns what went wrong as a [`crate::failure::Failure`].

pub mod bench;
mod channel_facts;
pub mod decimate;
pub mod demo;
pub mod diagnose;
mod files;
pub mod fit;
mod folder;
pub mod generate;
pub mod inspect;
pub mod predict;
pub mod select;
pub mod simulate;
mod simulation_file;
mod threads;
