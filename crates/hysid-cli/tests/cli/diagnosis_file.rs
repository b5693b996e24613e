//! What `hysid diagnose` leaves in its folder: `diagnosis.json` field by field as the contract has it, the same bytes for any number of
//! threads, an augmented simulation only where there is one, and what a time limit does.

use std::path::Path;

use crate::common::{DIAGNOSE, OscillatorFiles, hysid};
use assert_cmd::Command;
use serde_json::Value;

const FAMILIES: [(&str, &[&str]); 26] = [
    ("dry_friction", &["coulomb_friction", "asymmetric_friction", "stribeck_friction", "load_dependent_friction"]),
    ("presliding", &["dahl_friction", "lugre_friction", "elastoplastic_friction"]),
    ("nonlinear_damping", &["quadratic_damping", "power_law_damping", "displacement_dependent_damping"]),
    ("hardening_stiffness", &["cubic_stiffness", "quintic_stiffness", "gap_stop"]),
    ("asymmetric_stiffness", &["quadratic_stiffness", "bilinear_stiffness"]),
    ("clearance", &["spring_clearance"]),
    ("hysteretic_spring", &["bouc_wen", "asymmetric_bouc_wen", "pinching", "degradation"]),
    ("play", &["backlash"]),
    ("actuator_hysteresis", &["preisach", "prandtl_ishlinskii", "asymmetric_hysteresis", "rate_dependent_hysteresis"]),
    ("input_nonlinearity", &["dead_zone", "input_saturation", "input_polynomial"]),
    ("signal_path_lag", &["delay", "actuator_lag", "sensor_lag"]),
    ("time_variation", &["parameter_drift", "dissipation_heating", "abrupt_change"]),
    ("extra_mode", &["unmodelled_mode"]),
    ("bias", &["input_offset", "output_offset"]),
    ("gravity", &["gravity"]),
    ("position_ripple", &["cogging"]),
    ("inertia", &["position_dependent_inertia"]),
    ("linear_memory", &["viscoelastic", "log_creep"]),
    ("sensor_nonlinearity", &["output_saturation", "quantisation", "rectified_output"]),
    ("sensor_drift", &["sensor_drift"]),
    ("electrical", &["back_emf"]),
    ("storage", &["leakage", "overflow"]),
    ("aero_memory", &["stall_lag"]),
    ("external_disturbance", &["periodic_disturbance"]),
    ("numerics", &["solver_artefact"]),
    ("outside", &[]),
];
const VERDICTS: [&str; 5] = ["no_significant_mismatch", "named", "family", "ambiguous", "not_in_catalogue"];
const BLOCKS: [&str; 8] =
    ["input", "restoring", "damping", "hysteresis", "inertia", "output", "time_variation", "disturbance"];

/// Complaints about a value, each with its place.
struct Check {
    wrong: Vec<String>,
}

impl Check {
    fn that(&mut self, holds: bool, place: &str, value: &Value) {
        if !holds {
            self.wrong.push(format!("{place} is {value}"));
        }
    }

    fn number(&mut self, of: &Value, key: &str, place: &str) {
        self.that(of[key].is_number(), &format!("{place}.{key}"), &of[key]);
    }

    fn number_or_null(&mut self, of: &Value, key: &str, place: &str) {
        let there = of.get(key).is_some_and(|v| v.is_number() || v.is_null());
        self.that(there, &format!("{place}.{key}"), &of[key]);
    }

    fn text(&mut self, of: &Value, key: &str, place: &str) {
        self.that(of[key].is_string(), &format!("{place}.{key}"), &of[key]);
    }

    fn probability(&mut self, of: &Value, key: &str, place: &str) {
        let good = of[key].as_f64().is_some_and(|p| (0.0..=1.0).contains(&p));
        self.that(good, &format!("{place}.{key}"), &of[key]);
    }

    fn slot(&mut self, of: &Value, place: &str) {
        let slot = of["slot"].as_str().unwrap_or_default();
        let good = slot == "disturbance"
            || ["input:", "state:", "output:", "parameter:"]
                .iter()
                .any(|p| slot.starts_with(p) && slot.len() > p.len());
        self.that(good, &format!("{place}.slot"), &of["slot"]);
    }

    fn mechanism(&mut self, of: &Value, place: &str) {
        let id = of["mechanism"].as_str().unwrap_or_default();
        let family = FAMILIES.iter().find(|f| f.1.contains(&id)).map(|f| f.0);
        self.that(family.is_some(), &format!("{place}.mechanism"), &of["mechanism"]);
        self.that(of.get("family").is_none_or(|f| f.as_str() == family), &format!("{place}.family"), &of["family"]);
    }

    fn list<'v>(&mut self, of: &'v Value, key: &str) -> &'v [Value] {
        self.that(of[key].is_array(), key, &of[key]);
        of[key].as_array().map_or(&[], Vec::as_slice)
    }

    fn parameters(&mut self, of: &Value, key: &str, place: &str) {
        let list = self.list(of, key).to_vec();
        for p in &list {
            let place = format!("{place}.{key}");
            self.text(p, "name", &place);
            self.text(p, "unit", &place);
            self.number(p, "value", &place);
            self.number_or_null(p, "low", &place);
            self.number_or_null(p, "high", &place);
            if let (Some(l), Some(v), Some(h)) = (p["low"].as_f64(), p["value"].as_f64(), p["high"].as_f64()) {
                self.that(l <= v && v <= h, &place, p);
            }
        }
    }

    fn pairs(&mut self, of: &Value, key: &str) {
        for pair in self.list(of, key).to_vec() {
            let (low, high) = (pair[0].as_f64(), pair[1].as_f64());
            let good = pair.as_array().is_some_and(|p| p.len() == 2) && low.zip(high).is_some_and(|(a, b)| a <= b);
            self.that(good, key, &pair);
        }
    }
}

/// Everything that the contract says of `diagnosis.json`.
fn complaints(d: &Value, outputs: &[&str], recordings: usize) -> Vec<String> {
    let mut c = Check { wrong: Vec::new() };
    c.that(d["schema"] == "hysid.diagnosis/1", "schema", &d["schema"]);
    let verdict = d["verdict"].as_str().unwrap_or_default();
    c.that(VERDICTS.contains(&verdict), "verdict", &d["verdict"]);
    let mismatch = &d["mismatch"];
    c.probability(mismatch, "p_value", "mismatch");
    for key in ["residual_rms", "noise_rms"] {
        for o in outputs {
            c.number(&mismatch[key], o, key);
        }
    }
    for x in c.list(mismatch, "detectable").to_vec() {
        c.mechanism(&x, "detectable");
        c.slot(&x, "detectable");
        c.number(&x, "smallest", "detectable");
        c.text(&x, "unit", "detectable");
    }
    let location = &d["location"];
    if verdict == "no_significant_mismatch" {
        c.that(d["effects"] == Value::Array(vec![]), "effects", &d["effects"]);
    } else {
        c.slot(location, "location");
        c.that(BLOCKS.contains(&location["block"].as_str().unwrap_or_default()), "location.block", &location["block"]);
        c.pairs(location, "time_s");
        c.pairs(location, "band_hz");
        c.text(location, "region", "location");
    }
    for e in c.list(d, "effects").to_vec() {
        c.mechanism(&e, "effects");
        c.slot(&e, "effects");
        c.probability(&e, "probability", "effects");
        c.probability(&e, "concealment", "effects");
        c.text(&e, "sentence", "effects");
        c.parameters(&e, "parameters", "effects");
    }
    for a in c.list(d, "alternatives").to_vec() {
        c.mechanism(&a, "alternatives");
        c.slot(&a, "alternatives");
        c.probability(&a, "probability", "alternatives");
    }
    let fit = c.list(d, "fit").to_vec();
    c.that(fit.len() == recordings * outputs.len(), "fit", &d["fit"]);
    for f in &fit {
        c.text(f, "recording", "fit");
        c.that(outputs.contains(&f["output"].as_str().unwrap_or_default()), "fit.output", &f["output"]);
        for key in ["rmse_before", "rmse_after", "ratio", "ratio_low", "ratio_high", "rmse_black_box"] {
            c.number_or_null(f, key, "fit");
        }
    }
    if !d["remaining"].is_null() {
        c.probability(&d["remaining"], "p_value", "remaining");
        c.probability(&d["remaining"], "share", "remaining");
    }
    for key in ["remaining", "correction", "experiment"] {
        c.that(d.get(key).is_some(), key, &Value::Null);
    }
    if verdict == "not_in_catalogue" {
        c.that(d["correction"]["terms"].is_array(), "correction.terms", &d["correction"]);
        for key in ["memory", "rate_dependent", "symmetry", "side"] {
            c.that(d["correction"]["signature"].get(key).is_some(), key, &d["correction"]["signature"]);
        }
    }
    c.parameters(d, "calibrated_parameters", "");
    c.that(d["seed"].is_u64(), "seed", &d["seed"]);
    c.wrong
}

fn json(dir: &Path) -> Value {
    serde_json::from_str(&std::fs::read_to_string(dir.join("out/diagnosis.json")).unwrap()).unwrap()
}

fn diagnosed(files: &OscillatorFiles, line: &[&str]) -> (Value, String) {
    let (status, _, stderr) = hysid(line, files.path());
    assert_eq!(status, 0, "{stderr}");
    (json(files.path()), stderr)
}

fn hardening() -> OscillatorFiles {
    OscillatorFiles::with_force(500, |x, _| 2500.0 * x * x * x)
}

#[test]
fn a_named_effect_is_written_as_the_contract_says() {
    let files = hardening();
    let (d, stderr) = diagnosed(&files, &DIAGNOSE);
    assert_eq!(complaints(&d, &["x_m"], 1), Vec::<String>::new());
    assert_eq!(d["effects"][0]["family"], "hardening_stiffness", "{d:#}");
    assert_eq!(d["effects"][0]["slot"], "state:v");
    assert_eq!(d["location"]["block"], "restoring");
    // Progress, one line for each step.
    assert!(stderr.lines().count() >= 6 && stderr.lines().all(|l| l.starts_with("hysid: ") && l.ends_with(" ...")));
    // What is written is a simulation, and the next diagnosis accepts it; nothing is left to find, so no simulation is written then,
    // and the one of the first run does not stay.
    let line = ["simulate", "out/augmented.sim.toml", "--input", "val.csv", "--out", "again.csv"];
    assert_eq!(hysid(&line, files.path()).0, 0);
    std::fs::rename(files.path().join("out/augmented.sim.toml"), files.path().join("base.sim.toml")).unwrap();
    std::fs::write(files.path().join("out/augmented.sim.toml"), "stale").unwrap();
    let (again, _) = diagnosed(&files, &DIAGNOSE);
    assert_eq!(again["verdict"], "no_significant_mismatch", "{again:#}");
    assert!(!files.path().join("out/augmented.sim.toml").exists());
    // The black box is no better than the simulation with the effect, and near it: both see the same data.
    let fit = &d["fit"][0];
    let (after, black) = (fit["rmse_after"].as_f64().unwrap(), fit["rmse_black_box"].as_f64().unwrap());
    assert!(black > 0.8 * after && black < fit["rmse_before"].as_f64().unwrap(), "{fit}");
    let page = std::fs::read_to_string(files.path().join("out/report.html")).unwrap();
    assert!(page.contains("black box") && !page.contains("src=\"http") && !page.contains("<link"));
}

#[test]
fn no_mismatch_is_written_as_the_contract_says() {
    let files = OscillatorFiles::write(500);
    let (d, _) = diagnosed(&files, &DIAGNOSE);
    assert_eq!(complaints(&d, &["x_m"], 1), Vec::<String>::new());
    assert_eq!(d["verdict"], "no_significant_mismatch");
    assert!(d["mismatch"]["detectable"].as_array().unwrap().len() > 10);
    assert!(d["fit"][0]["rmse_black_box"].is_number(), "{}", d["fit"]);
}

#[test]
fn without_a_holdout_blocks_are_scored_and_told() {
    let files = hardening();
    let (d, _) = diagnosed(&files, &["diagnose", "base.sim.toml", "--recording", "est.csv", "--out", "out"]);
    assert_eq!(complaints(&d, &["x_m"], 1), Vec::<String>::new());
    assert_eq!(d["fit"][0]["recording"], "est.csv: held-out blocks");
    assert!(
        d["notes"].as_array().unwrap().iter().any(|n| n.as_str().unwrap().contains("no hold-out recording was given"))
    );
    assert!(d["fit"][0]["ratio"].as_f64().unwrap() < 0.6 && d["fit"][0]["rmse_black_box"].is_number(), "{}", d["fit"]);
}

#[test]
fn the_same_bytes_for_any_number_of_threads() {
    let files = hardening();
    let mut all: Vec<Vec<u8>> = Vec::new();
    for (flag, variable) in
        [(Some("1"), None), (None, Some("1")), (None, Some("2")), (None, Some("4")), (Some("3"), None)]
    {
        let mut command = Command::cargo_bin("hysid").unwrap();
        command.current_dir(files.path()).args(DIAGNOSE).env_remove("RAYON_NUM_THREADS");
        command.args(flag.iter().flat_map(|n| ["--threads", n])).envs(variable.map(|n| ("RAYON_NUM_THREADS", n)));
        command.assert().success();
        all.push(std::fs::read(files.path().join("out/diagnosis.json")).unwrap());
    }
    assert!(all.iter().all(|bytes| *bytes == all[0]));
    // Another seed is another run.
    let (d, _) = diagnosed(&files, &[&DIAGNOSE[..], &["--seed", "2"]].concat());
    assert_eq!(d["seed"], 2);
}

#[test]
fn the_black_box_can_be_left_out() {
    let files = hardening();
    let (with, _) = diagnosed(&files, &DIAGNOSE);
    let (without, stderr) = diagnosed(&files, &[&DIAGNOSE[..], &["--no-black-box"]].concat());
    assert!(!stderr.contains("black box"), "{stderr}");
    assert!(with["fit"][0]["rmse_black_box"].is_number() && without["fit"][0]["rmse_black_box"].is_null());
    assert_eq!((&with["effects"], &with["notes"]), (&without["effects"], &without["notes"]));
    let page = std::fs::read_to_string(files.path().join("out/report.html")).unwrap();
    assert!(!page.contains("black box"));
}

#[test]
fn a_time_limit_leaves_out_steps_and_says_so() {
    let files = hardening();
    let (d, _) = diagnosed(&files, &[&DIAGNOSE[..], &["--time-limit", "0.001"]].concat());
    assert_eq!(complaints(&d, &["x_m"], 1), Vec::<String>::new());
    assert_ne!(d["verdict"], "no_significant_mismatch");
    let notes = d["notes"].to_string();
    assert!(notes.contains("the time limit left out") && notes.contains("no time for a black box"), "{notes}");
    assert!(d["verdict"] == "ambiguous", "{}: nothing is firm where the search was cut short", d["verdict"]);
    assert!(d["fit"][0]["rmse_before"].is_number() && d["fit"][0]["rmse_black_box"].is_null(), "{}", d["fit"]);
    let (d, _) = diagnosed(&files, &[&DIAGNOSE[..], &["--time-limit", "600"]].concat());
    assert!(!d["notes"].to_string().contains("time limit"), "{}", d["notes"]);
}
