//! `identify` with defaults on parts of public recordings, cut so that the test is quick; the whole sets are run by
//! `cargo xtask recordings`.
//!
//! Skipped where the recordings are not there, unless `HYSID_REQUIRE_RECORDINGS=1`. The bounds are loose: they catch a
//! recipe that has broken, not one that has become a little worse.

use std::path::PathBuf;

use hysid::identify::{Columns, Options, Source, identify};
use hysid_io::{ReadOptions, TimeSource, read_recording};
use hysid_signal::Recording;
use hysid_validate::{Normaliser, measure};

/// One set, or a part of it.
struct Case {
    folder: &'static str,
    inputs: &'static [&'static str],
    output: &'static str,
    /// Files that teach, and the samples of each that do.
    estimation: &'static [&'static str],
    samples: usize,
    validation: &'static str,
    /// What the free run's error must stay below, as a share of the output's standard deviation, and of the linear model's
    /// error.
    bounds: (f64, f64),
}

const CASES: [Case; 3] = [
    Case {
        folder: "silverbox",
        inputs: &["u_V"],
        output: "y_V",
        estimation: &["silverbox_estimation_multisine.csv"],
        samples: 5000,
        validation: "silverbox_validation_multisine.csv",
        bounds: (0.02, 0.2),
    },
    Case {
        folder: "mr_damper_utfpr",
        inputs: &["x_mm", "v_mm_s"],
        output: "F_N",
        estimation: &["mr_exp1.csv", "mr_exp5.csv"],
        samples: usize::MAX,
        validation: "mr_vali1.csv",
        bounds: (0.2, 0.4),
    },
    Case {
        folder: "osu_s809_dynamic_stall",
        inputs: &["alpha_deg"],
        output: "CN",
        estimation: &["C10l100_20.csv", "C10l100_08.csv", "C10h100_20.csv", "C10h100_08.csv"],
        samples: usize::MAX,
        validation: "C10m100_20.csv",
        bounds: (0.8, 0.9),
    },
];

/// The folder of the recordings, beside the checkout.
fn folder() -> Option<PathBuf> {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/recordings");
    if folder.is_dir() {
        return Some(folder);
    }
    let required = std::env::var_os("HYSID_REQUIRE_RECORDINGS").is_some_and(|v| v == "1");
    assert!(!required, "{}: there are no recordings, and HYSID_REQUIRE_RECORDINGS=1", folder.display());
    println!("skipped: no recordings");
    None
}

#[test]
fn free_runs_on_public_recordings() {
    let Some(folder) = folder() else { return };
    for case in &CASES {
        let read = |file: &str| {
            let time = TimeSource::ColumnOrPeriod("t_s".into(), 1.0);
            let columns = case.inputs.iter().chain([&case.output]).map(|c| (*c).to_string()).collect();
            read_recording(&folder.join(case.folder).join(file), &ReadOptions { time, columns: Some(columns) }).unwrap()
        };
        let part = |r: Recording| {
            let end = case.samples.min(r.len());
            r.slice(0..end)
        };
        let estimation: Vec<Recording> = case.estimation.iter().map(|f| part(read(f))).collect();
        let inputs: Vec<String> = case.inputs.iter().map(|s| (*s).to_string()).collect();
        let source = Source { recordings: &estimation, inputs: &inputs, output: case.output };
        let found = identify(source, &Options::default(), &|_| {}).unwrap();
        let validation = read(case.validation);
        let columns = Columns::of(&found.model, &validation).unwrap();
        let error = |model: &hysid_narx::NarxModel| {
            let run = model.free_run(&columns.record()).unwrap();
            assert_eq!(run.diverged_at, None, "{}", case.folder);
            measure(columns.y, &run.y).nrmse(Normaliser::Std)
        };
        let (ours, linear) = (error(&found.model), error(&found.linear));
        println!("{}: {ours:.4} of the standard deviation, linear {linear:.4}", case.folder);
        assert!(ours < case.bounds.0 && ours < case.bounds.1 * linear, "{}: {ours} {linear}", case.folder);
    }
}
