//! The shared baselines calibrate on their recordings: the free-run error on the hold-out beats a constant, or is told.
//!
//! With `--nocapture` it prints a table: error of the user's values and of the calibrated ones on the hold-out.

use std::path::Path;

use hysid_plant::{ClockSource, Compiled, Data, Run, Settings, Simulation, Start};
use hysid_signal::{Channel, Clock, Recording};

/// A plain reader for the shared files, which are known to be well formed.
fn read(path: &Path, simulation: &Simulation) -> Recording {
    let text = std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().expect("a header").split(',').collect();
    let mut channels: Vec<Channel> =
        names.iter().map(|n| Channel { name: (*n).to_owned(), samples: Vec::new() }).collect();
    for line in lines.filter(|l| !l.is_empty()) {
        for (channel, field) in channels.iter_mut().zip(line.split(',')) {
            channel.samples.push(field.parse().unwrap_or(f64::NAN));
        }
    }
    let clock = match &simulation.time.clock {
        ClockSource::Period(period_s) => Clock { start_s: 0.0, period_s: *period_s },
        ClockSource::Column(column) => {
            let t = &channels.iter().find(|c| c.name == *column).expect("time").samples;
            Clock { start_s: t[0], period_s: (t[t.len() - 1] - t[0]) / (t.len() - 1) as f64 }
        }
    };
    let name = path.file_name().expect("a file").to_string_lossy().into_owned();
    Recording::new(name, clock, channels).expect("valid")
}

fn error(compiled: &Compiled, data: &[Data], theta: &[f64], substeps: usize) -> (f64, f64) {
    let (mut sum, mut spread, mut count) = (0.0, 0.0, 0.0);
    for data in data {
        let (initial, skip) = compiled.estimate_initial(data, theta, substeps);
        let x = data.start_states(compiled, theta, &initial);
        let run = Run::new(&data.drive, theta).from(Start::States(&x)).with_substeps(substeps);
        let y = &compiled.simulate(&run).outputs[0][skip..];
        let measured = &data.measured[0][skip..];
        let mean = measured.iter().sum::<f64>() / measured.len() as f64;
        for (y, m) in y.iter().zip(measured) {
            sum += (y - m).powi(2);
            spread += (m - mean).powi(2);
            count += 1.0;
        }
    }
    ((sum / count).sqrt(), (spread / count).sqrt())
}

/// Simulation, folder, estimation files, hold-out files; rows of a single record are split.
type Baseline = (&'static str, &'static [&'static str], &'static [&'static str], Option<usize>, f64);

const BASELINES: &[Baseline] = &[
    ("emps", &["emps_estimation.csv"], &["emps_validation_pulses.csv"], None, 0.3),
    ("silverbox", &["silverbox_estimation_multisine.csv"], &["silverbox_validation_multisine.csv"], None, 0.4),
    (
        "boucwen_benchmark_simulated",
        &["boucwen_estimation_multisine.csv"],
        &["boucwen_validation_multisine.csv"],
        None,
        0.6,
    ),
    ("mr_damper_utfpr", &["mr_exp1.csv", "mr_exp5.csv"], &["mr_vali1.csv", "mr_exp10.csv"], None, 0.7),
    ("mr_damper_boucwen_simulated", &["mr_damper_sim.csv"], &["mr_damper_sim.csv"], Some(2600), 0.9),
    (
        "osu_s809_dynamic_stall",
        &["C5l100_14.csv", "C5h100_14.csv", "C10l100_14.csv", "C10h100_14.csv"],
        &["C5m100_14.csv", "C10m100_14.csv"],
        None,
        0.8,
    ),
    ("rocking_wall_ts1", &["ts1.csv"], &["ts1.csv"], Some(640), 1.2),
    ("wiener_hammerstein", &["wh_estimation.csv"], &["wh_validation.csv"], None, 0.4),
    (
        "piezo_fine_steering_mirror",
        &["fsm_300mV_estimation_r0.csv", "fsm_100mV_estimation_r0.csv"],
        &["fsm_300mV_validation_r0.csv"],
        None,
        0.8,
    ),
];

#[test]
fn the_shared_baselines_calibrate() {
    let Some(shared) = crate::common::shared() else { return };
    println!("{:30} {:>10} {:>10} {:>10} {:>6} {:>5} {:>8}", "", "rms", "user", "calibrated", "sims", "steps", "s");
    for (name, estimation, holdout, split, allowed) in BASELINES {
        let text = std::fs::read_to_string(shared.join(format!("simulations/{name}.sim.toml"))).expect("readable");
        let simulation = Simulation::parse(&text, name).expect("valid");
        let compiled = Compiled::new(&simulation).expect("valid");
        let load = |files: &[&str], estimation: bool| -> Vec<Data> {
            let all = files.iter().flat_map(|file| {
                let path = shared.join("recordings").join(name).join(file);
                if !path.is_file() {
                    return Vec::new();
                }
                let recording = read(&path, &simulation);
                let recording = match (split, estimation) {
                    (Some(at), true) => recording.slice(0..*at),
                    (Some(at), false) => recording.slice(*at..recording.len()),
                    _ => recording,
                };
                let data = Data::from_recording(&compiled, &recording).expect("usable");
                // Long records are cut for the time that a test may take.
                if estimation { data.iter().map(|d| d.shortened(12_000)).collect() } else { data }
            });
            all.collect()
        };
        let (fit, held) = (load(estimation, true), load(holdout, false));
        let began = std::time::Instant::now();
        let result = compiled.calibrate(&fit, &Settings::default()).unwrap_or_else(|e| panic!("{name}: {e}"));
        let seconds = began.elapsed().as_secs_f64();
        let (before, _) = error(&compiled, &held, &compiled.theta(), result.steps.substeps);
        let (after, rms) = error(&compiled, &held, &result.theta, result.steps.substeps);
        println!(
            "{name:30} {rms:10.3e} {before:10.3e} {after:10.3e} {:6} {:5} {seconds:8.2}  {:.4?} {:?}",
            result.simulations, result.steps.substeps, result.theta, result.flags
        );
        assert!(after < allowed * rms, "{name}: {after} beside {rms}");
    }
}
