//! `cargo xtask bench`: our side of the comparison with other tools, the other tools themselves, and the instruction counts.
//!
//! All contenders of a case get the same data file and print one JSON object; each repetition is timed by the program itself,
//! from arrays in memory. They take turns, round after round, and ratios are taken round by round: on a machine that
//! others use, that and CPU time are what can be trusted.

mod case;
mod diagnosis;
mod guard;
mod limits;
mod measure;
mod page;
mod process;
mod selection;
mod simulation;
mod slopes;
mod stream;

use std::path::PathBuf;

use anyhow::Context;
use xshell::{Shell, cmd};

/// Time selection, operators, simulation and diagnosis; with `--peers` the other tools too; renews `docs/performance.md`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Run the other tools too (Python with their packages, installed into `target/peers`).
    #[arg(long)]
    peers: bool,
    /// The other tools' scripts for term selection.
    #[arg(long, default_value = "../shared/bench/peers")]
    scripts: PathBuf,
    /// Only these cases; the others keep their tables.
    #[arg(long, value_delimiter = ',')]
    cases: Vec<String>,
    /// Rounds in which all take their turn.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u16).range(1..=1000))]
    rounds: u16,
    /// Only print the tables; `docs/performance.md` is left alone.
    #[arg(long)]
    dry: bool,
    /// Cost against the sizes of a selection instead: figures in `docs/figures` and slopes.
    #[arg(long, conflicts_with_all = ["peers", "cases", "guard"])]
    plots: bool,
    /// What the machine can do at most, one thread and two: multiply-adds and memory traffic.
    #[arg(long, conflicts_with_all = ["peers", "cases", "guard", "plots"])]
    limits: bool,
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
    let known: Vec<case::Case> =
        [selection::cases(), simulation::cases(), diagnosis::cases()].into_iter().flatten().collect();
    let alone = args.cases == ["stream"];
    if let Some(odd) = args.cases.iter().find(|c| !alone && known.iter().all(|k| k.name != **c)) {
        let names: Vec<&str> = known.iter().map(|k| k.name).collect();
        anyhow::bail!("there is no case `{odd}`; there are {}, and `stream` alone", names.join(", "));
    }
    // The whole workspace: a build of some packages alone has other features and would compile everything anew.
    cmd!(shell, "cargo build --release --quiet --bins --workspace").run()?;
    if alone {
        return stream::run(&shell, &root);
    }
    if args.criterion {
        cmd!(shell, "cargo bench --quiet -p hysid-bench").run()?;
    }
    let rounds = usize::from(args.rounds);
    let path = root.join("docs/performance.md");
    let renew = |name: &str, block: &str| -> anyhow::Result<()> {
        println!("{block}");
        if !args.dry {
            let page = std::fs::read_to_string(&path)?;
            std::fs::write(&path, page::renew(&page, name, block))?;
        }
        Ok(())
    };
    if args.limits {
        return renew("limits", &limits::run(&shell, &root, rounds)?);
    }
    if args.plots {
        return renew("slopes", &slopes::run(&shell, &root, rounds)?);
    }
    let scripts = root.join(&args.scripts);
    let python = if args.peers { Some(measure::python(&shell, &root, &scripts)?) } else { None };
    let place = measure::Place { shell: &shell, root: &root, python, scripts: &scripts };
    for case in known.iter().filter(|c| args.cases.is_empty() || args.cases.iter().any(|n| n == c.name)) {
        let outcomes = place.run(case, rounds).with_context(|| case.name.to_string())?;
        let peers = if args.peers { " --peers" } else { "" };
        let command =
            format!("{}cargo xtask bench{peers} --cases {} --rounds {rounds}", process::before_all_others(), case.name);
        renew(case.name, &page::block(case, &outcomes, &command))?;
    }
    Ok(())
}
