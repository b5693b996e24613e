//! What is written reads back as the same; a failed write leaves nothing behind.

use hysid_io::{
    CsvChunks, InputProblem, ReadOptions, TimeSource, check_writable, format_number, read_recording, read_text,
    read_versioned, write_csv, write_recording, write_versioned,
};
use hysid_signal::{Channel, Clock, Recording};
use proptest::prelude::*;
use serde::{Deserialize, Serialize};

proptest! {
    #[test]
    fn a_number_reads_back_as_itself(bits in any::<u64>()) {
        let x = f64::from_bits(bits);
        prop_assume!(x.is_finite());
        prop_assert_eq!(format_number(x).parse::<f64>().unwrap().to_bits(), x.to_bits());
        prop_assert!(format_number(x).len() <= 26);
    }

    #[test]
    fn a_recording_reads_back_as_itself(
        y in proptest::collection::vec(prop_oneof![Just(f64::NAN), -1e6..1e6], 2..60),
        period in 1e-6..1e3,
        start in -1e3..1e3,
    ) {
        prop_assume!(y.iter().any(|x| x.is_finite()));
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("r.csv");
        let channels = vec![Channel { name: "y_mm".into(), samples: y.clone() }];
        let written = Recording::new("r.csv", Clock { start_s: start, period_s: period }, channels).unwrap();
        write_recording(&file, &written).unwrap();
        let back = read_recording(&file, &ReadOptions::default()).unwrap();
        for (a, b) in y.iter().zip(&back.channels()[0].samples) {
            prop_assert!(a == b || (a.is_nan() && b.is_nan()));
        }
        prop_assert!((back.clock().period_s / period - 1.0).abs() < 1e-7);
    }
}

#[test]
fn chunks_add_up_to_the_file() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("r.csv");
    let y: Vec<f64> = (0..1000).map(|n| (n as f64).sin()).collect();
    let t: Vec<f64> = (0..1000).map(f64::from).collect();
    write_csv(&file, &[("t_s", &t), ("y", &y)]).unwrap();
    for rows in [1, 7, 1000, 5000] {
        let mut chunks = CsvChunks::open(&file, Some(&["y"]), rows).unwrap();
        assert_eq!(chunks.header(), ["t_s", "y"]);
        let mut all = Vec::new();
        while let Some(chunk) = chunks.next_chunk().unwrap() {
            assert!(chunk.lines.len() <= rows);
            all.extend_from_slice(&chunk.columns[0]);
        }
        assert_eq!(all, y);
    }
}

#[test]
fn a_failed_write_leaves_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path().join("taken.csv");
    std::fs::create_dir(&folder).unwrap();
    assert!(write_csv(&folder, &[("y", &[1.0])]).is_err());
    assert!(write_csv(&dir.path().join("none/r.csv"), &[("y", &[1.0])]).is_err());
    assert!(write_csv(&dir.path().join("r.csv"), &[("y", &[1.0]), ("u", &[])]).is_err());
    assert!(write_csv(&dir.path().join("r.csv"), &[("y,z", &[1.0])]).is_err());
    let left: Vec<_> = std::fs::read_dir(dir.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(left, ["taken.csv"]);
}

#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Body {
    theta: Vec<f64>,
}

#[test]
fn a_model_file_carries_its_format_and_version() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("m.json");
    let body = Body { theta: vec![0.1, 1e-300, -7.0 / 3.0] };
    write_versioned(&file, "hysid.test", 2, &body).unwrap();
    assert_eq!(read_versioned::<Body>(&file, "hysid.test", 3).unwrap(), (2, body));
    let text = std::fs::read_to_string(&file).unwrap();
    assert!(text.starts_with("{\n  \"format\": \"hysid.test\",\n  \"format_version\": 2,"), "{text}");

    let problem = |text: &str| {
        std::fs::write(&file, text).unwrap();
        read_versioned::<Body>(&file, "hysid.test", 3).unwrap_err()
    };
    assert!(matches!(problem("").problem, InputProblem::Json(_)));
    assert!(matches!(problem("[1]").problem, InputProblem::Json(_)));
    assert_eq!(problem("{\n\"format\": \n}").line, Some(3));
    let wrong = problem(r#"{"format":"hysid.other","format_version":1,"theta":[]}"#);
    assert!(matches!(wrong.problem, InputProblem::WrongFormat { .. }));
    let newer = problem(r#"{"format":"hysid.test","format_version":4,"theta":[]}"#);
    assert_eq!(newer.problem, InputProblem::UnknownVersion { found: 4, newest: 3 });
    assert!(matches!(
        problem(r#"{"format":"hysid.test","format_version":1,"Theta":[]}"#).problem,
        InputProblem::Json(_)
    ));
}

#[test]
fn what_is_wrong_in_json_is_told_with_its_place_and_key() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("m.json");
    let told = |text: &str| {
        std::fs::write(&file, text).unwrap();
        let error = read_versioned::<Body>(&file, "hysid.test", 3).unwrap_err().to_string();
        error.split_once("m.json").unwrap().1.to_owned()
    };
    let label = "\u{feff}{\"format\": \"hysid.test\", \"format_version\": 1,\n";
    let of = |body: &str| told(&format!("{label}{body}}}"));
    assert_eq!(
        of("\"theta\": [1, \"x\"]"),
        ", line 2: not the JSON that is needed: column 16, `theta[1]`: invalid type: string \"x\", expected a number"
    );
    assert!(of("\"theta\": 5").contains("line 2: not the JSON that is needed: column 10, `theta`"));
    assert!(of("\"Theta\": []").contains("missing field `theta`"));
    assert!(told("{\"format\": \"hysid.test\", \"format_version\": -1}").contains("expected a whole number"));
    // A byte-order mark, and nothing wrong.
    std::fs::write(&file, format!("{label}\"theta\": [1]}}")).unwrap();
    assert_eq!(read_versioned::<Body>(&file, "hysid.test", 3).unwrap().1, Body { theta: vec![1.0] });
}

#[test]
fn a_file_beyond_its_limit_is_not_read() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("large.toml");
    std::fs::write(&file, "0123456789").unwrap();
    assert_eq!(read_text(&file, 10).unwrap(), "0123456789");
    assert_eq!(read_text(&file, 9).unwrap_err().problem, InputProblem::TooLarge(9));
    // Far larger than memory, but for its holes.
    std::fs::File::create(&file).unwrap().set_len(1 << 40).unwrap();
    assert!(matches!(read_versioned::<Body>(&file, "hysid.test", 1).unwrap_err().problem, InputProblem::TooLarge(_)));
}

#[cfg(unix)]
#[test]
fn a_pipe_is_written_to_and_not_replaced_nor_taken_for_a_recording() {
    use std::os::unix::fs::FileTypeExt;
    let dir = tempfile::tempdir().unwrap();
    let pipe = dir.path().join("pipe");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let error = read_recording(&pipe, &ReadOptions::default()).unwrap_err();
    assert_eq!(error.problem, InputProblem::NotAFile);
    let reader = std::thread::spawn({
        let pipe = pipe.clone();
        move || std::fs::read_to_string(pipe).unwrap()
    });
    write_csv(&pipe, &[("y", &[1.0, 2.0])]).unwrap();
    assert_eq!(reader.join().unwrap(), "y\n1\n2\n");
    assert!(std::fs::metadata(&pipe).unwrap().file_type().is_fifo());
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1);
}

#[cfg(unix)]
#[test]
fn a_link_stays_a_link() {
    let dir = tempfile::tempdir().unwrap();
    let (file, link) = (dir.path().join("file.csv"), dir.path().join("link.csv"));
    std::fs::write(&file, "before").unwrap();
    std::os::unix::fs::symlink(&file, &link).unwrap();
    write_csv(&link, &[("y", &[1.0])]).unwrap();
    assert!(std::fs::symlink_metadata(&link).unwrap().is_symlink());
    assert_eq!(std::fs::read_to_string(&file).unwrap(), "y\n1\n");
}

/// Real time columns, rounded as their makers rounded them, each with the period that its documentation states.
#[test]
fn real_clocks_are_read() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/recordings");
    if !root.is_dir() {
        assert!(std::env::var("HYSID_REQUIRE_RECORDINGS").is_err(), "the recordings are needed but not there");
        println!("skipped: no recordings");
        return;
    }
    let cases = [
        ("silverbox/silverbox_validation_arrow.csv", 1.0 / 610.35, 1e-6),
        ("wiener_hammerstein/wh_validation.csv", 1.0 / 51_200.0, 1e-9),
        ("osu_s809_dynamic_stall/C10h100_08.csv", 1.0 / 60.94, 1e-5),
        ("osu_s809_dynamic_stall/C10l100_08.csv", 1.0 / 21.55, 1e-5),
        ("boucwen_benchmark_simulated/boucwen_validation_multisine.csv", 1.0 / 750.0, 1e-7),
        ("mr_damper_utfpr/mr_exp1.csv", 0.01, 1e-12),
        ("emps/emps_estimation.csv", 0.001, 1e-12),
        ("piezo_fine_steering_mirror/fsm_100mV_validation_r0.csv", 1.0 / 6400.0, 1e-6),
    ];
    for (file, period, tolerance) in cases {
        let r = read_recording(&root.join(file), &ReadOptions::default()).unwrap();
        assert!((r.clock().period_s / period - 1.0).abs() < tolerance, "{file}: {}", r.clock().period_s);
    }
    let wall = ReadOptions { time: TimeSource::ColumnOrPeriod("t_s".into(), 0.002), columns: None };
    assert_eq!(read_recording(&root.join("rocking_wall_ts1/ts1.csv"), &wall).unwrap().clock().period_s, 0.002);
}

#[test]
fn what_could_be_written_is_told_before_and_leaves_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("r.csv");
    check_writable(&file).unwrap();
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
    std::fs::write(&file, "kept").unwrap();
    check_writable(&file).unwrap();
    assert_eq!(std::fs::read_to_string(&file).unwrap(), "kept");
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1);
    for (path, why) in [
        (dir.path().to_path_buf(), "it is a folder"),
        (file.join("x.csv"), "r.csv/x.csv"),
        (dir.path().join("no/x.csv"), "no/x.csv"),
    ] {
        let told = check_writable(&path).unwrap_err().to_string();
        assert!(told.contains("cannot be written") && told.contains(why), "{told}");
    }
}
