//! `cargo xtask bench`: our side of the comparison with other tools, the other tools themselves, and the instruction counts.
//!
//! Every command gets the same data file and prints one JSON object; each repetition is timed by the command itself, from
//! arrays in memory. Ratios are of CPU seconds at one thread, medians with the smallest and largest: on a machine that others use,
//! wall time says little.

mod cases;
mod guard;
mod page;
mod stream;

use std::path::PathBuf;

use anyhow::Context;
use xshell::{Shell, cmd};

/// Time term selection; with `--peers` the other tools too; writes `docs/performance.md`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Run the other tools too (Python with their packages, installed into `target/peers`).
    #[arg(long)]
    peers: bool,
    /// The other tools' scripts.
    #[arg(long, default_value = "../shared/bench/peers")]
    scripts: PathBuf,
    /// Only these cases.
    #[arg(long, value_delimiter = ',')]
    cases: Vec<String>,
    /// Count instructions of four kernels (valgrind) and fail on more than 10 % above the stored numbers.
    #[arg(long)]
    guard: bool,
    /// Store the instruction counts instead of comparing.
    #[arg(long, requires = "guard")]
    store: bool,
    /// Run the criterion benchmarks too.
    #[arg(long)]
    criterion: bool,
}

/// Runs the task.
///
/// # Errors
/// A build or a command that fails; with `--guard`, a kernel that takes more instructions than allowed.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let shell = Shell::new()?;
    let root = crate::root();
    shell.change_dir(&root);
    if args.guard {
        return guard::run(&shell, &root, args.store);
    }
    cmd!(shell, "cargo build --release --quiet -p hysid-cli -p hysid-bench").run()?;
    if args.cases == ["stream"] {
        return stream::run(&shell, &root);
    }
    if args.criterion {
        cmd!(shell, "cargo bench --quiet -p hysid-bench").run()?;
    }
    let known = cases::all();
    if let Some(odd) = args.cases.iter().find(|c| known.iter().all(|k| k.name != **c)) {
        let names: Vec<&str> = known.iter().map(|k| k.name).collect();
        anyhow::bail!("there is no case `{odd}`; there are {}", names.join(", "));
    }
    let python = if args.peers { Some(cases::python(&shell, &root, &args.scripts)?) } else { None };
    let mut results = Vec::new();
    for case in known.iter().filter(|c| args.cases.is_empty() || args.cases.iter().any(|n| n == c.name)) {
        let data = cases::data(&shell, &root, case)?;
        for threads in [1, 2] {
            let ours = cases::ours(&shell, &root, case, &data, threads).with_context(|| case.name.to_string())?;
            eprintln!("{}: {} with {threads} threads, CPU {:.3e} s", case.name, ours.tool, ours.cpu.middle);
            results.push(ours);
        }
        for peer in case.peers.iter().filter(|_| python.is_some()) {
            let Some(python) = &python else { continue };
            let result = cases::peer(&shell, python, &args.scripts, case, peer, &data);
            match result {
                Ok(r) => {
                    eprintln!("{}: {} CPU {:.3e} s", case.name, r.tool, r.cpu.middle);
                    results.push(r);
                }
                Err(e) => eprintln!("{}: {peer} failed: {e:#}", case.name),
            }
        }
    }
    let path = root.join("docs/performance.md");
    std::fs::write(&path, page::write(&path, &known, &results, args.peers)?)?;
    eprintln!("wrote {}", path.display());
    Ok(())
}
