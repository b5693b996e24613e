//! Instruction counts of four kernels under callgrind, against stored numbers: times on a shared machine prove nothing.
//!
//! The counts must not depend on the processor: valgrind shows a program the same one on every host that has AVX2 (a Haswell, and
//! never AVX-512), so that dispatch at run time always takes the AVX2 form; on a host without it the guard is skipped, and
//! likewise where there is no valgrind. What making the inputs takes is subtracted. Counts vary by some tenths of a percent
//! from run to run, since the standard library seeds its hash tables anew.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Context;
use xshell::{Shell, cmd};

/// A kernel may take this much more than stored.
const ALLOWED: f64 = 1.10;
const KERNELS: [&str; 4] = ["gram", "press", "search", "free-run"];

/// Counts, and compares or stores.
pub fn run(shell: &Shell, root: &Path, store: bool) -> anyhow::Result<()> {
    let skipped = if cmd!(shell, "valgrind --version").quiet().ignore_stdout().ignore_stderr().run().is_err() {
        Some("there is no valgrind here")
    } else if !std::fs::read_to_string("/proc/cpuinfo").is_ok_and(|text| has_avx2(&text)) {
        Some("this processor has no AVX2 with FMA, for which the counts are stored")
    } else {
        None
    };
    if let Some(reason) = skipped {
        anyhow::ensure!(!store, "nothing to store: {reason}");
        println!("skipped: {reason}");
        return Ok(());
    }
    // As `.ci/run` builds them: a build of one package alone has other features and would compile everything anew.
    cmd!(shell, "cargo build --release --quiet --bins --workspace").run()?;
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
    let over = beyond(&counts, &stored)?;
    anyhow::ensure!(over.is_empty(), "more than 10 % above the stored count: {}", over.join(", "));
    Ok(())
}

/// Whether the processors that Linux lists have what the AVX2 form of the kernels needs.
fn has_avx2(cpuinfo: &str) -> bool {
    ["avx2", "fma"].iter().all(|flag| has_flag(cpuinfo, flag))
}

/// Whether the first processor that Linux lists has a feature.
pub fn has_flag(cpuinfo: &str, flag: &str) -> bool {
    let flags = cpuinfo.lines().find_map(|l| l.strip_prefix("flags")).unwrap_or("");
    flags.split_whitespace().any(|w| w == flag)
}

/// Prints the counts beside the stored ones; the kernels that take more than allowed.
fn beyond(counts: &BTreeMap<String, u64>, stored: &BTreeMap<String, u64>) -> anyhow::Result<Vec<String>> {
    let mut over = Vec::new();
    for (kernel, &now) in counts {
        let before = stored.get(kernel).copied().with_context(|| format!("no stored count for {kernel}"))?;
        let ratio = now as f64 / before as f64;
        println!("{kernel}: {now} instructions, {before} stored, ratio {ratio:.3}");
        if ratio > ALLOWED {
            over.push(kernel.clone());
        }
    }
    Ok(over)
}

fn count(shell: &Shell, root: &Path, kernel: &str) -> anyhow::Result<u64> {
    let (program, out) = (root.join("target/release/kernels"), root.join("target/callgrind.out"));
    let file = format!("--callgrind-out-file={}", out.display());
    cmd!(shell, "valgrind --quiet --tool=callgrind {file} {program} {kernel}").quiet().ignore_stderr().run()?;
    let text = std::fs::read_to_string(&out)?;
    let line = text.lines().find_map(|l| l.strip_prefix("totals:").or_else(|| l.strip_prefix("summary:")));
    line.and_then(|l| l.split_whitespace().next()?.parse().ok()).context("callgrind wrote no total")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_kernels_above_the_allowance_are_named() {
        let counts = |pairs: &[(&str, u64)]| pairs.iter().map(|(k, n)| (k.to_string(), *n)).collect::<BTreeMap<_, _>>();
        let stored = counts(&[("a", 1000), ("b", 1000), ("c", 1000)]);
        let now = counts(&[("a", 1099), ("b", 1101), ("c", 500)]);
        assert_eq!(beyond(&now, &stored).unwrap(), ["b"]);
        assert!(beyond(&counts(&[("d", 1)]), &stored).is_err());
    }

    #[test]
    fn the_processor_is_known_by_its_flags() {
        for (text, expected) in [
            ("processor : 0\nflags\t\t: fpu avx avx2 fma bmi2\n", true),
            ("flags\t\t: fpu avx fma fma4\n", false),
            ("flags : avx2 fma4\n", false),
            ("Features : neon\n", false),
            ("", false),
        ] {
            assert_eq!(has_avx2(text), expected, "{text}");
        }
    }
}
