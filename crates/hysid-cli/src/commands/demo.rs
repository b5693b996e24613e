//! `hysid demo`: identifies a shipped recording and diagnoses a shipped simulation, with the very commands that a user types.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use hysid_io::write_text;

use crate::failure::Failure;

/// Identify a shipped recording and diagnose a shipped simulation; prints the commands and names the reports
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The folder for the recordings and the reports.
    #[arg(long, value_name = "DIR", default_value = "hysid-demo")]
    out: PathBuf,
}

/// A piezo actuator with hysteresis; `fixtures/README.md` has the command that made it.
const PIEZO: &str = include_str!("../../../../fixtures/piezo_boucwen.csv");
/// A simulation of an oscillator, and recordings of one whose spring is not what the simulation says; also in `fixtures/README.md`.
const OSCILLATOR: [(&str, &str); 3] = [
    ("oscillator.sim.toml", include_str!("../../../../fixtures/oscillator/baseline.sim.toml")),
    ("oscillator_est.csv", include_str!("../../../../fixtures/oscillator/est.csv")),
    ("oscillator_val.csv", include_str!("../../../../fixtures/oscillator/val.csv")),
];
/// Rows that the model is made from; the rest is the hold-out.
const ESTIMATION_ROWS: usize = 4000;

/// Writes the shipped files, then runs `hysid` on them.
pub fn run(args: &Args) -> Result<(), Failure> {
    let out = &args.out;
    if out.exists() && !out.is_dir() {
        return Err(Failure::BadInput(format!("{}: it is there and is not a folder", out.display())));
    }
    std::fs::create_dir_all(out).map_err(|e| Failure::BadInput(format!("{}: {e}", out.display())))?;
    let (est, val) = split(PIEZO, ESTIMATION_ROWS);
    let file = |name: &str, text: &str| -> Result<PathBuf, Failure> {
        let path = out.join(name);
        write_text(&path, text).map_err(Failure::bad_input)?;
        Ok(path)
    };
    let (est, val) = (file("piezo_est.csv", &est)?, file("piezo_val.csv", &val)?);
    let mut shipped = Vec::new();
    for (name, text) in OSCILLATOR {
        shipped.push(file(name, text)?);
    }
    let (fit, diagnosis) = (out.join("fit"), out.join("diagnosis"));
    println!("1. A piezo actuator with hysteresis: a model from its recording.\n");
    let line = ["fit", "--recording", &text(&est), "--input", "u_V", "--output", "y_um", "--holdout", &text(&val)];
    hysid(&line, &fit)?;
    println!("\n2. An oscillator that does not move as its simulation says: what is missing?\n");
    let line = ["diagnose", &text(&shipped[0]), "--recording", &text(&shipped[1]), "--holdout", &text(&shipped[2])];
    hysid(&line, &diagnosis)?;
    println!("\nOpen these in a browser:\n  {}", fit.join("report.html").display());
    println!("  {}", diagnosis.join("report.html").display());
    Ok(())
}

fn text(path: &Path) -> String {
    path.display().to_string()
}

/// Prints and runs one command line that writes into `out`.
fn hysid(arguments: &[&str], out: &Path) -> Result<(), Failure> {
    let line: Vec<String> = std::iter::once("hysid")
        .chain(arguments.iter().copied())
        .chain(["--out"])
        .map(String::from)
        .chain([text(out)])
        .collect();
    println!("$ {}\n", line.join(" "));
    crate::run(line.into_iter().map(OsString::from))
}

/// The first `rows` rows of a recording and the rest, each under the header line.
fn split(text: &str, rows: usize) -> (String, String) {
    let (header, body) = text.split_once('\n').unwrap_or((text, ""));
    let cut = body.match_indices('\n').nth(rows - 1).map_or(body.len(), |(i, _)| i + 1);
    (format!("{header}\n{}", &body[..cut]), format!("{header}\n{}", &body[cut..]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_parts_have_the_header_and_no_row_is_lost() {
        let (a, b) = split("t,y\n1,2\n3,4\n5,6\n", 2);
        assert_eq!((a.as_str(), b.as_str()), ("t,y\n1,2\n3,4\n", "t,y\n5,6\n"));
        let (a, b) = split(PIEZO, ESTIMATION_ROWS);
        assert_eq!(a.lines().count(), ESTIMATION_ROWS + 1);
        assert_eq!(a.lines().count() + b.lines().count(), PIEZO.lines().count() + 1);
    }
}
