//! Column mode from end to end: the user's simulator is known by the column that it wrote. Truth and simulator are simulated here, the
//! tool sees their columns only.

use crate::common::oscillator::{normal, rms};
use crate::common::{hysid, with_files};
use hysid_plant::{Compiled, Drive, Run, Simulation, Start};
use serde_json::Value;
use tempfile::TempDir;

/// Samples of each recording.
const SAMPLES: usize = 1000;
const PERIOD: f64 = 0.02;

/// The user's simulator and the truth, as equations of `u`; the output is called `y`.
struct Case {
    simulator: &'static str,
    truth: &'static str,
    /// Noise on the recording, as a share of the true output's rms.
    noise: f64,
    /// Peak of the input.
    level: f64,
}

const OSCILLATOR: &str = r#"
[parameters]
g = { value = 4.0, fixed = true }
w = { value = 9.0, fixed = true }
z = { value = 0.08, fixed = true }
[states]
x = { derivative = "v", initial = 0.0 }
v = { derivative = "g*u - w^2*x - 2*z*w*v", initial = 0.0 }
[outputs]
y_mm = "x"
"#;

/// What these equations say of this input.
fn simulate(equations: &str, u: &[f64]) -> Vec<f64> {
    let text = format!("[time]\nperiod_s = {PERIOD}\n[inputs]\nu = \"u_V\"\n{equations}");
    let simulation = Simulation::parse(&text, "truth").unwrap();
    let compiled = Compiled::new(&simulation).unwrap();
    let drive = Drive::new(0.0, PERIOD, u.len(), vec![u.to_vec()]).unwrap();
    let theta = compiled.theta();
    let start = compiled.start_states(&theta);
    let run = Run::new(&drive, &theta).from(Start::States(&start)).with_substeps(16);
    compiled.simulate(&run).outputs.swap_remove(0)
}

/// Sines from slow to well above the resonance, the amplitude rising and falling.
fn input(seed: u64, level: f64) -> Vec<f64> {
    let mut random = normal(seed);
    let phases: Vec<f64> = (0..30).map(|_| 3.0 * random()).collect();
    (0..SAMPLES)
        .map(|n| {
            let t = n as f64 * PERIOD;
            let envelope = 0.55 + 0.45 * (0.4 * t).sin();
            let sum: f64 = phases.iter().enumerate().map(|(j, p)| (0.5 * (j + 1) as f64 * t + p).cos()).sum();
            level * envelope * sum / 8.0
        })
        .collect()
}

impl Case {
    fn write(&self) -> TempDir {
        let dir = tempfile::tempdir().unwrap();
        for (file, seed) in [("est.csv", 1), ("val.csv", 2)] {
            let u = input(seed, self.level);
            let (truth, simulated) = (simulate(self.truth, &u), simulate(self.simulator, &u));
            let noise = self.noise * rms(&truth);
            let mut random = normal(seed + 50);
            let mut text = String::from("t_s,u_V,y_mm,sim_mm\n");
            for n in 0..SAMPLES {
                let measured = truth[n] + noise * random();
                text += &format!("{:.2},{:.8e},{measured:.8e},{:.8e}\n", n as f64 * PERIOD, u[n], simulated[n]);
            }
            std::fs::write(dir.path().join(file), text).unwrap();
        }
        dir
    }

    fn diagnosed(&self) -> Value {
        let dir = self.write();
        let line: [&str; 13] = with_files(["diagnose", "--simulated", "sim_mm", "--input", "u_V", "--output", "y_mm"]);
        let (status, _, stderr) = hysid(&line, dir.path());
        assert_eq!(status, 0, "{stderr}");
        let text = std::fs::read_to_string(dir.path().join("out/diagnosis.json")).unwrap();
        let value: Value = serde_json::from_str(&text).unwrap();
        // What is written can be used again.
        if dir.path().join("out/augmented.sim.toml").exists() {
            let line = ["simulate", "out/augmented.sim.toml", "--input", "val.csv", "--out", "again.csv"];
            assert_eq!(hysid(&line, dir.path()).0, 0);
        }
        value
    }
}

fn family(d: &Value) -> &str {
    d["effects"][0]["family"].as_str().unwrap_or("none")
}

fn ratio(d: &Value) -> f64 {
    d["fit"][0]["ratio"].as_f64().unwrap()
}

#[test]
fn a_spring_that_hardens_is_found_in_the_clone() {
    let truth = "[parameters]\ng = { value = 4.0, fixed = true }\n[states]\nx = { derivative = \"v\", initial = 0.0 }\nv = { derivative = \"g*u - 81*x - 1.44*v - 4000*x^3\", initial = 0.0 }\n[outputs]\ny_mm = \"x\"\n";
    let d = Case { simulator: OSCILLATOR, truth, noise: 0.01, level: 2.0 }.diagnosed();
    assert!(matches!(d["verdict"].as_str(), Some("named" | "family")), "{d:#}");
    assert_eq!(family(&d), "hardening_stiffness");
    assert!(ratio(&d) < 0.5, "{d:#}");
}

/// An oscillator with another gain, stiffness and damping than the simulator's.
const OTHER_PARAMETERS: &str = "[parameters]\ng = { value = 4.6, fixed = true }\n[states]\nx = { derivative = \"v\", initial = 0.0 }\nv = { derivative = \"g*u - 100*x - 2.2*v\", initial = 0.0 }\n[outputs]\ny_mm = \"x\"\n";

#[test]
fn wrong_parameters_are_no_missing_physics() {
    let d = Case { simulator: OSCILLATOR, truth: OTHER_PARAMETERS, noise: 0.01, level: 2.0 }.diagnosed();
    assert_eq!(d["verdict"], "no_significant_mismatch", "{d:#}");
    let summary = d["summary"].as_str().unwrap();
    assert!(summary.contains("frequency 9 -> 10") && summary.contains("parameter error"), "{summary}");
    // The error before is that of the recalibrated clone: the noise.
    let before = d["fit"][0]["rmse_before"].as_f64().unwrap();
    let noise = d["mismatch"]["noise_rms"]["y_mm"].as_f64().unwrap();
    assert!(before < 1.3 * noise, "{before} {noise}");
}

/// Where noise hides nearly all of the output, what the recalibrated clone leaves may be anything.
#[test]
fn parameters_do_not_account_for_what_no_simulation_explains() {
    let d = Case { simulator: OSCILLATOR, truth: OTHER_PARAMETERS, noise: 1.5, level: 2.0 }.diagnosed();
    assert_eq!(d["verdict"], "no_significant_mismatch", "{d:#}");
    let summary = d["summary"].as_str().unwrap();
    assert!(summary.contains("next to nothing") && summary.contains("frequency 9 ->"), "{summary}");
    assert!(!summary.contains("no missing physics"), "{summary}");
}

#[test]
fn a_sensor_that_saturates_is_found_at_the_output() {
    let truth = OSCILLATOR.replace("y_mm = \"x\"", "y_mm = \"max(-0.07, min(0.07, x))\"");
    let d = Case { simulator: OSCILLATOR, truth: truth.leak(), noise: 0.01, level: 2.0 }.diagnosed();
    assert!(matches!(d["verdict"].as_str(), Some("named" | "family")), "{d:#}");
    assert_eq!(family(&d), "sensor_nonlinearity");
    assert!(ratio(&d) < 0.5, "{d:#}");
}

#[test]
fn nothing_is_missing_where_only_noise_is_between() {
    let d = Case { simulator: OSCILLATOR, truth: OSCILLATOR, noise: 0.02, level: 2.0 }.diagnosed();
    assert_eq!(d["verdict"], "no_significant_mismatch", "{d:#}");
    assert!(!d["mismatch"]["detectable"].as_array().unwrap().is_empty());
    assert!(!d["summary"].as_str().unwrap().contains("parameter error"), "{d:#}");
}

#[test]
fn an_axis_that_integrates_and_starts_elsewhere_is_cloned_too() {
    let simulator = "[parameters]\ng = { value = 20.0, fixed = true }\n[states]\nx = { derivative = \"v\", initial = 0.0 }\nv = { derivative = \"g*u - 3*v\", initial = 0.0 }\n[outputs]\ny_mm = \"x + 50\"\n";
    let truth = "[parameters]\ng = { value = 20.0, fixed = true }\n[states]\nx = { derivative = \"v\", initial = 0.0 }\nv = { derivative = \"g*u - 3*v - 8*sign(v)\", initial = 0.0 }\n[outputs]\ny_mm = \"x + 50\"\n";
    let d = Case { simulator, truth, noise: 1e-4, level: 2.0 }.diagnosed();
    assert!(matches!(d["verdict"].as_str(), Some("named" | "family")), "{d:#}");
    assert_eq!(family(&d), "dry_friction");
    assert!(ratio(&d) < 0.5, "{d:#}");
}

#[test]
fn where_no_clone_follows_a_saturating_sensor_is_still_found() {
    let simulator = OSCILLATOR.replace("- w^2*x", "- w^2*x - 9000*x^3");
    let truth = simulator.replace("y_mm = \"x\"", "y_mm = \"max(-0.05, min(0.05, x))\"");
    let d = Case { simulator: simulator.leak(), truth: truth.leak(), noise: 0.01, level: 4.0 }.diagnosed();
    assert!(d["notes"][0].as_str().unwrap().contains("no linear clone"), "{d:#}");
    assert!(matches!(d["verdict"].as_str(), Some("named" | "family" | "ambiguous")), "{d:#}");
    assert!(["sensor_nonlinearity", "input_nonlinearity"].contains(&family(&d)), "{d:#}");
    assert!(ratio(&d) < 0.5, "{d:#}");
}

#[test]
fn backlash_behind_a_static_gain_is_found() {
    let simulator = "[parameters]\ng = { value = 0.5, fixed = true }\n[outputs]\ny_mm = \"g*u\"\n";
    let truth = "[parameters]\ng = { value = 0.5, fixed = true }\n[outputs]\ny_mm = \"g*play(u, 0.15)\"\n";
    let d = Case { simulator, truth, noise: 0.01, level: 2.0 }.diagnosed();
    assert_ne!(d["verdict"], "no_significant_mismatch", "{d:#}");
    assert!(["play", "actuator_hysteresis"].contains(&family(&d)), "{d:#}");
    assert!(ratio(&d) < 0.5, "{d:#}");
}
