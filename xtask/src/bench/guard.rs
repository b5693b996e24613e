//! Instruction counts of four kernels under callgrind, against stored numbers: times on a shared machine prove nothing.
//!
//! Valgrind has no AVX-512, so the AVX2 form of the kernels is counted. What making the inputs takes is subtracted.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Context;
use xshell::{Shell, cmd};

/// A kernel may take this much more than stored.
const ALLOWED: f64 = 1.10;
const KERNELS: [&str; 4] = ["gram", "press", "search", "free-run"];

/// Counts, and compares or stores.
pub fn run(shell: &Shell, root: &Path, store: bool) -> anyhow::Result<()> {
    cmd!(shell, "valgrind --version").quiet().ignore_stdout().run().context("valgrind is needed for the guard")?;
    cmd!(shell, "cargo build --release --quiet -p hysid-bench").run()?;
    let nothing = count(shell, root, "nothing")?;
    let mut counts = BTreeMap::new();
    for kernel in KERNELS {
        counts.insert(kernel.to_string(), count(shell, root, kernel)?.saturating_sub(nothing));
    }
    let path = root.join("xtask/src/bench/instructions.toml");
    if store {
        let head =
            "# Instructions of each kernel (callgrind, AVX2 form), written by `cargo xtask bench --guard --store`.\n";
        std::fs::write(&path, format!("{head}{}", toml::to_string(&counts)?))?;
        return Ok(());
    }
    let stored: BTreeMap<String, u64> = toml::from_str(&std::fs::read_to_string(&path)?)?;
    let mut over = Vec::new();
    for (kernel, &now) in &counts {
        let before = stored.get(kernel).copied().with_context(|| format!("no stored count for {kernel}"))?;
        let ratio = now as f64 / before as f64;
        println!("{kernel}: {now} instructions, {before} stored, ratio {ratio:.3}");
        if ratio > ALLOWED {
            over.push(kernel.as_str());
        }
    }
    anyhow::ensure!(over.is_empty(), "more than 10 % above the stored count: {}", over.join(", "));
    Ok(())
}

fn count(shell: &Shell, root: &Path, kernel: &str) -> anyhow::Result<u64> {
    let (program, out) = (root.join("target/release/kernels"), root.join("target/callgrind.out"));
    let file = format!("--callgrind-out-file={}", out.display());
    cmd!(shell, "valgrind --quiet --tool=callgrind {file} {program} {kernel}").quiet().ignore_stderr().run()?;
    let text = std::fs::read_to_string(&out)?;
    let line = text.lines().find_map(|l| l.strip_prefix("totals:").or_else(|| l.strip_prefix("summary:")));
    line.and_then(|l| l.split_whitespace().next()?.parse().ok()).context("callgrind wrote no total")
}
