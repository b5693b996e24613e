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

#[cfg(test)]
mod tests {
    use std::fmt::Write;

    use super::*;

    /// The arguments of a command as a table in Markdown, from what `--help` says of them.
    fn table(command: &Command) -> String {
        let mut text = String::from("| option | meaning | |\n|---|---|---|\n");
        for arg in command.get_arguments().filter(|a| !a.is_hide_set() && a.get_id() != "help") {
            let values = arg.get_value_names().unwrap_or_default().join(" ");
            let name = match arg.get_long() {
                Some(long) if arg.get_action().takes_values() => format!("--{long} {values}"),
                Some(long) => format!("--{long}"),
                None => values,
            };
            let help = arg.get_help().map(ToString::to_string).unwrap_or_default();
            let possible: Vec<String> = arg.get_possible_values().iter().map(|v| v.get_name().to_owned()).collect();
            let choices = match possible.as_slice() {
                [first, .., last] if first != "true" || last != "false" => format!(": {}", possible.join(", ")),
                _ => String::new(),
            };
            let default: Vec<_> = arg.get_default_values().iter().map(|v| v.to_string_lossy()).collect();
            let given = match (arg.is_required_set(), arg.get_action().takes_values(), default.as_slice()) {
                (true, ..) => "required".to_owned(),
                (_, true, [_, ..]) => format!("default {}", default.join(" ")),
                _ => String::new(),
            };
            // A bar would end the cell.
            let cell = |text: &str| text.replace('|', "\\|");
            let meaning = format!("{}{choices}", help.trim_end_matches('.'));
            writeln!(text, "| `{}` | {} | {given} |", cell(&name), cell(&meaning)).unwrap();
        }
        text
    }

    #[test]
    fn the_page_of_the_commands_lists_every_option_as_help_does() {
        let page = include_str!("../../../docs/commands.md");
        let mut program = crate::Cli::command();
        program.build();
        let (mut commands, mut wrong) = (0, String::new());
        for command in program.get_subcommands().filter(|c| !c.is_hide_set() && c.get_name() != "help") {
            let heading = format!("\n## `hysid {}`\n", command.get_name());
            let section = page.split(&heading).nth(1).unwrap_or_default();
            let section = section.split("\n## ").next().unwrap_or_default();
            let table = table(command);
            if !section.contains(&table) {
                wrong += &format!("{heading}\n{table}");
            }
            commands += 1;
        }
        assert!(wrong.is_empty(), "docs/commands.md must hold:\n{wrong}");
        assert_eq!(
            page.matches("\n## `hysid ").count(),
            commands,
            "docs/commands.md holds a command that there is not"
        );
    }
}
