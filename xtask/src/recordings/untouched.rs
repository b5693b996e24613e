//! `cargo xtask recordings --untouched`: data that nobody had looked at while the recipe was made.
//!
//! Made-up recordings of several operators with seeds that were used for nothing else, without noise and with noise 40 dB
//! below the output, each run on two fresh inputs; and real recordings of the sets that no fit had seen. The list was written
//! before its first run, and the table is what that run printed.

use std::path::Path;

use hysid_hysteresis::catalogue;
use hysid_signal::{Channel, Clock, Excitation, Recording, autoregressive_noise, variance_for_snr};

use super::sets::{ALL, Set, Validation};
use super::{Line, Scores, line, one, timed};

const SEED: u64 = 731_551_001;
const PERIOD_S: f64 = 0.01;
const SAMPLES: usize = 3000;
const SNR_DB: f64 = 40.0;

/// An operator with the parameters that differ from its defaults, and the amplitude and offset of its input.
struct System {
    set: &'static str,
    operator: &'static str,
    parameters: &'static [(&'static str, &'static str)],
    amplitude: f64,
    offset: f64,
}

const fn system(
    set: &'static str,
    operator: &'static str,
    parameters: &'static [(&'static str, &'static str)],
    amplitude: f64,
    offset: f64,
) -> System {
    System { set, operator, parameters, amplitude, offset }
}

const SYSTEMS: [System; 8] = [
    system("bouc-wen", "bouc-wen", &[("direct", "1.6")], 2.0, 0.0),
    system("preisach, Gaussian", "preisach", &[("form", "smooth"), ("density", "gaussian")], 0.9, 0.0),
    system("preisach, uniform, demagnetised", "preisach", &[("start", "demagnetised")], 0.9, 0.0),
    system("prandtl-ishlinskii", "prandtl-ishlinskii", &[], 1.0, 0.0),
    system("maxwell-slip", "maxwell-slip", &[], 1.0, 0.0),
    system("duhem", "duhem", &[], 1.0, 0.0),
    system("dahl", "dahl", &[], 1.0, 0.0),
    system("goman-khrabrov", "goman-khrabrov", &[], 0.35, 0.45),
];

/// Sets whose files, or whose output, no fit had seen.
static SETS: [Set; 4] = [
    Set {
        name: "osu_s809, Re 0.75e6",
        estimation: &[
            "C5l75_20.csv",
            "C5l75_14.csv",
            "C5l75_08.csv",
            "C5h75_20.csv",
            "C5h75_14.csv",
            "C5h75_08.csv",
            "C10l75_20.csv",
            "C10l75_14.csv",
            "C10l75_08.csv",
            "C10h75_20.csv",
            "C10h75_14.csv",
            "C10h75_08.csv",
        ],
        validation: &[of(
            "medium frequency",
            &["C5m75_20.csv", "C5m75_14.csv", "C5m75_08.csv", "C10m75_20.csv", "C10m75_14.csv", "C10m75_08.csv"],
        )],
        ..WING
    },
    Set {
        name: "osu_s809, Re 1.25e6",
        estimation: &[
            "C5l125_20.csv",
            "C5l125_14.csv",
            "C5l125_08.csv",
            "C5h125_20.csv",
            "C5h125_14.csv",
            "C5h125_08.csv",
            "C10l125_20.csv",
            "C10l125_14.csv",
            "C10l125_08.csv",
            "C10h125_20.csv",
            "C10h125_14.csv",
            "C10h125_08.csv",
        ],
        validation: &[of(
            "medium frequency",
            &["C5m125_20.csv", "C5m125_14.csv", "C5m125_08.csv", "C10m125_20.csv", "C10m125_14.csv", "C10m125_08.csv"],
        )],
        ..WING
    },
    Set {
        name: "silverbox",
        inputs: &["u_V"],
        output: "y_V",
        estimation: &["silverbox_estimation_multisine.csv"],
        validation: &[of("Schroeder multisine", &["silverbox_schroeder_period.csv"])],
        start: 50,
        scale: 1e3,
        unit: "mV",
        ..WING
    },
    Set {
        name: "piezo_fine_steering_mirror",
        inputs: &["u1_V", "u2_V", "u3_V"],
        output: "y2_um",
        estimation: &[
            "fsm_300mV_estimation_r0.csv",
            "fsm_300mV_estimation_r1.csv",
            "fsm_300mV_estimation_r2.csv",
            "fsm_100mV_estimation_r0.csv",
        ],
        validation: &[
            of("y2, 300 mV", &["fsm_300mV_validation_r0.csv"]),
            of("y2, 100 mV", &["fsm_100mV_validation_r0.csv"]),
        ],
        unit: "um",
        ..WING
    },
];

const WING: Set = Set {
    name: "",
    inputs: &["alpha_deg"],
    output: "CN",
    estimation: &[],
    estimation_share: ALL,
    validation: &[],
    start: 0,
    scale: 1.0,
    unit: "",
};

const fn of(name: &'static str, files: &'static [&'static str]) -> Validation {
    Validation { name, files, share: ALL, target: None, published: "/none" }
}

/// All lines; the real sets only where the folder is there.
pub(super) fn lines(dir: &Path) -> anyhow::Result<Vec<Line>> {
    let mut lines = Vec::new();
    let mut keep = |new: Vec<Line>| {
        new.iter().for_each(|l| println!("{}", super::page::row(l)));
        lines.extend(new);
    };
    for (i, system) in SYSTEMS.iter().enumerate() {
        for noise in [Noise::None, Noise::White] {
            keep(made_up(system, noise, SEED + 10 * i as u64)?);
        }
    }
    for set in SETS.iter() {
        let folder = if set.output == "CN" { "osu_s809_dynamic_stall" } else { set.name };
        if dir.join(folder).is_dir() {
            keep(one(dir, folder, set)?);
        }
    }
    Ok(lines)
}

/// Whether the recording that teaches carries noise.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Noise {
    None,
    White,
}

fn made_up(system: &System, noise: Noise, seed: u64) -> anyhow::Result<Vec<Line>> {
    let entry = catalogue::find(system.operator).ok_or_else(|| anyhow::anyhow!("no operator {}", system.operator))?;
    let set: Vec<(String, String)> =
        system.parameters.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())).collect();
    let operator = entry.build(&set, PERIOD_S)?;
    let multisine = Excitation::Multisine { lowest_hz: 0.1, highest_hz: 1.5, period: 0 };
    let chirp = Excitation::Chirp { from_hz: 0.1, to_hz: 1.5 };
    let run = |name: &str, shape: &Excitation, amplitude: f64, seed: u64, noise: Noise| -> anyhow::Result<Recording> {
        let u = shape.signal(SAMPLES, PERIOD_S, amplitude, seed)?;
        let u: Vec<f64> = u.iter().map(|u| u + system.offset).collect();
        let mut y = operator.respond(&u);
        if noise == Noise::White {
            let variance = variance_for_snr(&y, SNR_DB)?;
            let e = autoregressive_noise(&[], y.len(), variance, seed ^ 0x55)?;
            y.iter_mut().zip(e).for_each(|(y, e)| *y += e);
        }
        let channel = |name: &str, samples: Vec<f64>| Channel { name: name.into(), samples };
        let clock = Clock { start_s: 0.0, period_s: PERIOD_S };
        Ok(Recording::new(name, clock, vec![channel("u", u), channel("y", y)])?)
    };
    let estimation = [run("estimation", &multisine, system.amplitude, seed, noise)?];
    let (found, seconds) = timed(&estimation, &super::sets::HALVES)?;
    let name = match noise {
        Noise::None => system.set.to_owned(),
        Noise::White => format!("{}, noise at 40 dB", system.set),
    };
    let inputs = [("multisine", &multisine, 0.9), ("chirp", &chirp, 0.7)];
    inputs
        .into_iter()
        .enumerate()
        .map(|(i, (what, shape, share))| {
            let fresh = run(what, shape, share * system.amplitude, seed + 1 + i as u64, Noise::None)?;
            let mut scores = Scores::default();
            scores.add(&found.model, &found.linear, &fresh, 0)?;
            Ok(line(&name, what, "", 1.0, &scores, &found, seconds))
        })
        .collect()
}
