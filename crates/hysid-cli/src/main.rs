//! The command line `hysid`: data on stdout, messages on stderr.
//!
//! Exit status 0 on success whatever the verdict, 2 for bad input (one message that names what is wrong), 1 for a failure
//! of the program itself.

mod command_line;
mod commands;
mod failure;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use failure::Failure;

#[derive(Debug, Parser)]
#[command(name = "hysid", version, about = "Identify and diagnose systems with hysteresis", max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

/// One variant for each file in `commands/`.
#[derive(Debug, Subcommand)]
enum Command {
    #[command(hide = true)]
    Bench(commands::bench::Args),
    Decimate(commands::decimate::Args),
    Demo(commands::demo::Args),
    Fit(Box<commands::fit::Args>),
    Diagnose(commands::diagnose::Args),
    Inspect(commands::inspect::Args),
    Predict(commands::predict::Args),
    Select(commands::select::Args),
    Simulate(commands::simulate::Args),
    Generate(commands::generate::Args),
}

/// How a page of this run can be made again: the command line as the user typed it.
fn provenance() -> hysid_report::Provenance {
    let quoted = |a: String| if a.contains(char::is_whitespace) { format!("\"{a}\"") } else { a };
    let arguments: Vec<String> =
        std::env::args_os().skip(1).map(|a| quoted(a.to_string_lossy().into_owned())).collect();
    hysid_report::Provenance {
        command: format!("hysid {}", arguments.join(" ")),
        version: env!("CARGO_PKG_VERSION").into(),
    }
}

/// Runs one command line, the program's name first.
fn run(line: impl IntoIterator<Item = OsString>) -> Result<(), Failure> {
    match command_line::parse::<Cli>(line)?.command {
        Command::Bench(args) => commands::bench::run(&args),
        Command::Decimate(args) => commands::decimate::run(&args),
        Command::Demo(args) => commands::demo::run(&args),
        Command::Fit(args) => commands::fit::run(&args),
        Command::Diagnose(args) => commands::diagnose::run(&args),
        Command::Inspect(args) => commands::inspect::run(&args),
        Command::Predict(args) => commands::predict::run(&args),
        Command::Select(args) => commands::select::run(&args),
        Command::Simulate(args) => commands::simulate::run(&args),
        Command::Generate(args) => commands::generate::run(&args),
    }
}

fn main() -> ExitCode {
    match run(std::env::args_os()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => failure.report(),
    }
}
