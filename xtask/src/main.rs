//! Tasks of this repository; `cargo xtask --help` lists them.

mod bench;
mod catalogue;
mod ci;
mod layers;
mod prove;
mod recordings;
mod reproduce;

use std::path::{Path, PathBuf};

use clap::{Parser, Subcommand};

#[derive(Debug, Parser)]
#[command(name = "cargo xtask", about = "Tasks of this repository", max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    task: Task,
}

/// One variant for each module beside this file.
#[derive(Debug, Subcommand)]
enum Task {
    Bench(bench::Args),
    Catalogue(catalogue::Args),
    Ci(ci::Args),
    /// Check the house rules of `xtask/layers.toml`.
    Layers,
    Prove(prove::Args),
    Recordings(recordings::Args),
    Reliability(prove::reliability::Args),
    Reproduce(reproduce::Args),
}

/// The root of the workspace.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().map_or_else(|| PathBuf::from("."), Path::to_path_buf)
}

fn main() -> anyhow::Result<()> {
    match Cli::parse().task {
        Task::Bench(args) => bench::run(&args),
        Task::Catalogue(args) => catalogue::run(&args),
        Task::Ci(args) => ci::run(&args),
        Task::Prove(args) => prove::run(&args),
        Task::Recordings(args) => recordings::run(&args),
        Task::Reliability(args) => prove::reliability::run(&args),
        Task::Reproduce(args) => reproduce::run(&args),
        Task::Layers => {
            let found = layers::breaches(&root())?;
            anyhow::ensure!(found.is_empty(), "{}", found.join("\n"));
            Ok(())
        }
    }
}
