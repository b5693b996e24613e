//! `hysid select`: what it finds in a file it reads once is what is found in memory, and bad input ends it with one message.

use std::fmt::Write;
use std::path::Path;

use crate::common::{hysid, shared};
use hysid_dictionary::{Design, Record, Signals, Spec};
use hysid_select::{Criterion, Options, Search, select};
use serde_json::Value;

/// Uniform numbers in -1..1.
fn uniform(state: &mut u64) -> f64 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
}

/// Inputs and output of a system, `next(y, u, v)` giving y\[n\] from what came before.
fn system(n: usize, seed: u64, next: fn(&[f64], &[f64], &[f64]) -> f64) -> [Vec<f64>; 3] {
    let mut state = seed;
    let [mut u, mut v, mut y] = [vec![0.0; n], vec![0.0; n], vec![0.0; n]];
    for k in 0..n {
        (u[k], v[k]) = (uniform(&mut state), uniform(&mut state));
        if k > 2 {
            y[k] = next(&y[..k], &u[..=k], &v[..=k]) + 0.01 * uniform(&mut state);
        }
    }
    [u, v, y]
}

fn known(y: &[f64], u: &[f64], _: &[f64]) -> f64 {
    let n = y.len();
    0.05 + 0.55 * y[n - 1] - 0.2 * y[n - 2] + 0.6 * u[n - 1] + 0.15 * u[n - 1].powi(2) - 0.2 * y[n - 1] * u[n - 2]
        + 0.18 * u[n - 1] * u[n - 2] * y[n - 2]
}

fn bilinear(y: &[f64], u: &[f64], v: &[f64]) -> f64 {
    let n = y.len();
    0.7 * y[n - 1] + 0.3 * u[n] + 0.2 * v[n - 1] - 0.25 * y[n - 1] * v[n]
}

/// Follows its input with a play of width 0.3: no polynomial, so that the last terms are hard to tell apart.
fn play(y: &[f64], u: &[f64], _: &[f64]) -> f64 {
    let n = y.len();
    y[n - 1].clamp(u[n] - 0.3, u[n] + 0.3)
}

#[test]
fn a_file_read_once_gives_what_memory_gives() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("r.csv");
    let cases: [(&str, fn(&[f64], &[f64], &[f64]) -> f64, usize, usize); 4] = [
        ("known", known, 1, 30_000),
        ("known, short", known, 1, 400),
        ("bilinear", bilinear, 0, 20_000),
        ("play", play, 0, 70_001),
    ];
    for (seed, (name, next, delay, n)) in (1..).zip(cases) {
        let [u, v, y] = system(n, seed, next);
        let mut text = String::from("t_s,u,v,y\n");
        for k in 0..n {
            // Some samples are missing.
            let y = if k % 997 == 500 { String::new() } else { y[k].to_string() };
            writeln!(text, "{:.2},{},{},{y}", 0.01 * k as f64, u[k], v[k]).unwrap();
        }
        std::fs::write(&file, text).unwrap();
        let found = agree(&file, name, &["u", "v"], "y", &delay.to_string(), 12);
        assert_eq!(found["period_s"], 0.01);
    }
}

/// What `hysid select` finds with lags up to 2, compared with the selection from the recording in memory; the same for any number of threads.
fn agree(file: &Path, name: &str, inputs: &[&str], output: &str, delay: &str, terms: usize) -> Value {
    let columns = inputs.iter().copied().chain([output]);
    let recording = hysid_io::read_recording(file, &hysid_io::ReadOptions::columns(columns)).unwrap();
    let samples: Vec<&[f64]> = recording.channels().iter().map(|c| c.samples.as_slice()).collect();
    let signals = Signals::from_columns(output, inputs).unwrap();
    let dictionary = Spec::narx(signals, 2, delay.parse().unwrap()..=2, 3).build().unwrap();
    let (y, u) = samples.split_last().unwrap();
    let design = Design::new(&dictionary, &[Record::new(y, u.to_vec())]).unwrap();
    let options = Options { search: Search::Greedy, criterion: Criterion::Terms(terms), ..Options::default() };
    let expected = select(&design, &design.target(), &options).unwrap();
    let count = terms.to_string();
    let mut args = vec!["select", "--recording", file.to_str().unwrap(), "--output", output, "--input-delay", delay];
    inputs.iter().for_each(|u| args.extend(["--input", u]));
    args.extend(["--lags-output", "2", "--lags-input", "2", "--terms", &count, "--search", "greedy", "--json"]);
    let (status, out, err) = hysid(&args, Path::new("."));
    assert_eq!((status, err.as_str()), (0, ""), "{name}");
    let found: Value = serde_json::from_str(&out).unwrap();
    let terms = found["terms"].as_array().unwrap();
    let texts: Vec<&str> = terms.iter().filter_map(|t| t["term"].as_str()).collect();
    assert_eq!(texts, expected.terms.iter().map(|&j| dictionary.text(j)).collect::<Vec<_>>(), "{name}");
    for (k, term) in terms.iter().enumerate() {
        let (theta, error) = (term["theta"].as_f64().unwrap(), term["standard_error"].as_f64().unwrap());
        assert!((theta / expected.theta[k] - 1.0).abs() < 1e-9, "{name}: {theta} {}", expected.theta[k]);
        assert!((error / expected.standard_errors()[k] - 1.0).abs() < 1e-9, "{name}");
    }
    assert_eq!(found["samples"], expected.samples);
    for threads in ["1", "2", "3"] {
        let again = hysid(&[&args[..], &["--threads", threads]].concat(), Path::new("."));
        assert_eq!(again.1, out, "{name}: {threads} threads");
    }
    found
}

#[test]
fn real_recordings_read_once_give_what_memory_gives() {
    let Some(root) = shared() else { return };
    for (file, input, output) in [
        ("silverbox/silverbox_validation_arrow.csv", "u_V", "y_V"),
        ("wiener_hammerstein/wh_validation.csv", "u_V", "y_V"),
        ("boucwen_benchmark_simulated/boucwen_validation_multisine.csv", "u_N", "y_mm"),
        ("mr_damper_utfpr/mr_exp1.csv", "v_mm_s", "F_N"),
    ] {
        agree(&root.join("recordings").join(file), file, &[input], output, "0", 8);
    }
}

#[test]
fn bad_input_ends_it_with_one_message() {
    let dir = tempfile::tempdir().unwrap();
    let row = |n: usize| format!("{:.1},{},{}\n", 0.1 * n as f64, n % 7, n % 5);
    let good: String = (0..300).map(row).collect();
    let with = |n: usize, line: &str| (0..300).map(|k| if k == n { line.to_string() } else { row(k) }).collect();
    let file = |body: String| format!("t_s,u,y\n{body}").into_bytes();
    let cases: Vec<(Vec<u8>, &[&str], &[&str])> = vec![
        (Vec::new(), &[], &["r.csv", "empty"]),
        (file(String::new()), &[], &["r.csv", "not one line of numbers"]),
        (file(row(0)), &[], &["r.csv", "1 sample;"]),
        (file((0..3).map(row).collect()), &[], &["r.csv", "3 samples", "largest lag is 3"]),
        (file(with(9, "0.9,x,2\n")), &[], &["r.csv, line 11, column `u`", "`x` is not a number"]),
        (file(with(9, "0.9,1e200,2\n")), &[], &["r.csv, line 11, column `u`", "out of range"]),
        (file(with(9, "0.9,1\n")), &[], &["r.csv, line 11", "2 fields"]),
        (file(with(9, "")), &[], &["line 11, column `t_s`", "not uniform"]),
        (file(with(9, ",1,2\n")), &[], &["line 11, column `t_s`", "missing"]),
        (
            file((0..300).map(|n| format!("{:.1},{},0\n", 0.1 * n as f64, n % 7)).collect()),
            &[],
            &["r.csv, column `y`", "constant (0)"],
        ),
        (
            file(
                (0..300)
                    .map(|n| format!("{:.1},{},{}\n", 0.1 * n as f64, n % 7, if n % 9 == 4 { "" } else { "0.5" }))
                    .collect(),
            ),
            &[],
            &["r.csv, column `y`", "constant (0.5)"],
        ),
        (file(good.clone()), &["--output", "z"], &["r.csv, column `z`", "`t_s`, `u`, `y`"]),
        (file(good.clone()), &["--input", "u"], &["--input u", "given twice"]),
        (file(good.clone()), &["--input", "y"], &["--output y", "given twice"]),
        (file(good.clone()), &["--input", "t_s"], &["--input t_s", "time column"]),
        (file(good.clone()), &["--terms", "0"], &["--terms is 0", "1 or more"]),
        (file(good.clone()), &["--criterion", "err:2"], &["ERR tolerance 2"]),
        (file(good.clone()), &["--threads", "0"], &["--threads is 0"]),
        (file(good.clone()), &["--input-delay", "2"], &["--input-delay is 2"]),
        (file(good.clone()), &["--degree", "0"], &["degree 0"]),
        (file(good.clone()), &["--lags-input", "40"], &["2000"]),
    ];
    for (bytes, more, expected) in cases {
        std::fs::write(dir.path().join("r.csv"), bytes).unwrap();
        let mut args = vec!["select", "--recording", "r.csv", "--input", "u"];
        if !more.contains(&"--output") {
            args.extend(["--output", "y"]);
        }
        args.extend(more);
        let (status, out, err) = hysid(&args, dir.path());
        assert_eq!((status, out.as_str()), (2, ""), "{more:?}: {err}");
        assert_eq!(err.lines().count(), 1, "{err}");
        for part in expected {
            assert!(err.contains(part), "{more:?}: {err}");
        }
    }
}

#[test]
fn a_fault_after_a_million_rows_is_told_with_its_place() {
    let dir = tempfile::tempdir().unwrap();
    let mut text = String::from("u,y\n");
    for n in 0..1_000_100 {
        text.push_str(if n == 1_000_000 { "0.5,4..5\n" } else { "0.5,0.25\n" });
    }
    std::fs::write(dir.path().join("r.csv"), text).unwrap();
    for threads in ["1", "2"] {
        let args = ["select", "--recording", "r.csv", "--input", "u", "--output", "y", "--threads", threads];
        let (status, out, err) = hysid(&args, dir.path());
        let told = "hysid: r.csv, line 1000002, column `y`: `4..5` is not a number (an empty field or `NaN` stands for a missing sample)\n";
        assert_eq!((status, out.as_str(), err.as_str()), (2, "", told));
    }
}
