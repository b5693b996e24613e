//! A table of bad input to the commands: exit status 2, one line that says what is wrong and where, no output file.

use std::path::Path;

use crate::common::hysid;
use assert_cmd::Command;

/// 300 samples of a loop, with columns `t_s,u_V,y_mm,flat_V`.
fn good() -> String {
    let mut text = String::from("t_s,u_V,y_mm,flat_V\n");
    for n in 0..300 {
        let phase = 0.1 * f64::from(n);
        text += &format!("{:.2},{:.6},{:.6},1.5\n", 0.01 * f64::from(n), phase.sin(), (phase - 0.4).sin());
    }
    text
}

/// The good recording with one line put in place of line `number`.
fn with_line(number: usize, line: &str) -> Vec<u8> {
    let mut lines: Vec<String> = good().lines().map(str::to_owned).collect();
    lines[number - 1] = line.to_owned();
    (lines.join("\n") + "\n").into_bytes()
}

/// The first lines of the good recording.
fn first(lines: usize) -> Vec<u8> {
    let text: Vec<String> = good().lines().take(lines).map(|l| format!("{l}\n")).collect();
    text.concat().into_bytes()
}

fn replaced(from: &str, to: &str) -> Vec<u8> {
    good().replace(from, to).into_bytes()
}

/// Runs the program; returns status and stderr.
fn run(args: &[&str], dir: &Path) -> (i32, String) {
    let (status, _, stderr) = hysid(args, dir);
    (status, stderr)
}

#[test]
fn each_bad_recording_ends_every_command_with_one_clear_message() {
    // What, the bytes of rec.csv, what the message must hold.
    let cases: Vec<(&str, Vec<u8>, &[&str])> = vec![
        ("empty file", Vec::new(), &["rec.csv", "empty"]),
        ("blank lines", b"\n\n\n".to_vec(), &["rec.csv", "empty"]),
        ("header only", first(1), &["rec.csv"]),
        ("one sample", first(2), &["rec.csv", "1 sample;"]),
        ("short row", with_line(7, "0.05,1.0"), &["rec.csv", "line 7", "2 fields", "4"]),
        ("long row", with_line(7, "0.05,1,2,3,4"), &["line 7", "5 fields"]),
        ("text", with_line(7, "0.05,abc,2,1.5"), &["line 7", "u_V", "abc"]),
        ("inf", with_line(7, "0.05,inf,2,1.5"), &["line 7", "u_V", "out of range"]),
        ("1e300", with_line(7, "0.05,1,1e300,1.5"), &["line 7", "y_mm", "out of range"]),
        ("not UTF-8", [first(6), b"0.05,\xB5,2,1.5\n".to_vec()].concat(), &["line 7", "UTF-8"]),
        (
            "UTF-16",
            [vec![0xFF, 0xFE], good().encode_utf16().flat_map(u16::to_le_bytes).collect()].concat(),
            &["UTF-16"],
        ),
        ("semicolons", replaced(",", ";"), &["line 1", "semicolons"]),
        ("lines that end in CR", replaced("\n", "\r"), &["rec.csv, line 1:", "carriage return", "LF"]),
        (
            "no header",
            good().lines().skip(1).collect::<Vec<_>>().join("\n").into_bytes(),
            &["line 1", "name the columns"],
        ),
        ("unnamed column", replaced("flat_V", ""), &["line 1", "column `4`", "no name"]),
        ("duplicate column", replaced("flat_V", "u_V"), &["u_V", "two columns"]),
        ("duplicate time", with_line(7, "0.04,1,2,1.5"), &["line 7", "t_s", "twice"]),
        ("decreasing time", with_line(7, "0.01,1,2,1.5"), &["line 7", "t_s", "goes back"]),
        ("missing time stamp", with_line(7, ",1,2,1.5"), &["line 7", "t_s", "missing"]),
        (
            "missing rows",
            good()
                .lines()
                .enumerate()
                .filter(|(n, _)| *n != 120)
                .map(|(_, l)| format!("{l}\n"))
                .collect::<String>()
                .into_bytes(),
            &["line 121", "t_s", "not uniform"],
        ),
        (
            "NaN everywhere",
            good()
                .lines()
                .enumerate()
                .map(
                    |(n, l)| {
                        if n == 0 { format!("{l}\n") } else { format!("{},NaN,,\n", l.split(',').next().unwrap()) }
                    },
                )
                .collect::<String>()
                .into_bytes(),
            &["rec.csv", "missing"],
        ),
    ];
    let dir = tempfile::tempdir().unwrap();
    let commands: [&[&str]; 3] = [
        &["inspect", "rec.csv"],
        &["decimate", "rec.csv", "--input", "u_V", "--output", "y_mm", "--out", "out.csv"],
        &["fit", "--recording", "rec.csv", "--input", "u_V", "--output", "y_mm", "--out", "out"],
    ];
    for (what, bytes, fragments) in &cases {
        std::fs::write(dir.path().join("rec.csv"), bytes).unwrap();
        for args in commands {
            let (status, message) = run(args, dir.path());
            assert_eq!(status, 2, "{what}, {}: {message}", args[0]);
            assert_eq!(message.trim_end().lines().count(), 1, "{what}, {}: one line, not\n{message}", args[0]);
            for fragment in *fragments {
                assert!(message.contains(fragment), "{what}, {}: `{fragment}` is not in {message}", args[0]);
            }
            assert!(!dir.path().join("out.csv").exists() && !dir.path().join("out/model.json").exists(), "{what}");
        }
    }
}

#[test]
fn each_bad_request_ends_with_one_clear_message() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("rec.csv"), good()).unwrap();
    std::fs::write(dir.path().join("short.csv"), first(6)).unwrap();
    std::fs::write(dir.path().join("no_clock.csv"), "u_V,y_mm\n1,2\n2,3\n").unwrap();
    std::fs::write(dir.path().join("model.json"), "{\"format\": \"something else\", \"format_version\": 1}").unwrap();
    std::fs::write(dir.path().join("array.json"), "[]").unwrap();
    std::fs::create_dir_all(dir.path().join("taken/fit.json")).unwrap();
    std::fs::create_dir(dir.path().join("folder")).unwrap();
    std::fs::write(dir.path().join("folder/in.csv"), good()).unwrap();
    let fit = ["fit", "--recording", "rec.csv", "--input", "u_V", "--output", "y_mm", "--out", "out"];
    let with = |more: &[&'static str]| fit.iter().copied().chain(more.iter().copied()).collect::<Vec<_>>();
    let cases: Vec<(&str, Vec<&str>, &str)> = vec![
        ("missing file", vec!["inspect", "none.csv"], "none.csv: there is no such file"),
        ("directory", vec!["inspect", "folder"], "folder: this is a directory"),
        ("no clock", vec!["inspect", "no_clock.csv"], "t_s"),
        ("period 0", vec!["inspect", "no_clock.csv", "--period-s", "0"], "period is 0 s"),
        ("period NaN", vec!["inspect", "no_clock.csv", "--period-s", "nan"], "period is NaN s"),
        ("missing input", vec!["inspect", "rec.csv", "--input", "x_V"], "`x_V`"),
        ("missing output", vec!["decimate", "rec.csv", "--input", "u_V", "--output", "x_V"], "`x_V`"),
        (
            "constant output",
            vec!["decimate", "folder/in.csv", "--input", "u_V", "--output", "flat_V"],
            "folder/in.csv, column `flat_V`: the column is constant",
        ),
        ("input is output", vec!["decimate", "rec.csv", "--input", "y_mm", "--output", "y_mm"], "y_mm"),
        ("alpha 2", vec!["decimate", "rec.csv", "--output", "y_mm", "--alpha", "2"], "alpha"),
        (
            "factor 0",
            vec!["decimate", "rec.csv", "--output", "y_mm", "--factor", "0", "--out", "out.csv"],
            "factor is 0",
        ),
        (
            "huge factor",
            vec!["decimate", "rec.csv", "--output", "y_mm", "--phase", "lth", "--factor", "1000", "--out", "out.csv"],
            "leave 0",
        ),
        (
            "one row left",
            vec!["decimate", "rec.csv", "--output", "y_mm", "--factor", "500", "--out", "out.csv"],
            "rec.csv: 300 samples, every 500th of which is kept, leave 1; at least 2 are needed",
        ),
        (
            "period beside a clock",
            vec!["inspect", "rec.csv", "--period-s", "0.5"],
            "rec.csv, column `t_s`: the sampling period is 0.01 s, but --period-s says 0.5 s",
        ),
        (
            "decimate: period beside a clock",
            vec!["decimate", "rec.csv", "--output", "y_mm", "--period-s", "0.5"],
            "--period-s says 0.5 s",
        ),
        (
            "folder as output",
            vec!["decimate", "rec.csv", "--output", "y_mm", "--out", "folder"],
            "folder cannot be written",
        ),
        (
            "fit: folder in the place of a result",
            vec!["fit", "--recording", "rec.csv", "--input", "u_V", "--output", "y_mm", "--out", "taken"],
            "--out taken: taken/fit.json cannot be written",
        ),
        (
            "fit: file in the place of the folder",
            vec!["fit", "--recording", "rec.csv", "--input", "u_V", "--output", "y_mm", "--out", "rec.csv/out"],
            "--out rec.csv/out: ",
        ),
        (
            "no folder for output",
            vec!["decimate", "rec.csv", "--output", "y_mm", "--out", "none/out.csv"],
            "cannot be written",
        ),
        (
            "fit: missing file",
            vec!["fit", "--recording", "none.csv", "--input", "u_V", "--output", "y_mm", "--out", "out"],
            "none.csv",
        ),
        (
            "fit: missing column",
            vec!["fit", "--recording", "rec.csv", "--input", "x_V", "--output", "y_mm", "--out", "out"],
            "`x_V`",
        ),
        (
            "fit: constant output",
            vec!["fit", "--recording", "folder/in.csv", "--input", "u_V", "--output", "flat_V", "--out", "out"],
            "folder/in.csv, column `flat_V`: the column is constant",
        ),
        (
            "fit: input is output",
            vec!["fit", "--recording", "rec.csv", "--input", "y_mm", "--output", "y_mm", "--out", "out"],
            "y_mm",
        ),
        (
            "fit: five samples",
            vec!["fit", "--recording", "short.csv", "--input", "u_V", "--output", "y_mm", "--out", "out"],
            "short.csv",
        ),
        ("fit: hold-out missing", with(&["--holdout", "none.csv"]), "none.csv"),
        ("fit: degree 0", with(&["--degree", "0"]), "degree"),
        ("fit: degree 99", with(&["--degree", "99"]), "degree"),
        ("fit: huge lag", with(&["--lags-output", "100000000"]), "lag"),
        ("fit: input delay 7", with(&["--input-delay", "7"]), "delay"),
        ("fit: factor 0", with(&["--decimate", "0"]), "decimat"),
        (
            "predict: missing model",
            vec!["predict", "none.json", "--recording", "rec.csv", "--out", "out.csv"],
            "none.json",
        ),
        ("predict: no JSON", vec!["predict", "rec.csv", "--recording", "rec.csv", "--out", "out.csv"], "rec.csv"),
        (
            "predict: an array",
            vec!["predict", "array.json", "--recording", "rec.csv", "--out", "out.csv"],
            "array.json, line 1: not the JSON that is needed: column 2: this is an array, expected an object",
        ),
        (
            "predict: another format",
            vec!["predict", "model.json", "--recording", "rec.csv", "--out", "out.csv"],
            "model.json",
        ),
    ];
    for (what, args, fragment) in &cases {
        let (status, message) = run(args, dir.path());
        assert_eq!(status, 2, "{what}: {message}");
        assert!(message.contains(fragment), "{what}: `{fragment}` is not in {message}");
        assert_eq!(message.trim_end().lines().count(), 1, "{what}: {message}");
        assert!(!message.contains("panicked"), "{what}: {message}");
        assert!(!dir.path().join("out.csv").exists() && !dir.path().join("out/model.json").exists(), "{what}");
    }
    // Options that the parser itself refuses.
    let options: [(&str, Vec<&str>, &str); 14] = [
        (
            "fit: no recording, no output",
            vec!["fit", "--input", "u_V", "--out", "out"],
            "required arguments were not provided: --recording <CSV> --output <COLUMN>; see `hysid fit --help`",
        ),
        ("fit: decimate x", with(&["--decimate", "x"]), "auto, none or a whole number"),
        ("fit: criterion x", with(&["--criterion", "x"]), "press, aic, bic"),
        ("fit: terms x", with(&["--terms", "x"]), "auto or a whole number"),
        ("fit: terms -1", with(&["--terms", "-1"]), "auto or a whole number"),
        ("fit: seed -5", with(&["--seed", "-5"]), "'-5' for '--seed <S>': a whole number of 0 or more is needed"),
        ("fit: factors x", with(&["--factors", "x"]), "polynomial, hysteresis or auto"),
        ("fit: misspelt", with(&["--holdouts", "x.csv"]), "'--holdouts' found; is `--holdout` meant?"),
        (
            "decimate: method x",
            vec!["decimate", "rec.csv", "--output", "y_mm", "--method", "x"],
            "'x' for '--method <METHOD>' [possible values: plain, chebyshev, kaiser]",
        ),
        ("decimate: largest 0", vec!["decimate", "rec.csv", "--output", "y_mm", "--largest", "0"], "1..=10000"),
        ("decimate: alpha -1", vec!["decimate", "rec.csv", "--output", "y_mm", "--alpha", "-1"], "--alpha is -1"),
        ("inspect: period -1", vec!["inspect", "no_clock.csv", "--period-s", "-1"], "period is -1 s"),
        ("decimate: factor without out", vec!["decimate", "rec.csv", "--output", "y_mm", "--factor", "2"], "--out"),
        ("unknown command", vec!["identify"], "'identify'; see `hysid --help`"),
    ];
    for (what, args, fragment) in options {
        let (status, message) = run(&args, dir.path());
        assert_eq!((status, message.trim_end().lines().count()), (2, 1), "{what}: {message}");
        assert!(message.starts_with("hysid: ") && message.contains(fragment), "{what}: {message}");
    }
}

#[test]
fn good_input_passes() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("rec.csv"), good()).unwrap();
    for json in [&[][..], &["--json"][..]] {
        for args in [
            &["inspect", "rec.csv"][..],
            &["decimate", "rec.csv", "--input", "u_V", "--output", "y_mm", "--out", "out.csv"],
        ] {
            let all: Vec<&str> = args.iter().chain(json).copied().collect();
            let output = Command::cargo_bin("hysid").unwrap().current_dir(dir.path()).args(&all).output().unwrap();
            assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
            let text = String::from_utf8(output.stdout).unwrap();
            if json.is_empty() {
                assert!(text.contains("y_mm") || text.contains("Recommended"), "{text}");
            } else {
                serde_json::from_str::<serde_json::Value>(&text).unwrap();
            }
        }
    }
    assert!(std::fs::read_to_string(dir.path().join("out.csv")).unwrap().starts_with("t_s,u_V,y_mm\n"));
}
