//! Real recordings diagnosed as a user would: what each one is known for is told, and a recording that was not used bears it out.
//!
//! These two take seconds; `cargo xtask recordings --diagnosis` has the others. The bounds are loose: they catch a law that is lost, not a digit.

use std::path::{Path, PathBuf};

use crate::common::{hysid, shared};
use serde_json::Value;

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// The diagnosis of a baseline simulation from these files, against another.
fn diagnosed(root: &Path, simulation: &str, estimation: &[PathBuf], holdout: &Path) -> Value {
    let dir = tempfile::tempdir().unwrap();
    let (simulation, out) = (root.join("simulations").join(simulation), dir.path().join("out"));
    let mut args = vec!["diagnose", text(&simulation)];
    estimation.iter().for_each(|file| args.extend(["--recording", text(file)]));
    args.extend(["--holdout", text(holdout), "--out", text(&out), "--threads", "2", "--no-black-box"]);
    let (status, _, stderr) = hysid(&args, Path::new("."));
    assert_eq!(status, 0, "{stderr}");
    serde_json::from_str(&std::fs::read_to_string(out.join("diagnosis.json")).unwrap()).unwrap()
}

/// Asserts that a mechanism is told and that less than this share of the error is left on the hold-out.
fn tells(found: &Value, mechanism: &str, share: f64) {
    let told: Vec<&Value> = found["effects"].as_array().unwrap().iter().map(|e| &e["mechanism"]).collect();
    let ratio = found["fit"][0]["ratio"].as_f64().unwrap_or(1.0);
    assert!(told.iter().any(|m| *m == mechanism) && ratio < share, "{told:?} {ratio}: {}", found["summary"]);
}

#[test]
fn the_stall_of_an_aerofoil_lags() {
    let Some(root) = shared() else { return };
    let file = |name: &str| root.join("recordings/osu_s809_dynamic_stall").join(name);
    let estimation = ["C5l100_08.csv", "C10h100_14.csv"].map(file);
    let found = diagnosed(&root, "osu_s809_dynamic_stall.sim.toml", &estimation, &file("C5m100_14.csv"));
    tells(&found, "stall_lag", 0.5);
}

#[test]
fn a_wall_that_rocks_opens_at_its_foot() {
    let Some(root) = shared() else { return };
    let text = std::fs::read_to_string(root.join("recordings/rocking_wall_ts1/ts1.csv")).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    let dir = tempfile::tempdir().unwrap();
    let part = |name: &str, rows: &[&str]| {
        let path = dir.path().join(name);
        std::fs::write(&path, format!("{}\n{}\n", lines[0], rows.join("\n"))).unwrap();
        path
    };
    let (first, second) = lines[1..].split_at(640);
    let found = diagnosed(&root, "rocking_wall_ts1.sim.toml", &[part("first.csv", first)], &part("second.csv", second));
    tells(&found, "gap_stop", 0.4);
}
