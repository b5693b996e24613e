//! `cargo xtask ci`: every task in its quick form, one after the other, as continuous integration runs them before the tests.
//!
//! Each task runs as a process of its own, so that one that fails does not hide the next: all are run, and the status is 1
//! where any failed.

use std::process::Command;
use std::time::Instant;

/// Run every task in its quick form
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Only the tasks whose name contains this
    #[arg(long, default_value = "")]
    only: String,
}

/// The quick form of each task: its name and the arguments.
const TASKS: [&[&str]; 4] = [&["layers"], &["bench", "--guard"], &["reproduce", "--check"], &["prove", "--quick"]];

/// Runs the tasks.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let this = std::env::current_exe()?;
    let mut failed = Vec::new();
    for task in TASKS.into_iter().filter(|t| t[0].contains(&args.only)) {
        let name = task.join(" ");
        println!("== cargo xtask {name}");
        let began = Instant::now();
        let status = Command::new(&this).args(task).current_dir(crate::root()).status()?;
        println!(
            "== {name}: {} in {:.0} s\n",
            if status.success() { "passed" } else { "FAILED" },
            began.elapsed().as_secs_f64()
        );
        if !status.success() {
            failed.push(name);
        }
    }
    anyhow::ensure!(failed.is_empty(), "failed: {}", failed.join(", "));
    Ok(())
}
