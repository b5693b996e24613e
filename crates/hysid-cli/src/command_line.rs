//! The command line, read by clap, and what is wrong with it told in one line.

use std::ffi::OsString;

use clap::builder::StyledStr;
use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Arg, Command, CommandFactory, Error, FromArgMatches};

use crate::failure::Failure;

/// What the parsers of the standard library say of a text that is no number of their kind, and what a user is to do.
const PLAINLY: [(&str, &str); 5] = [
    ("invalid digit found in string", "a whole number of 0 or more is needed"),
    ("cannot parse integer from empty string", "a whole number of 0 or more is needed"),
    ("number too large to fit in target type", "the number is too large"),
    ("invalid float literal", "a number is needed"),
    ("cannot parse float from empty string", "a number is needed"),
];

/// Reads a command line, the program's name first. Help and version are printed here, and end the program.
///
/// # Errors
/// The first thing wrong with it.
pub fn parse<T: CommandFactory + FromArgMatches>(line: impl IntoIterator<Item = OsString>) -> Result<T, Failure> {
    let mut program = lenient(T::command());
    let matches = program.try_get_matches_from_mut(line).and_then(|m| T::from_arg_matches(&m));
    matches.map_err(|error| match error.kind() {
        ErrorKind::DisplayHelp | ErrorKind::DisplayVersion | ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => {
            error.exit()
        }
        _ => Failure::BadInput(told(&error)),
    })
}

/// The program with options that take a number below zero for one: what is wrong with it is then said of the number.
fn lenient(program: Command) -> Command {
    let option = |arg: Arg| {
        let takes = arg.get_long().is_some() && arg.get_action().takes_values();
        arg.allow_negative_numbers(takes)
    };
    program.mut_subcommands(|command| command.mut_args(option))
}

/// Clap's error in one line: what is wrong, what was meant perhaps, and where the options are listed.
fn told(error: &Error) -> String {
    let text = error.to_string();
    // What is wrong comes first; a blank line ends it.
    let what: Vec<&str> = text.lines().take_while(|line| !line.trim().is_empty()).map(str::trim).collect();
    let mut what = what.join(" ").trim_start_matches("error: ").to_owned();
    for (said, plain) in PLAINLY {
        what = what.replace(said, plain);
    }
    let tip = match error.get(ContextKind::SuggestedArg).or_else(|| error.get(ContextKind::SuggestedSubcommand)) {
        Some(ContextValue::String(near)) => format!("; is `{near}` meant?"),
        Some(ContextValue::Strings(near)) => near.first().map(|n| format!("; is `{n}` meant?")).unwrap_or_default(),
        _ => String::new(),
    };
    let help = match error.get(ContextKind::Usage) {
        Some(ContextValue::StyledStr(usage)) => format!("; see `{} --help`", program_of(usage)),
        _ => String::new(),
    };
    format!("{what}{tip}{help}")
}

/// `hysid fit`, of a usage line such as `Usage: hysid fit [OPTIONS] --out <DIR>`.
fn program_of(usage: &StyledStr) -> String {
    let usage = usage.to_string();
    let words = usage.split_whitespace().skip_while(|w| *w == "Usage:").skip(1);
    let names = words.take_while(|w| w.starts_with(|c: char| c.is_ascii_lowercase()));
    std::iter::once("hysid").chain(names).collect::<Vec<_>>().join(" ")
}
