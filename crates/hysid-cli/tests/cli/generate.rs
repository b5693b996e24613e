//! `hysid generate`: the fixtures are what their commands write, and bad options end with status 2 and one clear message.

use std::path::{Path, PathBuf};

use assert_cmd::Command;

fn hysid(args: &[&str]) -> assert_cmd::assert::Assert {
    Command::cargo_bin("hysid").unwrap().args(args).assert()
}

fn fixtures() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures")
}

#[test]
fn every_fixture_is_remade_byte_for_byte_by_its_command() {
    let readme = std::fs::read_to_string(fixtures().join("README.md")).unwrap();
    let directory = tempfile::tempdir().unwrap();
    let mut made = Vec::new();
    for command in readme.lines().filter_map(|line| line.strip_prefix("hysid ")) {
        let words: Vec<&str> = command.split_whitespace().collect();
        let (out, options) = words.split_last().unwrap();
        let name = Path::new(out).file_name().unwrap();
        let path = directory.path().join(name);
        let mut options = options.to_vec();
        options.push(path.to_str().unwrap());
        hysid(&options).success();
        let (ours, kept) = (std::fs::read(&path).unwrap(), std::fs::read(fixtures().join(name)).unwrap());
        assert!(ours == kept, "{} is not what its command writes", name.display());
        made.push(name.to_owned());
    }
    assert!(made.len() >= 3);
    for name in ["piezo_boucwen.csv", "preisach_reversals.csv", "pitching_wing.csv"] {
        assert!(made.iter().any(|m| m == name), "{name} has no command in fixtures/README.md");
    }
}

#[test]
fn bad_options_end_with_status_2_and_say_what_is_allowed() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("x.csv");
    let out = out.to_str().unwrap();
    let cases: &[(&[&str], &str)] = &[
        (&["--out", out], "name an operator; `hysid generate --list` shows them"),
        (&["bouc-wen"], "name the file to write by --out"),
        (&["boucwen", "--out", out], "there is no operator `boucwen`; there are baber-noori, bouc-wen"),
        (&["bouc-wen", "--set", "bta=1", "--out", out], "bouc-wen has no parameter `bta`; it has a, beta"),
        (&["bouc-wen", "--set", "beta", "--out", out], "write it as NAME=VALUE"),
        (&["bouc-wen", "--set", "beta=x", "--out", out], "beta must be a number"),
        (&["bouc-wen", "--set", "gamma=2", "--out", out], "gamma must be at most beta = 0.5 in size"),
        (&["bouc-wen", "--set", "sub_steps=0", "--out", out], "sub_steps must be 1 to 100000"),
        (&["preisach", "--set", "form=quick", "--out", out], "form must be one of staircase, grid, smooth"),
        (&["play", "--samples", "1", "--out", out], "--samples 1 is not allowed"),
        (&["play", "--samples", "999999999999", "--out", out], "it must be 2 to 100000000"),
        (&["play", "--repeat", "999999999999", "--out", out], "--repeat 999999999999 is not allowed"),
        (&["play", "--repeat", "0", "--out", out], "--repeat 0 is not allowed; it must be 1 to"),
        (
            &["play", "--from", "100", "--to", "1", "--out", out],
            "--from 100 is not allowed; it must be a number from 0",
        ),
        (
            &["play", "--from", "2", "--to", "1", "--out", out],
            "the band (--from to --to) 2 to 1 is not allowed; it must be wide",
        ),
        (
            &["play", "--modulation", "-1", "--out", out],
            "--modulation -1 is not allowed; it must be a number from 0 to 1",
        ),
        (&["play", "--excitation", "sine", "--frequency", "-1", "--out", out], "--frequency -1 is not allowed"),
        (&["play", "--amplitude", "1e308", "--out", out], "the largest magnitude that a recording may hold is 1e100"),
        (
            &["bouc-wen", "--set", "sub_steps=1e12", "--out", out],
            "sub_steps = 1000000000000 is not allowed; sub_steps must be 1 to 100000",
        ),
        (&["bouc-wen", "--set", "sub_steps=1.5", "--out", out], "sub_steps must be a whole number of 0 or more"),
        (&["prandtl-ishlinskii", "--set", "plays=999999999999", "--out", out], "plays must be 10000 or less"),
        (&["maxwell-slip", "--set", "elements=0", "--out", out], "the number of elements must be 1 or more"),
        (&["play", "--period", "0", "--out", out], "--period 0 is not allowed; it must be a finite number above 0"),
        (&["play", "--amplitude", "inf", "--out", out], "--amplitude inf is not allowed; it must be a finite number"),
        (&["play", "--excitation", "sine", "--frequency", "60", "--out", out], "the Nyquist frequency, 50 Hz"),
        (
            &["play", "--excitation", "sine", "--ratio", "0.5", "--out", out],
            "--ratio belongs to the excitation reversals",
        ),
        (&["play", "--excitation", "saw", "--out", out], "possible values: sine, triangle"),
        (&["play", "--noise-variance=-1", "--out", out], "noise variance is -1; it must be"),
        (&["play", "--noise-colour", "0.5", "--out", out], "--noise-colour needs --noise-variance or --snr"),
        (&["play", "--snr", "20", "--noise-colour", "1.1", "--out", out], "is not stable"),
        (&["play", "--snr", "20", "--amplitude", "0", "--out", out], "the signal is constant"),
        (&["play", "--output-name", "u", "--out", out], "two channels are named `u`"),
        (&["play", "--out", "/nowhere/x.csv"], "/nowhere/x.csv"),
    ];
    for (options, expected) in cases {
        let mut args = vec!["generate"];
        args.extend(*options);
        let assert = hysid(&args).code(2);
        let output = assert.get_output();
        let message = String::from_utf8_lossy(&output.stderr);
        assert!(message.contains(expected) && message.lines().count() == 1, "{options:?} says {message}");
        assert!(output.stdout.is_empty());
        assert!(!Path::new(out).exists(), "{options:?} left a file");
    }
}

#[test]
fn lists_name_every_operator_and_every_parameter() {
    let text = |args: &[&str]| String::from_utf8(hysid(args).success().get_output().stdout.clone()).unwrap();
    let operators = text(&["generate", "--list"]);
    for entry in hysid_hysteresis::catalogue::all() {
        assert!(operators.contains(entry.name));
        let parameters = text(&["generate", entry.name, "--list"]);
        for parameter in entry.parameters {
            assert!(parameters.contains(parameter.name) && parameters.contains(parameter.meaning));
        }
    }
}
