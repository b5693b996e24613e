//! What the tests of `hysid diagnose` share: good files of an oscillator, and the program itself.

// Each test file uses its own part of this.
#![allow(dead_code)]

use std::collections::BTreeMap;
use std::path::Path;

use assert_cmd::Command;
use tempfile::TempDir;

/// A simulation of the oscillator with parameters that are somewhat wrong.
pub const BASELINE: &str = r#"
title = "Oscillator"
[time]
column = "t_s"
[inputs]
u = "u_N"
[parameters]
m = { value = 1.2, min = 0.2, max = 5.0, unit = "kg" }
c = { value = 0.7, min = 0.0, max = 20.0, unit = "N s/m" }
k = { value = 130.0, min = 10.0, max = 1000.0, unit = "N/m" }
[states]
x = { derivative = "v", initial = 0.0, unit = "m" }
v = { derivative = "(u - c*v - k*x)/m", initial = 0.0, unit = "m/s" }
[outputs]
x_m = "x"
"#;

/// Runs the program; returns status, stdout and stderr.
pub fn hysid(args: &[&str], dir: &Path) -> (i32, String, String) {
    let output =
        Command::cargo_bin("hysid").unwrap().current_dir(dir).env("RUST_BACKTRACE", "0").args(args).output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code().unwrap_or(-1), text(&output.stdout), text(&output.stderr))
}

/// All files below a folder (and the folders themselves), with their contents.
pub fn files_of(dir: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut out = BTreeMap::new();
    for entry in std::fs::read_dir(dir).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            out.insert(format!("{}/", path.display()), Vec::new());
            out.extend(files_of(&path));
        } else {
            out.insert(path.display().to_string(), std::fs::read(&path).unwrap());
        }
    }
    out
}

/// A linear congruential stream of roughly normal numbers.
pub fn normal(seed: u64) -> impl FnMut() -> f64 {
    let mut s = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    move || {
        (0..12)
            .map(|_| {
                s = s.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (s >> 11) as f64 / (1u64 << 53) as f64 - 0.5
            })
            .sum()
    }
}

/// A folder with `base.sim.toml`, `est.csv` and `val.csv`, columns `t_s,u_N,x_m,s_m`: an oscillator with a little noise, and what a
/// simulator with the parameters of the file says.
pub struct OscillatorFiles(TempDir);

impl OscillatorFiles {
    /// Nothing is missing in the simulation but its parameters' values.
    pub fn write(samples: usize) -> Self {
        Self::with_force(samples, |_, _| 0.0)
    }

    /// The real oscillator has a force (of displacement and velocity) that the simulation has not.
    pub fn with_force(samples: usize, force: impl Fn(f64, f64) -> f64) -> Self {
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join("base.sim.toml"), BASELINE).unwrap();
        for (file, seed) in [("est.csv", 1), ("val.csv", 2)] {
            std::fs::write(dir.path().join(file), recording(samples, seed, &force)).unwrap();
        }
        Self(dir)
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        self.0.path()
    }
}

/// The period of the recordings.
const PERIOD: f64 = 0.025;

/// Many sines, loud and quiet by turns.
pub fn drive(samples: usize, seed: u64) -> Vec<f64> {
    let mut random = normal(seed);
    let phases: Vec<f64> = (0..40).map(|_| 3.0 * random()).collect();
    (0..samples)
        .map(|i| {
            let t = i as f64 * PERIOD;
            let level = if (t / 6.0) as usize % 2 == 0 { 2.0 } else { 1.0 };
            level * phases.iter().enumerate().map(|(j, p)| (0.6 * (j + 1) as f64 * t + p).cos()).sum::<f64>()
        })
        .collect()
}

fn recording(samples: usize, seed: u64, force: &impl Fn(f64, f64) -> f64) -> String {
    let u = drive(samples, seed);
    let respond = |m: f64, c: f64, k: f64, force: &dyn Fn(f64, f64) -> f64| -> Vec<f64> {
        let (mut x, mut v) = (0.0, 0.0);
        (0..samples)
            .map(|i| {
                let here = x;
                let (a, b) = (u[i], u[(i + 1).min(samples - 1)]);
                for s in 0..40 {
                    let f = a + (b - a) * f64::from(s) / 40.0;
                    v += PERIOD / 40.0 * (f - c * v - k * x - force(x, v)) / m;
                    x += PERIOD / 40.0 * v;
                }
                here
            })
            .collect()
    };
    let real = respond(1.0, 0.9, 158.0, force);
    let simulated = respond(1.2, 0.7, 130.0, &|_, _| 0.0);
    let rms = (real.iter().map(|y| y * y).sum::<f64>() / samples.max(1) as f64).sqrt();
    let mut random = normal(seed + 100);
    let mut text = String::from("t_s,u_N,x_m,s_m\n");
    for i in 0..samples {
        let measured = real[i] + 0.02 * rms * random();
        text += &format!(
            "{},{:.9e},{:.9e},{:.9e}\n",
            (i as f64 * PERIOD * 1e6).round() / 1e6,
            u[i],
            measured,
            simulated[i]
        );
    }
    text
}
