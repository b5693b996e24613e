//! A table of bad recordings: each ends in one error that names the file and, where there is one, the line and the column.

use std::path::Path;

use hysid_io::{InputError, InputProblem as P, ReadOptions, TimeSource, read_recording, require};

type Judge = fn(&P) -> bool;

fn read(dir: &Path, bytes: &[u8], options: &ReadOptions) -> Result<hysid_signal::Recording, InputError> {
    let file = dir.join("rec.csv");
    std::fs::write(&file, bytes).unwrap();
    read_recording(&file, options)
}

#[test]
fn each_kind_of_bad_recording_has_its_message() {
    let dir = tempfile::tempdir().unwrap();
    let utf16: Vec<u8> = [0xFF, 0xFE].into_iter().chain("t_s,u\n".encode_utf16().flat_map(u16::to_le_bytes)).collect();
    let all = ReadOptions::default();
    let uy = ReadOptions::columns(["u_V", "y_mm"]);
    let no_time = ReadOptions { time: TimeSource::Period(0.1), columns: None };
    let bad_period = ReadOptions { time: TimeSource::Period(-1.0), columns: None };
    let own_clock = ReadOptions { time: TimeSource::Column("time".into()), columns: None };
    let twice = ReadOptions::columns(["u_V", "u_V"]);
    let cases: &[(&str, &[u8], &ReadOptions, Option<u64>, Option<&str>, Judge)] = &[
        ("empty file", b"", &all, None, None, |p| *p == P::Empty),
        ("blank lines only", b"\n\n\n", &all, None, None, |p| *p == P::Empty),
        ("header only", b"t_s,u_V,y_mm\n", &uy, None, None, |p| *p == P::HeaderOnly),
        ("header without line end", b"t_s,u_V,y_mm", &uy, None, None, |p| *p == P::HeaderOnly),
        ("short row", b"t_s,u_V,y_mm\n0,1,2\n0.1,1\n", &uy, Some(3), None, |p| {
            *p == P::RaggedRow { found: 2, expected: 3 }
        }),
        ("long row", b"t_s,u_V,y_mm\n0,1,2,9\n", &uy, Some(2), None, |p| *p == P::RaggedRow { found: 4, expected: 3 }),
        ("text in a number", b"t_s,u_V,y_mm\n0,1,2\n0.1,abc,2\n", &uy, Some(3), Some("u_V"), |p| {
            *p == P::NotANumber("abc".into())
        }),
        ("a unit in a number", b"t_s,u_V,y_mm\n0,1 V,2\n", &uy, Some(2), Some("u_V"), |p| {
            matches!(p, P::NotANumber(_))
        }),
        ("NA is text", b"t_s,u_V,y_mm\n0,NA,2\n", &uy, Some(2), Some("u_V"), |p| matches!(p, P::NotANumber(_))),
        ("a quoted decimal comma", b"t_s,u_V,y_mm\n0,\"1,5\",2\n", &uy, Some(2), Some("u_V"), |p| {
            matches!(p, P::NotANumber(_))
        }),
        ("unquoted decimal comma", b"t_s,u_V,y_mm\n0,0,1,5,2\n", &uy, Some(2), None, |p| {
            matches!(p, P::RaggedRow { .. })
        }),
        ("inf", b"t_s,u_V,y_mm\n0,1,2\n0.1,inf,2\n", &uy, Some(3), Some("u_V"), |p| matches!(p, P::OutOfRange(_))),
        ("minus infinity", b"t_s,u_V,y_mm\n0,1,-Infinity\n", &uy, Some(2), Some("y_mm"), |p| {
            matches!(p, P::OutOfRange(_))
        }),
        ("1e300", b"t_s,u_V,y_mm\n0,1,1e300\n", &uy, Some(2), Some("y_mm"), |p| matches!(p, P::OutOfRange(_))),
        ("1e999", b"t_s,u_V,y_mm\n0,1,1e999\n", &uy, Some(2), Some("y_mm"), |p| matches!(p, P::OutOfRange(_))),
        ("latin-1 header", b"t_s,u_V,y_\xB5m\n0,1,2\n", &all, Some(1), None, |p| matches!(p, P::NotUtf8(_))),
        ("latin-1 field", b"t_s,u_V,y_mm\n0,1,2\n0.1,1,\xB5\n", &uy, Some(3), Some("y_mm"), |p| {
            matches!(p, P::NotUtf8(_))
        }),
        ("UTF-16", &utf16, &all, Some(1), None, |p| matches!(p, P::NotUtf8(_))),
        ("UTF-16 without a mark", b"t\0_\0s\0,\0u\0\n\0", &all, Some(1), None, |p| matches!(p, P::NotUtf8(_))),
        ("semicolons", b"t_s;u_V;y_mm\n0;1;2\n", &uy, Some(1), None, |p| *p == P::WrongSeparator("semicolons")),
        ("tabs", b"t_s\tu_V\ty_mm\n0\t1\t2\n", &uy, Some(1), None, |p| *p == P::WrongSeparator("tabs")),
        ("no header", b"0,1,2\n0.1,1,2\n", &all, Some(1), None, |p| *p == P::NoHeader),
        ("unnamed column", b"t_s,,y_mm\n0,1,2\n", &all, Some(1), Some("2"), |p| *p == P::UnnamedColumn),
        ("duplicate column", b"t_s,u_V,u_V\n0,1,2\n", &all, Some(1), Some("u_V"), |p| *p == P::DuplicateColumn),
        ("the same column asked for twice", b"t_s,u_V\n0,1\n", &twice, None, Some("u_V"), |p| *p == P::DuplicateColumn),
        ("missing column", b"t_s,u_V\n0,1\n", &uy, None, Some("y_mm"), |p| matches!(p, P::MissingColumn(_))),
        ("no time column", b"u_V,y_mm\n1,2\n", &uy, None, None, |p| *p == P::NoClock("`u_V`, `y_mm`".into())),
        ("missing own time column", b"u_V,y_mm\n1,2\n", &own_clock, None, Some("time"), |p| {
            matches!(p, P::MissingColumn(_))
        }),
        ("missing time stamp", b"t_s,u_V,y_mm\n0,1,2\n,1,2\n0.2,1,2\n", &uy, Some(3), Some("t_s"), |p| {
            *p == P::MissingTime
        }),
        ("duplicate time", b"t_s,u_V,y_mm\n0,1,2\n0.1,1,2\n0.1,1,2\n", &uy, Some(4), Some("t_s"), |p| {
            *p == P::DuplicateTime(0.1)
        }),
        ("decreasing time", b"t_s,u_V,y_mm\n0,1,2\n0.2,1,2\n0.1,1,2\n", &uy, Some(4), Some("t_s"), |p| {
            matches!(p, P::DecreasingTime { .. })
        }),
        (
            "a missing row",
            b"t_s,u_V,y_mm\n0,1,2\n0.1,1,3\n0.2,1,2\n0.4,1,2\n0.5,1,2\n0.6,1,2\n",
            &uy,
            Some(5),
            Some("t_s"),
            |p| matches!(p, P::NonUniformClock { .. }),
        ),
        (
            "a missing row after blank lines",
            b"t_s,u_V,y_mm\n0,1,2\n\n0.1,1,3\n0.2,1,2\n\n\n0.4,1,2\n0.5,1,2\n0.6,1,2\n",
            &uy,
            Some(8),
            Some("t_s"),
            |p| matches!(p, P::NonUniformClock { .. }),
        ),
        ("one sample", b"t_s,u_V,y_mm\n0,1,2\n", &uy, None, None, |p| *p == P::TooFewSamples { found: 1, needed: 2 }),
        ("one sample without a clock", b"u_V\n1\n", &no_time, None, None, |p| {
            *p == P::TooFewSamples { found: 1, needed: 2 }
        }),
        ("NaN everywhere", b"t_s,u_V,y_mm\n0,1,NaN\n0.1,1,nan\n", &uy, None, Some("y_mm"), |p| *p == P::AllMissing),
        ("empty everywhere", b"t_s,u_V,y_mm\n0,,1\n0.1,,1\n", &uy, None, Some("u_V"), |p| *p == P::AllMissing),
        ("all columns missing", b"t_s,u_V,y_mm\n0,,\n0.1,,\n", &all, None, Some("u_V"), |p| *p == P::AllMissing),
        ("a period below zero", b"u_V\n1\n2\n", &bad_period, None, None, |p| *p == P::BadPeriod(-1.0)),
    ];
    for (what, bytes, options, line, column, judge) in cases {
        let error = read(dir.path(), bytes, options).expect_err(what);
        assert!(judge(&error.problem), "{what}: {error}");
        assert_eq!(error.line, *line, "{what}: {error}");
        assert_eq!(error.column.as_deref(), *column, "{what}: {error}");
        assert!(error.to_string().contains("rec.csv"), "{what}: {error}");
        assert!(!error.to_string().contains('\n'), "{what}: one line, not {error:?}");
    }
}

#[test]
fn a_path_that_is_no_readable_file_has_its_message() {
    let dir = tempfile::tempdir().unwrap();
    let options = ReadOptions::default();
    assert_eq!(read_recording(dir.path(), &options).unwrap_err().problem, P::IsDirectory);
    assert_eq!(read_recording(&dir.path().join("none.csv"), &options).unwrap_err().problem, P::NotFound);
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        let locked = dir.path().join("locked.csv");
        std::fs::write(&locked, "t_s,u\n0,1\n1,2\n").unwrap();
        std::fs::set_permissions(&locked, std::fs::Permissions::from_mode(0o000)).unwrap();
        // The superuser may read it all the same.
        if std::fs::File::open(&locked).is_err() {
            assert_eq!(read_recording(&locked, &options).unwrap_err().problem, P::PermissionDenied);
        }
    }
}

#[test]
fn good_recordings_are_read_as_they_are() {
    let dir = tempfile::tempdir().unwrap();
    let uy = ReadOptions::columns(["y_mm", "u_V"]);
    let r = read(dir.path(), b"\xEF\xBB\xBFt_s,u_V,y_mm,note\r\n1.0,1,2,a\r\n1.1, -3e2 ,,b\r\n1.2,NaN,4,c\r\n", &uy)
        .unwrap();
    assert_eq!(r.name(), "rec.csv");
    assert!((r.clock().period_s - 0.1).abs() < 1e-15 && r.clock().start_s == 1.0);
    assert_eq!(r.channels()[0].name, "y_mm");
    assert_eq!(r.channel("u_V").unwrap().samples[..2], [1.0, -300.0]);
    assert_eq!(r.segments(&["u_V"]), vec![0..2]);
    assert_eq!(r.segments(&["y_mm"]), vec![0..1, 2..3]);

    let period = ReadOptions { time: TimeSource::ColumnOrPeriod("t_s".into(), 0.25), columns: None };
    let r = read(dir.path(), b"y\n1\n\n3\n4\n\n", &period).unwrap();
    assert_eq!(r.clock().period_s, 0.25);
    assert_eq!(r.segments(&["y"]), vec![0..1, 2..4], "a blank line in a file of one column is a missing sample");
    let r = read(dir.path(), b"t_s,y\n0,1\n2,3\n", &period).unwrap();
    assert_eq!(r.clock().period_s, 2.0);
}

#[test]
fn callers_judge_what_they_need() {
    let dir = tempfile::tempdir().unwrap();
    let r = read(dir.path(), b"t_s,u_V,y_mm\n0,1,2\n1,1,\n2,1,3\n", &ReadOptions::default()).unwrap();
    let file = Path::new("folder/rec.csv");
    assert!(require::varying(file, &r, "y_mm").is_ok());
    assert_eq!(require::varying(file, &r, "u_V").unwrap_err().problem, P::Constant(1.0));
    assert!(matches!(require::channel(file, &r, "x").unwrap_err().problem, P::MissingColumn(_)));
    assert_eq!(require::samples(file, &r, &["u_V", "y_mm"], 2), Ok(2));
    assert_eq!(
        require::samples(file, &r, &["u_V", "y_mm"], 3).unwrap_err().problem,
        P::TooFewSamples { found: 2, needed: 3 }
    );
    let told = require::varying(file, &r, "u_V").unwrap_err().to_string();
    assert!(told.starts_with("folder/rec.csv, column `u_V`: "), "{told}");
}
