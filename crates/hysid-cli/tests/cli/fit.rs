//! `hysid fit` and `hysid predict` as a user meets them: what they write, and what they say to bad input.

use std::fmt::Write;
use std::path::Path;
use std::process::{Command, Output};

fn hysid(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_hysid")).args(args).output().unwrap()
}

/// A small cubic system under a multisine from its sample `first` on.
fn recording(first: usize, rows: usize) -> String {
    let mut text = String::from("t_s,u_V,y_mm,still,late\n");
    let (mut y1, mut y2, mut u1) = (0.0f64, 0.0, 0.0);
    for n in 0..rows {
        let t = (first + n) as f64;
        let u = (0.37 * t).sin() + 0.7 * (0.11 * t + 0.5).cos() + 0.5 * (0.83 * t).sin();
        let y = 1.2 * y1 - 0.5 * y2 - 0.05 * y1 * y1 * y1 + 0.3 * u1;
        _ = writeln!(text, "{},{u:.9},{y:.9},1.5,{}", 0.01 * n as f64, if n > 10 { "" } else { "1" });
        (y2, y1, u1) = (y1, y, u);
    }
    text
}

fn files() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("est.csv"), recording(0, 600)).unwrap();
    std::fs::write(dir.path().join("val.csv"), recording(1000, 500)).unwrap();
    std::fs::write(dir.path().join("short.csv"), recording(0, 4)).unwrap();
    std::fs::write(dir.path().join("empty.csv"), "").unwrap();
    dir
}

fn path(dir: &Path, name: &str) -> String {
    dir.join(name).display().to_string()
}

#[test]
fn a_fit_is_written_and_predicts_every_row() {
    let dir = files();
    let (est, val, out) = (path(dir.path(), "est.csv"), path(dir.path(), "val.csv"), path(dir.path(), "out"));
    let common = ["fit", "--recording", &est, "--input", "u_V", "--output", "y_mm"];
    let fit = |out: &str, threads: &str| {
        let mut args = common.to_vec();
        args.extend(["--holdout", &val, "--out", out, "--threads", threads, "--json"]);
        let done = hysid(&args);
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        done.stdout
    };
    let printed = fit(&out, "1");
    let summary: serde_json::Value = serde_json::from_slice(&printed).unwrap();
    for key in ["terms", "decimation", "lags", "free_run", "one_step", "diverged_at"] {
        assert!(summary.get(key).is_some(), "{key}");
    }
    assert!(summary["diverged_at"].is_null());
    assert!(summary["free_run"][1]["relative"].as_f64().unwrap() < 1e-3, "{}", summary["free_run"]);
    assert_eq!(summary["free_run"][1]["role"], "holdout");
    for key in ["term", "coefficient", "standard_error", "err"] {
        assert!(summary["terms"][0].get(key).is_some(), "{key}");
    }
    // The same bytes whatever the number of threads.
    let again = path(dir.path(), "again");
    fit(&again, "2");
    for file in ["model.json", "fit.json"] {
        assert_eq!(
            std::fs::read(dir.path().join("out").join(file)).unwrap(),
            std::fs::read(dir.path().join("again").join(file)).unwrap(),
            "{file}"
        );
    }
    let (model, pred) = (format!("{out}/model.json"), path(dir.path(), "pred.csv"));
    for mode in ["free-run", "one-step", "5"] {
        let done = hysid(&["predict", &model, "--recording", &est, "--mode", mode, "--out", &pred]);
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        let text = std::fs::read_to_string(&pred).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!((lines[0], lines.len()), ("t_s,y_mm", 601));
        assert!(lines[1].ends_with(",NaN") && !lines[600].ends_with("NaN"), "{mode}: {} {}", lines[1], lines[600]);
    }
}

#[test]
fn every_decision_can_be_taken_from_it() {
    let dir = files();
    let (est, out) = (path(dir.path(), "est.csv"), path(dir.path(), "out"));
    let fit = |more: &[&str]| -> serde_json::Value {
        let mut args = vec!["fit", "--recording", &est, "--input", "u_V", "--output", "y_mm", "--out", &out, "--json"];
        args.extend(more);
        let done = hysid(&args);
        assert!(done.status.success(), "{more:?}: {}", String::from_utf8_lossy(&done.stderr));
        serde_json::from_slice(&done.stdout).unwrap()
    };
    let degree = |s: &serde_json::Value| {
        let of = |t: &str| {
            t.split('*').map(|f| f.split_once('^').map_or(1, |p| p.1.parse::<usize>().unwrap())).sum::<usize>()
        };
        s["terms"].as_array().unwrap().iter().map(|t| of(t["term"].as_str().unwrap())).max().unwrap()
    };
    let s = fit(&["--degree", "1", "--factors", "polynomial"]);
    assert_eq!(degree(&s), 1, "{}", s["equation"]);
    let s = fit(&["--lags-output", "1", "--lags-input", "2", "--input-delay", "1", "--factors", "polynomial"]);
    assert!(
        s["lags"]["output"] == 1
            && s["lags"]["input"].as_u64() <= Some(2)
            && s["lags"]["input_delay"].as_u64() >= Some(1),
        "{}",
        s["lags"]
    );
    assert_eq!(fit(&["--decimate", "2"])["decimation"], 2);
    assert_eq!(fit(&["--decimate", "none"])["decimation"], 1);
    assert!(fit(&["--terms", "6", "--lags-output", "2", "--lags-input", "1"])["terms"].as_array().unwrap().len() <= 6);
    for criterion in ["press", "bic", "aic", "err:0.01"] {
        let s = fit(&["--criterion", criterion, "--factors", "polynomial", "--lags-output", "2", "--lags-input", "2"]);
        assert!(s["diverged_at"].is_null(), "{criterion}");
        assert!(
            s["decisions"]
                .as_array()
                .unwrap()
                .iter()
                .any(|d| d.as_str().unwrap().contains("one-step regression decided"))
        );
    }
}

#[test]
fn bad_input_ends_with_status_2_one_message_and_no_file() {
    let dir = files();
    let (est, short, empty, out) = (
        path(dir.path(), "est.csv"),
        path(dir.path(), "short.csv"),
        path(dir.path(), "empty.csv"),
        path(dir.path(), "out"),
    );
    let good = ["--recording", &est, "--input", "u_V", "--output", "y_mm"];
    let with = |more: &[&str]| [&good[..], more].concat().into_iter().map(String::from).collect::<Vec<_>>();
    let own = |args: &[&str]| args.iter().map(|s| (*s).to_string()).collect::<Vec<_>>();
    let cases: Vec<(Vec<String>, &str)> = vec![
        (with(&["--degree", "0"]), "--degree is 0"),
        (with(&["--degree", "99"]), "--degree is 99"),
        (with(&["--lags-output", "100000"]), "--lags-output is 100000"),
        (with(&["--lags-input", "100000"]), "--lags-input is 100000"),
        (with(&["--lags-output", "400"]), "samples"),
        (with(&["--input-delay", "2"]), "--input-delay is 2"),
        (with(&["--terms", "0"]), "--terms is 0"),
        (with(&["--terms", "many"]), "auto"),
        (with(&["--decimate", "0"]), "--decimate is 0"),
        (with(&["--decimate", "900"]), "usable sample"),
        (with(&["--decimate", "x"]), "auto, none"),
        (with(&["--criterion", "err:2"]), "between 0 and 1"),
        (with(&["--criterion", "best"]), "press"),
        (with(&["--factors", "magic"]), "polynomial"),
        (with(&["--threads", "0"]), "--threads is 0"),
        (with(&["--input", "u_V"]), "twice"),
        (with(&["--input", "nothing"]), "nothing"),
        (with(&["--holdout", "nowhere.csv"]), "nowhere.csv"),
        (own(&["--recording", &est, "--input", "u_V", "--output", "z"]), "`z`"),
        (own(&["--recording", &est, "--input", "u_V", "--output", "u_V"]), "twice"),
        (own(&["--recording", &est, "--input", "u_V", "--output", "still"]), "still"),
        (own(&["--recording", &est, "--input", "still", "--output", "y_mm"]), "constant"),
        (own(&["--recording", &est, "--input", "late", "--output", "y_mm"]), "samples"),
        (own(&["--recording", &short, "--input", "u_V", "--output", "y_mm"]), "samples"),
        (own(&["--recording", &empty, "--input", "u_V", "--output", "y_mm"]), "empty.csv"),
        (own(&["--recording", "nowhere.csv", "--input", "u_V", "--output", "y_mm"]), "nowhere.csv"),
        (own(&["--recording", &est, "--output", "y_mm"]), "--input"),
    ];
    for (args, part) in cases {
        let all: Vec<&str> =
            ["fit"].into_iter().chain(args.iter().map(String::as_str)).chain(["--out", &out]).collect();
        let done = hysid(&all);
        let said = String::from_utf8_lossy(&done.stderr).into_owned();
        assert_eq!(done.status.code(), Some(2), "{args:?}: {said}");
        assert!(said.contains(part) && said.lines().count() == 1, "{args:?}: {said}");
        assert!(!Path::new(&out).exists(), "{args:?} left files");
    }
    let model = path(dir.path(), "model.json");
    std::fs::write(&model, "{\"format\": \"hysid.model\"}").unwrap();
    let pred = path(dir.path(), "pred.csv");
    for (args, part) in [
        (vec!["predict", model.as_str(), "--recording", est.as_str(), "--out", pred.as_str()], "model.json"),
        (vec!["predict", "nowhere.json", "--recording", est.as_str(), "--out", pred.as_str()], "nowhere.json"),
        (
            vec!["predict", model.as_str(), "--recording", est.as_str(), "--mode", "0", "--out", pred.as_str()],
            "free-run",
        ),
    ] {
        let done = hysid(&args);
        assert_eq!(done.status.code(), Some(2));
        assert!(String::from_utf8_lossy(&done.stderr).contains(part), "{args:?}");
        assert!(!Path::new(&pred).exists());
    }
}
