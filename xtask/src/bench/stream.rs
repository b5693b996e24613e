//! The case `stream`: selection from a CSV file of 2 GB beside reading the same file and doing nothing with it.
//!
//! The file is made in the temporary folder and removed at the end. Each command is timed by itself (its own clock, its own peak of memory); `wc` and
//! `cat` stand for plain reading. All of them find the file in the page cache, as far as it fits.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

use hysid_bench::{Uniform, known_model};
use hysid_dictionary::{Factor, Model, Quantity, Term};
use serde_json::Value;
use xshell::{Shell, cmd};

use super::page::renew;
use super::process::before_all_others;

/// Size of the file.
const BYTES: u64 = 2_000_000_000;
/// Standard deviation of the equation noise.
const NOISE: f64 = 0.01;

/// Runs the case and renews its part of `docs/performance.md`.
pub fn run(shell: &Shell, root: &Path) -> anyhow::Result<()> {
    let file = File(std::env::temp_dir().join("hysid_stream.csv"));
    eprintln!("writing {} ({:.1} GB)", file.0.display(), BYTES as f64 / 1e9);
    let model = known_model();
    write(&file.0, &model)?;
    let text = measure(shell, root, &file.0, &model)?;
    let page = root.join("docs/performance.md");
    let old = std::fs::read_to_string(&page)?;
    std::fs::write(
        &page,
        renew(&old, "stream", &format!("\n{text}\n`{}cargo xtask bench --cases stream`.\n", before_all_others())),
    )?;
    eprintln!("wrote {}", page.display());
    Ok(())
}

/// A file that goes when it is dropped.
struct File(PathBuf);

impl Drop for File {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}

/// A run of the system with a white uniform input and equation noise, written until the file is full.
fn write(file: &Path, model: &Model) -> anyhow::Result<()> {
    let mut out = std::io::BufWriter::with_capacity(1 << 20, std::fs::File::create(file)?);
    let mut uniform = Uniform(0x9e37_79b9_7f4a_7c15);
    // The last samples, newest first; place 0 is the present.
    let (mut u, mut y) = ([0.0; 4], [0.0; 4]);
    let mut line = String::new();
    let mut bytes = out.write(b"u,y\n")? as u64;
    while bytes < BYTES {
        u.rotate_right(1);
        y.rotate_right(1);
        u[0] = uniform.next();
        let past = |f: Factor| {
            if f.quantity == Quantity::Value(hysid_dictionary::Signal::Output) { y[f.lag] } else { u[f.lag] }
        };
        let next: f64 = model.theta().iter().zip(model.terms()).map(|(theta, term)| theta * term.evaluate(past)).sum();
        // Four uniforms of variance 1/3 each.
        y[0] = next + NOISE * (0.75_f64).sqrt() * (0..4).map(|_| uniform.next()).sum::<f64>();
        line.clear();
        writeln!(line, "{},{}", u[0], y[0])?;
        out.write_all(line.as_bytes())?;
        bytes += line.len() as u64;
    }
    out.flush()?;
    Ok(())
}

fn measure(shell: &Shell, root: &Path, file: &Path, model: &Model) -> anyhow::Result<String> {
    let program = root.join("target/release/hysid");
    let mut text = String::from(
        "| work | threads | wall s | MB/s | CPU s | peak MiB | true terms | load |\n|---|---|---|---|---|---|---|---|\n",
    );
    for (name, arguments) in [("`cat` to nowhere", ["cat", "-u"]), ("`wc -l`", ["wc", "-l"])] {
        let began = Instant::now();
        let [program, option] = arguments;
        cmd!(shell, "{program} {option} {file}").quiet().ignore_stdout().run()?;
        let wall = began.elapsed().as_secs_f64();
        writeln!(text, "| {name} | 1 | {wall:.2} | {:.0} | | | | |", BYTES as f64 / 1e6 / wall)?;
    }
    let base = ["--input", "u", "--output", "y", "--json", "--timing"];
    for (name, options) in [
        ("parsing alone", "--read-only"),
        ("select 11 of 84", "--lags-output 3 --lags-input 3 --terms 11 --search greedy"),
        ("select 15 of 286", "--lags-output 5 --lags-input 5 --terms 15 --search greedy"),
        ("size left to the data, of 286", "--lags-output 5 --lags-input 5"),
    ] {
        for threads in ["1", "2"] {
            let options = options.split_whitespace();
            let output = cmd!(shell, "{program} select --recording {file} {base...} --threads {threads} {options...}")
                .quiet()
                .read()?;
            let value: Value = serde_json::from_str(&output)?;
            let number = |key: &str| value[key].as_f64().or_else(|| value[key][0].as_f64()).unwrap_or(f64::NAN);
            let found = value["terms"].as_array().map_or("-".to_string(), |found| {
                let is = |t: &&Term| found.iter().any(|f| f["term"] == model.signals().format(t));
                format!("{} of {}", model.terms().iter().filter(is).count(), model.terms().len())
            });
            writeln!(
                text,
                "| {name} | {threads} | {:.2} | {:.0} | {:.2} | {:.0} | {found} | {:.1} |",
                number("wall_s"),
                number("megabytes_per_s"),
                number("cpu_s"),
                number("peak_rss_mib"),
                number("loadavg")
            )?;
            eprintln!("{name}, {threads} threads: {:.2} s, {} rows", number("wall_s"), value["rows"]);
        }
    }
    Ok(text)
}
