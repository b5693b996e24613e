//! What the tests of `hysid diagnose` share: good files of an oscillator, and the program itself.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use assert_cmd::Command;
use tempfile::TempDir;

#[path = "../../../../hysid-diagnose/tests/diagnose/oscillator.rs"]
pub mod oscillator;

use oscillator::{BASELINE, PERIOD, REAL, drive, normal, respond, rms};

/// The part of a command line of `hysid diagnose` that names the recordings and the output folder, as every test calls them.
pub const FILES: [&str; 6] = ["--recording", "est.csv", "--holdout", "val.csv", "--out", "out"];

/// A command line that ends with [`FILES`].
pub const fn with_files<const HEAD: usize, const ALL: usize>(head: [&'static str; HEAD]) -> [&'static str; ALL] {
    assert!(ALL == HEAD + FILES.len());
    let mut line = [""; ALL];
    let mut i = 0;
    while i < ALL {
        line[i] = if i < HEAD { head[i] } else { FILES[i - HEAD] };
        i += 1;
    }
    line
}

/// The diagnosis of the good files of [`OscillatorFiles`].
pub const DIAGNOSE: [&str; 8] = with_files(["diagnose", "base.sim.toml"]);

/// Runs the program; returns status, stdout and stderr.
pub fn hysid(args: &[&str], dir: &Path) -> (i32, String, String) {
    let output =
        Command::cargo_bin("hysid").unwrap().current_dir(dir).env("RUST_BACKTRACE", "0").args(args).output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code().unwrap_or(-1), text(&output.stdout), text(&output.stderr))
}

/// The folder beside the repository in which the recordings lie; `None` where there are none and none are required.
pub fn shared() -> Option<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared");
    if !root.join("recordings").is_dir() {
        assert!(std::env::var_os("HYSID_REQUIRE_RECORDINGS").is_none(), "the recordings are needed but not there");
        println!("skipped: no recordings");
        return None;
    }
    Some(root)
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

fn recording(samples: usize, seed: u64, force: &impl Fn(f64, f64) -> f64) -> String {
    let u = drive(samples, &mut normal(seed));
    let real = respond(&u, REAL, force);
    let simulated = respond(&u, (1.2, 0.7, 130.0), |_, _| 0.0);
    let noise = 0.02 * rms(&real);
    let mut random = normal(seed + 100);
    let mut text = String::from("t_s,u_N,x_m,s_m\n");
    for i in 0..samples {
        let measured = real[i] + noise * random();
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
