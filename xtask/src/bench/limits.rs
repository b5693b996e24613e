//! What the machine can do at most, measured: the rates that the rows of `docs/performance.md` are held against.

use std::path::Path;

use anyhow::Context;
use serde_json::Value;
use xshell::{Shell, cmd};

use super::guard::has_flag;
use super::process::before_all_others;

/// The rates, each with its unit, under the key by which `timed limits` prints them.
const RATES: [(&str, &str); 3] = [
    ("gflops", "fused multiply-adds from registers, GFLOP/s (two for each)"),
    ("product_gflops", "the matrix product of a selection on a tile in the first-level cache, GFLOP/s"),
    ("gigabytes", "a = b + s c over vectors of 256 MB, GB/s (24 bytes for each entry)"),
];

/// Measures with one thread and with two, in turns, and returns the block of the page.
pub fn run(shell: &Shell, root: &Path, rounds: usize) -> anyhow::Result<String> {
    let program = root.join("target/release/timed");
    let mut best = [[0.0_f64; RATES.len()]; 2];
    for _ in 0..rounds {
        for (threads, best) in (1..).zip(&mut best) {
            let threads = threads.to_string();
            let said: Value = serde_json::from_str(&cmd!(shell, "{program} limits {threads} 5").quiet().read()?)?;
            for ((key, _), best) in RATES.iter().zip(best) {
                *best = best.max(said[*key].as_f64().with_context(|| format!("`timed limits` did not say {key}"))?);
            }
        }
    }
    let mut block = format!("\n{} with {} cores:\n\n", processor()?, std::thread::available_parallelism()?);
    block += "| limit | one thread | two threads | two over one |\n|---|---|---|---|\n";
    for (i, (_, name)) in RATES.iter().enumerate() {
        let [one, two] = best.map(|b| b[i]);
        block += &format!("| {name} | {one:.1} | {two:.1} | {:.2} |\n", two / one);
    }
    Ok(format!(
        "{block}\nBest of {rounds} times five, in turns, each thread on numbers of its own; `{}cargo xtask bench --limits --rounds {rounds}`.\n",
        before_all_others()
    ))
}

/// What the processor calls itself, and the widest arithmetic that it has.
fn processor() -> anyhow::Result<String> {
    let text = std::fs::read_to_string("/proc/cpuinfo")?;
    let field = |key: &str| text.lines().find(|l| l.starts_with(key)).and_then(|l| l.split_once(": ")).map(|(_, v)| v);
    let has = |flag: &str| has_flag(&text, flag);
    let width = if has("avx512f") {
        "AVX-512"
    } else if has("avx2") {
        "AVX2"
    } else {
        "baseline"
    };
    Ok(format!("{}, {width},", field("model name").unwrap_or("A processor")))
}
