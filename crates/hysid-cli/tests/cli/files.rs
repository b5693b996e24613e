//! What the files of a command must not be to each other, and recordings that an identification could hang on.

use std::fmt::Write;
use std::path::Path;
use std::time::Duration;

use crate::common::hysid;
use assert_cmd::Command;

const SIMULATION: &str = r#"
[time]
column = "t_s"
[inputs]
u = "u_V"
[parameters]
tau = { value = 0.5, min = 0.01, max = 10.0, unit = "s" }
[states]
x = { derivative = "(u - x)/tau", initial = 0.0 }
[outputs]
y_mm = "x"
"#;

/// A first-order lag under a multisine, in a recording with this sampling period and what `change` makes of each output.
fn recording(rows: usize, period: f64, change: impl Fn(usize, f64, f64) -> f64) -> String {
    later(0, rows, period, change)
}

/// The same from another sample of the multisine on.
fn later(first: usize, rows: usize, period: f64, change: impl Fn(usize, f64, f64) -> f64) -> String {
    let mut text = String::from("t_s,u_V,y_mm\n");
    let mut y = 0.0;
    for n in 0..rows {
        let t = (first + n) as f64;
        let u = (0.37 * t).sin() + 0.7 * (0.11 * t + 0.5).cos() + 0.5 * (0.83 * t).sin();
        let time = format!("{:.9}", period * n as f64);
        _ = writeln!(text, "{time},{u:e},{:e}", change(n, u, y));
        y += 0.1 * (u - y);
    }
    text
}

fn files() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(dir.path().join(name), text).unwrap();
    write("est.csv", &recording(400, 0.01, |_, _, y| y));
    write("val.csv", &later(1000, 300, 0.01, |_, _, y| y));
    write("slow.csv", &later(1000, 300, 0.010_01, |_, _, y| y));
    write("a.sim.toml", SIMULATION);
    write("period.sim.toml", &SIMULATION.replace("column = \"t_s\"", "period_s = 0.02"));
    dir
}

const FIT: [&str; 9] = ["fit", "--recording", "est.csv", "--input", "u_V", "--output", "y_mm", "--out", "out"];

/// Exit status 2, one line that holds these words.
fn refused(dir: &Path, line: &[&str], words: &[&str]) {
    let (status, _, said) = hysid(line, dir);
    assert_eq!((status, said.trim_end().lines().count()), (2, 1), "{line:?}: {said}");
    for word in words {
        assert!(said.contains(word), "{line:?}: `{word}` is not in {said}");
    }
}

#[test]
fn no_result_is_written_over_an_input() {
    let files = files();
    let dir = files.path();
    std::fs::create_dir(dir.join("sub")).unwrap();
    std::fs::write(dir.join("model.json"), "{}").unwrap();
    std::fs::write(dir.join("fit.json"), recording(400, 0.01, |_, _, y| y)).unwrap();
    std::fs::write(dir.join("augmented.sim.toml"), SIMULATION).unwrap();
    let before = crate::common::files_of(dir);
    let overwrite = |line: &[&str]| refused(dir, line, &["--out", "would overwrite"]);
    overwrite(&["simulate", "a.sim.toml", "--input", "est.csv", "--out", "sub/../est.csv"]);
    overwrite(&["simulate", "a.sim.toml", "--input", "est.csv", "--out", "a.sim.toml"]);
    overwrite(&["predict", "model.json", "--recording", "est.csv", "--out", "./est.csv"]);
    overwrite(&["predict", "model.json", "--recording", "est.csv", "--out", "model.json"]);
    overwrite(&["decimate", "est.csv", "--output", "y_mm", "--out", "est.csv"]);
    overwrite(&["fit", "--recording", "fit.json", "--input", "u_V", "--output", "y_mm", "--out", "."]);
    overwrite(&["diagnose", "augmented.sim.toml", "--recording", "est.csv", "--holdout", "val.csv", "--out", "."]);
    assert!(before == crate::common::files_of(dir));
}

#[test]
fn a_hold_out_is_not_what_was_learnt_from() {
    let files = files();
    let dir = files.path();
    std::fs::copy(dir.join("est.csv"), dir.join("copy.csv")).unwrap();
    let with = |more: &[&'static str]| [&FIT[..], more].concat();
    refused(dir, &with(&["--holdout", "copy.csv"]), &["copy.csv", "the same data as est.csv"]);
    refused(dir, &with(&["--holdout", "./est.csv"]), &["est.csv", "--recording and as --holdout"]);
    // A part, with a clock of its own.
    let whole = std::fs::read_to_string(dir.join("est.csv")).unwrap();
    let lines: Vec<&str> = whole.lines().collect();
    let rows = lines[100..300].iter().enumerate().map(|(n, l)| format!("{},{}\n", n, l.split_once(',').unwrap().1));
    std::fs::write(dir.join("part.csv"), "t_s,u_V,y_mm\n".to_owned() + &rows.collect::<String>()).unwrap();
    let part = ["part.csv: 200 of its 200 rows stand in est.csv, too", "never sees"];
    refused(dir, &with(&["--holdout", "part.csv"]), &part);
    let diagnose = ["diagnose", "a.sim.toml", "--recording", "est.csv", "--holdout", "part.csv", "--out", "out"];
    refused(dir, &diagnose, &part);
    std::fs::write(dir.join("two.csv"), "t_s,u_V,y_mm\n0,1,2\n1,2,3\n").unwrap();
    refused(dir, &with(&["--holdout", "two.csv"]), &["two.csv: 2 samples; at least 20 are needed"]);
    refused(dir, &with(&["--recording", "est.csv"]), &["est.csv", "given twice as --recording"]);
    refused(dir, &with(&["--input", "t_s"]), &["--input t_s", "time column"]);
    refused(dir, &with(&["--threads", "1025"]), &["--threads is 1025; allowed is 1 to 1024"]);
    refused(dir, &with(&["--threads", "99999999"]), &["allowed is 1 to 1024"]);
    refused(
        dir,
        &["fit", "--recording", "est.csv", "--input", "u_V", "--output", "t_s", "--out", "out"],
        &["--output t_s", "time column"],
    );
    assert!(!dir.join("out").exists());
}

#[test]
fn another_clock_is_refused() {
    let files = files();
    let dir = files.path();
    let simulate = ["simulate", "period.sim.toml", "--input", "est.csv", "--out", "out.csv"];
    refused(dir, &simulate, &["est.csv, column `t_s`", "is 0.01 s", "`period_s = 0.02`"]);
    let (status, _, said) = hysid(&[&FIT[..], &["--factors", "polynomial", "--degree", "1"]].concat(), dir);
    assert_eq!(status, 0, "{said}");
    // As a hold-out it is told.
    let (status, _, said) =
        hysid(&[&FIT[..], &["--holdout", "slow.csv", "--factors", "polynomial", "--degree", "1"]].concat(), dir);
    let warning = "warning: hold-out slow.csv: its sampling period is 0.01001 s, that of the recordings";
    assert!(status == 0 && said.contains(warning), "{said}");
    let predict = |recording| ["predict", "out/model.json", "--recording", recording, "--out", "out.csv"];
    refused(dir, &predict("slow.csv"), &["slow.csv", "is 0.01001 s", "one of 0.01 s", "resample"]);
    assert!(!dir.join("out.csv").exists());
    assert_eq!(hysid(&predict("val.csv"), dir).0, 0);
}

#[test]
fn messages_name_the_remedy() {
    let files = files();
    let dir = files.path();
    let text = recording(400, 0.01, |_, _, y| y);
    std::fs::write(dir.join("no_clock.csv"), text.replace("t_s,u_V", "time,u_V")).unwrap();
    refused(dir, &["inspect", "no_clock.csv"], &["no_clock.csv", "`time`, `u_V`, `y_mm`", "--period-s", "[time]"]);
    std::fs::write(dir.join("bars.csv"), text.replace(',', "|")).unwrap();
    refused(dir, &["inspect", "bars.csv"], &["bars.csv, line 1", "bars", "commas"]);
    let constant = ["fit", "--recording", "constant.csv", "--input", "u_V", "--output", "y_mm", "--out", "out"];
    std::fs::write(dir.join("constant.csv"), "t_s,u_V,y_mm\n".to_owned() + &rows_with_a_constant_input()).unwrap();
    refused(dir, &constant, &["constant.csv", "`u_V`", "constant"]);
    let holes = SIMULATION.replace("y_mm = \"x\"", "y_mm = \"x + sqrt(u)\"");
    std::fs::write(dir.join("a.sim.toml"), holes).unwrap();
    refused(
        dir,
        &["simulate", "a.sim.toml", "--input", "est.csv", "--out", "out.csv"],
        &["a.sim.toml", "output `y_mm` is not finite at sample"],
    );
    // Larger than memory, but for its holes.
    std::fs::File::create(dir.join("a.sim.toml")).unwrap().set_len(1 << 40).unwrap();
    let huge = ["simulate", "a.sim.toml", "--input", "est.csv", "--out", "out.csv"];
    refused(dir, &huge, &["a.sim.toml", "larger than 1048576 bytes"]);
}

fn rows_with_a_constant_input() -> String {
    (0..100).map(|n| format!("{:.2},1.5,{}\n", 0.01 * f64::from(n), (0.3 * f64::from(n)).sin())).collect()
}

#[test]
fn gaps_are_told_as_what_they_are() {
    let files = files();
    let dir = files.path();
    // Every second input is missing: samples enough, but never two in a row.
    let whole = later(2000, 60, 0.01, |_, _, y| y);
    let hole = |(n, line): (usize, &str)| {
        let fields: Vec<&str> = line.split(',').collect();
        if n % 2 == 0 && n > 0 { format!("{},,{}\n", fields[0], fields[2]) } else { format!("{line}\n") }
    };
    std::fs::write(dir.join("holes.csv"), whole.lines().enumerate().map(hole).collect::<String>()).unwrap();
    let line = [&FIT[..], &["--holdout", "holes.csv", "--factors", "polynomial", "--degree", "1"]].concat();
    let (status, told, said) = hysid(&line, dir);
    assert!(status == 0 && said.contains("warning: hold-out holes.csv: not one sample could be judged"), "{said}");
    assert!(told.contains("every sample, output lags"), "{told}");
    let one = later(0, 60, 0.01, |n, _, y| if n == 30 { f64::NAN } else { y });
    std::fs::write(dir.join("one.csv"), one).unwrap();
    let (_, told, _) = hysid(&["inspect", "one.csv"], dir);
    let gaps = "Gaps: 2 stretches, counted where no channel misses a sample; the longest is of 30 samples";
    assert!(told.contains(gaps) && told.contains("\n  1 sample missing\n"), "{told}");
}

#[test]
fn recordings_of_one_name_are_told_apart() {
    let files = files();
    let dir = files.path();
    for (folder, from) in [("a", "est.csv"), ("b", "val.csv")] {
        std::fs::create_dir(dir.join(folder)).unwrap();
        std::fs::copy(dir.join(from), dir.join(folder).join("r.csv")).unwrap();
    }
    let fit = ["fit", "--recording", "a/r.csv", "--holdout", "b/r.csv", "--input", "u_V", "--output", "y_mm"];
    let more = ["--out", "out", "--factors", "polynomial", "--degree", "1", "--json"];
    let (status, told, said) = hysid(&[&fit[..], &more].concat(), dir);
    assert_eq!(status, 0, "{said}");
    let told: serde_json::Value = serde_json::from_str(&told).unwrap();
    assert_eq!(
        (&told["free_run"][0]["recording"], &told["free_run"][1]["recording"]),
        (&"a/r.csv".into(), &"b/r.csv".into())
    );
    let constant = later(0, 300, 0.01, |_, _, _| 0.5);
    std::fs::write(dir.join("b/r.csv"), constant).unwrap();
    let diagnose = ["diagnose", "a.sim.toml", "--recording", "a/r.csv", "--holdout", "b/r.csv", "--out", "out"];
    let (status, _, said) = hysid(&diagnose, dir);
    assert!(status == 2 && said.contains("hysid: b/r.csv: column `y_mm` is constant"), "{said}");
    refused(dir, &[&fit[..], &["--out", "out"]].concat(), &["b/r.csv, column `y_mm`", "constant"]);
}

/// Each once ran for ever in the iteration for the poles of its linear model.
#[test]
fn degenerate_outputs_end() {
    let spike = recording(400, 0.01, |n, _, _| if n == 200 { 2.0 } else { 1.0 });
    let tiny = recording(400, 0.01, |_, _, y| 1e-200 * y);
    for (what, text) in [("a constant but for one sample", spike), ("far below what can be squared", tiny)] {
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join("est.csv"), text).unwrap();
        let mut command = Command::cargo_bin("hysid").unwrap();
        let done = command.current_dir(dir.path()).args(FIT).timeout(Duration::from_secs(200)).output().unwrap();
        let said = String::from_utf8_lossy(&done.stderr);
        assert!(matches!(done.status.code(), Some(0 | 2)), "{what}: {:?} {said}", done.status);
        assert!(!said.contains("panicked"), "{what}: {said}");
        assert!(done.status.success() || said.contains("est.csv"), "{what}: {said}");
    }
}
