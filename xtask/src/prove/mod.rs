//! `cargo xtask prove`: lets the finished `hysid` binary diagnose recordings in which an effect is concealed, and scores it.

use std::path::PathBuf;
use std::time::Instant;

use hysid_concealed::bank;
use hysid_concealed::seed::Stream;

/// Prove the diagnosis on data where the effect is concealed
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Seed of the bank
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Number of cases
    #[arg(long, default_value_t = 200)]
    cases: usize,
    /// Draw from the development stream, which may be tuned on
    #[arg(long)]
    development: bool,
    /// Only write the bank below this directory: cases/, and labels.json beside it
    #[arg(long, value_name = "DIR")]
    write: Option<PathBuf>,
}

/// Runs the task.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let stream = if args.development { Stream::Development } else { Stream::Reporting };
    let start = Instant::now();
    let cases = bank::cases(stream, args.seed, 0..args.cases);
    println!("{} cases made in {:.1} s", cases.len(), start.elapsed().as_secs_f64());
    if let Some(root) = &args.write {
        bank::write(root, &cases)?;
        println!("written below {}", root.display());
    }
    Ok(())
}
