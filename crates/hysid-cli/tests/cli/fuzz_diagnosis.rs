//! Damaged simulation files and recordings: `hysid diagnose` ends with a verdict or with one message, never with a panic.

use crate::common::oscillator::BASELINE;
use crate::common::{FILES, OscillatorFiles, hysid};
use proptest::prelude::*;

/// One damage to a text.
#[derive(Debug, Clone)]
enum Damage {
    /// Characters that go.
    Cut { at: usize, length: usize },
    /// A piece of text that comes in.
    Insert { at: usize, text: String },
    /// A word (letters, digits, `_`, `.`) put in place of another.
    Swap { from: usize, to: usize },
}

fn damage() -> impl Strategy<Value = Damage> {
    let pieces = prop::sample::select(vec![
        "0",
        "-1",
        "1e308",
        "1e-308",
        "nan",
        "inf",
        "\"",
        "[",
        "]",
        "{",
        "}",
        "=",
        ",",
        "\n",
        "(",
        ")",
        "^",
        "/",
        "*x",
        "+ u",
        "sqrt(",
        "ln(x)",
        "play(u, k)",
        "relay(x, 0, 1)",
        "delay(v, 0.1)",
        "lag(u, c)",
        "d(u)",
        "sign(v)",
        "/x",
        "^0.5",
        "floor(t)",
        "free",
        "é",
        "\u{0}",
        " ",
    ]);
    prop_oneof![
        (0usize..1000, 1usize..9).prop_map(|(at, length)| Damage::Cut { at, length }),
        (0usize..1000, pieces).prop_map(|(at, text)| Damage::Insert { at, text: text.into() }),
        (0usize..100, 0usize..100).prop_map(|(from, to)| Damage::Swap { from, to }),
    ]
}

fn damaged(text: &str, all: &[Damage]) -> String {
    let mut chars: Vec<char> = text.chars().collect();
    for one in all {
        let n = chars.len().max(1);
        match one {
            Damage::Cut { at, length } => {
                let from = (at % n).min(chars.len());
                chars.drain(from..(from + length).min(chars.len()));
            }
            Damage::Insert { at, text } => {
                let from = (at % n).min(chars.len());
                chars.splice(from..from, text.chars());
            }
            Damage::Swap { from, to } => {
                let words = words(&chars);
                if let (Some(a), Some(b)) = (words.get(from % words.len().max(1)), words.get(to % words.len().max(1))) {
                    let copy = chars[b.clone()].to_vec();
                    chars.splice(a.clone(), copy);
                }
            }
        }
    }
    chars.into_iter().collect()
}

fn words(chars: &[char]) -> Vec<std::ops::Range<usize>> {
    let inside = |c: char| c.is_alphanumeric() || c == '_' || c == '.';
    let mut out = Vec::new();
    let mut start = None;
    for (i, c) in chars.iter().copied().chain([' ']).enumerate() {
        match (inside(c), start) {
            (true, None) => start = Some(i),
            (false, Some(s)) => {
                out.push(s..i);
                start = None;
            }
            _ => {}
        }
    }
    out
}

/// What is done to one column of a recording.
#[derive(Debug, Clone)]
enum Spoil {
    /// One field becomes this text.
    Field { row: usize, column: usize, text: &'static str },
    /// A column times this.
    Scale { column: usize, factor: f64 },
    /// Every sample of a column from this one on is missing, but for every tenth.
    Gaps { column: usize, from: usize, every: usize },
    /// A column keeps its value from this sample on.
    Freeze { column: usize, from: usize },
    /// Rows that go at the end.
    Truncate { keep: usize },
}

fn spoil() -> impl Strategy<Value = Spoil> {
    let texts = prop::sample::select(vec!["", "NaN", "inf", "1e99", "-1e99", "1e-300", "0", "x", "\"", "1,2", "é"]);
    let factors = prop::sample::select(vec![0.0, -1.0, 1e-300, 1e-30, 1e30, 1e90, 1e-9, 1e9]);
    prop_oneof![
        (1usize..90, 0usize..4, texts).prop_map(|(row, column, text)| Spoil::Field { row, column, text }),
        (1usize..4, factors).prop_map(|(column, factor)| Spoil::Scale { column, factor }),
        (0usize..4, 0usize..90, 2usize..40).prop_map(|(column, from, every)| Spoil::Gaps { column, from, every }),
        (1usize..4, 0usize..90).prop_map(|(column, from)| Spoil::Freeze { column, from }),
        (0usize..90).prop_map(|keep| Spoil::Truncate { keep }),
    ]
}

fn spoiled(text: &str, all: &[Spoil]) -> String {
    let mut rows: Vec<Vec<String>> = text.lines().map(|l| l.split(',').map(str::to_owned).collect()).collect();
    for one in all {
        match *one {
            Spoil::Field { row, column, text } => {
                if let Some(field) = rows.get_mut(row).and_then(|r| r.get_mut(column)) {
                    text.clone_into(field);
                }
            }
            Spoil::Scale { column, factor } => {
                for field in rows.iter_mut().skip(1).filter_map(|r| r.get_mut(column)) {
                    if let Ok(x) = field.parse::<f64>() {
                        *field = format!("{:e}", factor * x);
                    }
                }
            }
            Spoil::Gaps { column, from, every } => {
                for (n, row) in rows.iter_mut().enumerate().skip(1 + from) {
                    if n % every == 0
                        && let Some(field) = row.get_mut(column)
                    {
                        field.clear();
                    }
                }
            }
            Spoil::Freeze { column, from } => {
                let value = rows.get(1 + from).and_then(|r| r.get(column)).cloned();
                for row in rows.iter_mut().skip(1 + from) {
                    if let (Some(field), Some(value)) = (row.get_mut(column), &value) {
                        field.clone_from(value);
                    }
                }
            }
            Spoil::Truncate { keep } => rows.truncate(1 + keep),
        }
    }
    rows.iter().map(|r| r.join(",") + "\n").collect()
}

/// How the user's simulation is given.
#[derive(Debug, Clone, Copy)]
enum Mode {
    File,
    Column,
}

/// Runs the command on the folder, with next to no time for optional steps.
fn ends_well(dir: &std::path::Path, mode: Mode) -> Result<(), TestCaseError> {
    let mut line = match mode {
        Mode::Column => vec!["diagnose", "--simulated", "s_m", "--input", "u_N", "--output", "x_m"],
        Mode::File => vec!["diagnose", "base.sim.toml"],
    };
    line.extend(FILES);
    line.extend(["--threads", "1", "--time-limit", "0.01"]);
    let (status, _, stderr) = hysid(&line, dir);
    prop_assert!(!stderr.contains("panicked"), "{stderr}");
    prop_assert!(status == 0 || status == 2, "{status}: {stderr}");
    let written = dir.join("out/diagnosis.json").exists();
    prop_assert!(written == (status == 0) && dir.join("out").exists() == written, "{status}: {stderr}");
    Ok(())
}

/// Cases of each law: few, as each runs the program; `HYSID_FUZZ_CASES` makes them more.
fn cases() -> u32 {
    std::env::var("HYSID_FUZZ_CASES").ok().and_then(|n| n.parse().ok()).unwrap_or(24)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: cases(), failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_damaged_simulation_is_told_or_diagnosed(all in prop::collection::vec(damage(), 1..4)) {
        let dir = OscillatorFiles::write(80);
        std::fs::write(dir.path().join("base.sim.toml"), damaged(BASELINE, &all)).unwrap();
        ends_well(dir.path(), Mode::File)?;
    }

    #[test]
    fn a_damaged_recording_is_told_or_diagnosed(
        all in prop::collection::vec((prop::sample::select(vec!["est.csv", "val.csv"]), spoil()), 1..4),
        mode in prop::sample::select(vec![Mode::File, Mode::Column]),
    ) {
        let dir = OscillatorFiles::write(80);
        for (file, one) in &all {
            let text = std::fs::read_to_string(dir.path().join(file)).unwrap();
            std::fs::write(dir.path().join(file), spoiled(&text, std::slice::from_ref(one))).unwrap();
        }
        ends_well(dir.path(), mode)?;
    }
}
