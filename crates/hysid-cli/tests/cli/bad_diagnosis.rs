//! Bad input to `hysid diagnose`: exit status 2, one line that names what is wrong and where, and nothing written.

use std::path::Path;

use crate::common::oscillator::BASELINE;
use crate::common::{DIAGNOSE, OscillatorFiles, files_of, hysid, with_files};

/// A case: what is done to the good files in the folder, the command line, and what the message must hold.
struct Case {
    what: &'static str,
    spoil: Box<dyn Fn(&Path)>,
    line: Vec<&'static str>,
    message: &'static [&'static str],
}

const COLUMN: [&str; 13] = with_files(["diagnose", "--simulated", "s_m", "--input", "u_N", "--output", "x_m"]);

fn case(
    what: &'static str,
    spoil: impl Fn(&Path) + 'static,
    line: &[&'static str],
    message: &'static [&'static str],
) -> Case {
    Case { what, spoil: Box::new(spoil), line: line.to_vec(), message }
}

fn nothing(_: &Path) {}

/// The good simulation with one piece of text in place of another.
fn simulation(from: &'static str, to: &'static str) -> impl Fn(&Path) {
    move |dir| {
        assert!(BASELINE.contains(from), "{from}");
        std::fs::write(dir.join("base.sim.toml"), BASELINE.replace(from, to)).unwrap();
    }
}

/// A recording whose text is changed.
fn recording(file: &'static str, change: impl Fn(&str) -> String + 'static) -> impl Fn(&Path) {
    move |dir| {
        let text = std::fs::read_to_string(dir.join(file)).unwrap();
        let changed = change(&text);
        assert_ne!(text, changed);
        std::fs::write(dir.join(file), changed).unwrap();
    }
}

/// The text with one field (line and column from 1) changed.
fn field(line: usize, column: usize, to: &'static str) -> impl Fn(&str) -> String {
    move |text| {
        let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
        let mut fields: Vec<&str> = lines[line - 1].split(',').collect();
        fields[column - 1] = to;
        lines[line - 1] = fields.join(",");
        lines.join("\n") + "\n"
    }
}

/// All fields of a column changed.
fn column(column: usize, to: impl Fn(usize) -> String + 'static) -> impl Fn(&str) -> String {
    move |text| {
        text.lines()
            .enumerate()
            .map(|(n, l)| {
                let value = to(n);
                let mut fields: Vec<&str> = l.split(',').collect();
                if n > 0 {
                    fields[column - 1] = &value;
                }
                fields.join(",") + "\n"
            })
            .collect()
    }
}

fn first(lines: usize) -> impl Fn(&str) -> String {
    move |text| text.lines().take(lines).map(|l| format!("{l}\n")).collect()
}

/// The good command line with one argument in place of another, and more at its end.
fn line(good: &[&'static str], from: &str, to: &'static str, more: &[&'static str]) -> Vec<&'static str> {
    let replaced = good.iter().map(|a| if *a == from { to } else { *a });
    replaced.chain(more.iter().copied()).collect()
}

fn simulations() -> Vec<Case> {
    let c = |what, from, to, message| case(what, simulation(from, to), &DIAGNOSE, message);
    vec![
        c("not TOML", "[time]", "[time", &["base.sim.toml:3:", "not TOML"]),
        c("unknown key", "[parameters]", "[paramters]", &["base.sim.toml:7:", "paramters", "unknown key"]),
        c("unknown key of a parameter", "min = 0.2", "minimum = 0.2", &["base.sim.toml:8:", "minimum", "allowed here"]),
        c("unknown symbol", "- k*x)/m", "- kk*x)/m", &["base.sim.toml:13:", "unknown symbol `kk`"]),
        c("unknown function", "- k*x)/m", "- sine(x))/m", &["base.sim.toml:13:", "sine"]),
        c("syntax of an expression", "(u - c*v", "(u - - * c*v", &["base.sim.toml:13:", "states.v.derivative"]),
        c("missing bound", "min = 0.0, max = 20.0, ", "", &["base.sim.toml:9:", "needs `min` or `max`"]),
        c("value outside its bounds", "value = 1.2", "value = 9.0", &["base.sim.toml:8:", "9"]),
        c("bounds the wrong way round", "min = 0.2, max = 5.0", "min = 5.0, max = 0.2", &["base.sim.toml:8:"]),
        c("bound that is not a number", "max = 20.0", "max = nan", &["base.sim.toml:9:", "NaN"]),
        c("a text for a value", "value = 1.2", "value = \"1.2\"", &["base.sim.toml:8:", "number"]),
        c("unit that is none", "\"kg\"", "\"kg^^2\"", &["base.sim.toml:8:", "unit"]),
        c("unit clash", "- k*x)/m", "- k*v)/m", &["base.sim.toml:13:", "units clash"]),
        c(
            "initial values in a cycle",
            "initial = 0.0, unit = \"m\"",
            "initial = \"v\", unit = \"m\"",
            &["base.sim.toml:12:", "`v`"],
        ),
        c(
            "initial value that changes with time",
            "initial = 0.0, unit = \"m\"",
            "initial = \"u/k\", unit = \"m\"",
            &["base.sim.toml:12:", "changes with time"],
        ),
        c("parameter named twice", "c = {", "m = {", &["base.sim.toml:9:", "duplicate key `m`"]),
        c("reserved symbol", "u = \"u_N\"", "pi = \"u_N\"", &["base.sim.toml:6:", "reserved"]),
        c("symbol of two things", "u = \"u_N\"", "k = \"u_N\"", &["base.sim.toml", "`k` is already"]),
        c("division by zero at the start", "- k*x)/m", "- k*x)/(m*x/0.1)", &["base.sim.toml", "state `v`", "est.csv"]),
        c(
            "a state that explodes",
            "- k*x)/m",
            "+ 1e12*k*v^3 + 1e9*k*x)/m",
            &["base.sim.toml", "diverges", "est.csv", " s "],
        ),
        c("an output that no state moves", "x_m = \"x\"", "x_m = \"k*2\"", &["base.sim.toml:15:", "x_m"]),
        c("no output", "x_m = \"x\"", "", &["base.sim.toml", "output"]),
        c("memory of a state's own derivative", "- k*x)/m", "- k*x - m*d(v))/m", &["base.sim.toml:13:", "d("]),
        c(
            "a column that the recording lacks",
            "u = \"u_N\"",
            "u = \"force_N\"",
            &["est.csv", "column `force_N`", "`u_N`"],
        ),
        c(
            "a time column that the recording lacks",
            "column = \"t_s\"",
            "column = \"time_s\"",
            &["est.csv", "column `time_s`"],
        ),
        c(
            "a period that contradicts the clock",
            "column = \"t_s\"",
            "period_s = 0.5",
            &["est.csv", "column `t_s`", "0.025", "0.5"],
        ),
        c("a period below zero", "column = \"t_s\"", "period_s = -1.0", &["base.sim.toml:4:", "-1"]),
        case(
            "a simulation that is not there",
            nothing,
            &line(&DIAGNOSE, "base.sim.toml", "none.sim.toml", &[]),
            &["none.sim.toml", "no such file"],
        ),
        case(
            "a directory as simulation",
            nothing,
            &line(&DIAGNOSE, "base.sim.toml", "folder", &[]),
            &["folder", "directory"],
        ),
        case(
            "a recording as simulation",
            nothing,
            &line(&DIAGNOSE, "base.sim.toml", "est.csv", &[]),
            &["est.csv:1:", "not TOML"],
        ),
        case(
            "a simulation that is no text",
            |dir| std::fs::write(dir.join("base.sim.toml"), [0xFF, 0xFE, 0x00, 0x41]).unwrap(),
            &DIAGNOSE,
            &["base.sim.toml", "UTF-8"],
        ),
        case(
            "an empty simulation",
            |dir| std::fs::write(dir.join("base.sim.toml"), "").unwrap(),
            &DIAGNOSE,
            &["base.sim.toml", "missing"],
        ),
    ]
}

fn recordings() -> Vec<Case> {
    let est = |what, change: Box<dyn Fn(&str) -> String>, message| {
        case(what, recording("est.csv", change), &DIAGNOSE, message)
    };
    let val = |what, change: Box<dyn Fn(&str) -> String>, message| {
        case(what, recording("val.csv", change), &DIAGNOSE, message)
    };
    vec![
        case(
            "a recording that is not there",
            nothing,
            &line(&DIAGNOSE, "est.csv", "none.csv", &[]),
            &["none.csv", "no such file"],
        ),
        case("a directory as recording", nothing, &line(&DIAGNOSE, "est.csv", "folder", &[]), &["folder", "directory"]),
        case("a directory as hold-out", nothing, &line(&DIAGNOSE, "val.csv", "folder", &[]), &["folder", "directory"]),
        case(
            "an empty recording",
            |dir| std::fs::write(dir.join("est.csv"), "").unwrap(),
            &DIAGNOSE,
            &["est.csv", "empty"],
        ),
        case(
            "an empty hold-out",
            |dir| std::fs::write(dir.join("val.csv"), "").unwrap(),
            &DIAGNOSE,
            &["val.csv", "empty"],
        ),
        val("a hold-out of a header only", Box::new(first(1)), &["val.csv", "not one line"]),
        est("one sample", Box::new(first(2)), &["est.csv", "1 sample;"]),
        est("fewer samples than unknowns", Box::new(first(9)), &["est.csv", "8 usable samples"]),
        val("too few samples in the hold-out", Box::new(first(9)), &["val.csv", "usable samples"]),
        est("a ragged row", Box::new(|t| t.replacen("\n0.1,", "\n0.1,7,", 1)), &["est.csv, line 6", "5 fields"]),
        est("text in a number", Box::new(field(40, 2, "abc")), &["est.csv, line 40, column `u_N`", "abc"]),
        est("infinity", Box::new(field(40, 3, "inf")), &["est.csv, line 40, column `x_m`", "out of range"]),
        val("text in a number of the hold-out", Box::new(field(40, 3, "-")), &["val.csv, line 40, column `x_m`"]),
        est("a clock that goes back", Box::new(field(40, 1, "0.3")), &["est.csv, line 40, column `t_s`", "back"]),
        est("a clock that is not uniform", Box::new(field(40, 1, "0.97")), &["est.csv, line 4", "column `t_s`"]),
        est("a constant output", Box::new(column(3, |_| "1.5".into())), &["est.csv", "column `x_m`", "constant"]),
        val(
            "a constant output in the hold-out",
            Box::new(column(3, |_| "1.5".into())),
            &["val.csv", "column `x_m`", "constant"],
        ),
        est("an input of gaps", Box::new(column(2, |_| String::new())), &["est.csv, column `u_N`", "missing"]),
        est("an output of gaps", Box::new(column(3, |_| "NaN".into())), &["est.csv, column `x_m`", "missing"]),
        est(
            "gaps at every second sample",
            Box::new(column(2, |n| if n % 2 == 0 { String::new() } else { "1".into() })),
            &["est.csv", "missing so often", "in a row"],
        ),
        val(
            "a hold-out with other columns",
            Box::new(|t| t.replacen("x_m", "y_m", 1)),
            &["val.csv, column `x_m`", "`y_m`"],
        ),
        est(
            "two columns of one name",
            Box::new(|t| t.replacen("s_m", "x_m", 1)),
            &["est.csv", "column `x_m`", "two columns"],
        ),
        est("semicolons", Box::new(|t| t.replace(',', ";")), &["est.csv, line 1", "semicolons"]),
        case(
            "the same file as hold-out",
            nothing,
            &line(&DIAGNOSE, "val.csv", "est.csv", &[]),
            &["est.csv", "never sees"],
        ),
        case(
            "a copy as hold-out",
            |dir| std::fs::copy(dir.join("est.csv"), dir.join("val.csv")).map(|_| ()).unwrap(),
            &DIAGNOSE,
            &["val.csv", "the same data as est.csv"],
        ),
        case(
            "a copy with gaps as hold-out",
            |dir| {
                recording("est.csv", field(40, 2, ""))(dir);
                std::fs::copy(dir.join("est.csv"), dir.join("val.csv")).unwrap();
            },
            &DIAGNOSE,
            &["val.csv", "the same data as est.csv"],
        ),
        case(
            "a recording twice",
            nothing,
            &line(&DIAGNOSE, "", "", &["--recording", "./est.csv"]),
            &["est.csv", "twice"],
        ),
    ]
}

fn requests() -> Vec<Case> {
    let with = |what, more: &[&'static str], message| case(what, nothing, &line(&DIAGNOSE, "", "", more), message);
    let columns = |what, from, to, message| case(what, nothing, &line(&COLUMN, from, to, &[]), message);
    vec![
        with("alpha 0", &["--alpha", "0"], &["--alpha is 0", "above 0"]),
        with("alpha 1", &["--alpha", "1"], &["--alpha is 1", "below 0.5"]),
        with("alpha NaN", &["--alpha", "nan"], &["--alpha is NaN"]),
        with("no such mechanism", &["--consider", "stiction@state:v"], &["stiction", "docs/catalogue.md"]),
        with("no such place", &["--consider", "coulomb_friction@state:w"], &["cannot stand at `state:w`", "state:v"]),
        with("no thread", &["--threads", "0"], &["--threads is 0"]),
        with("a million threads", &["--threads", "1000000"], &["--threads is 1000000"]),
        with("no time", &["--time-limit", "0"], &["--time-limit is 0"]),
        with("time before now", &["--time-limit=-3"], &["--time-limit is -3"]),
        with("endless time", &["--time-limit", "inf"], &["--time-limit is inf"]),
        case(
            "a file as --out",
            nothing,
            &line(&DIAGNOSE, "out", "notes.txt", &[]),
            &["--out notes.txt", "not a folder"],
        ),
        case(
            "a folder in the place of a result",
            |dir| std::fs::create_dir_all(dir.join("taken/diagnosis.json")).unwrap(),
            &line(&DIAGNOSE, "out", "taken", &[]),
            &["--out taken: taken/diagnosis.json cannot be written", "folder"],
        ),
        case(
            "a folder in a file as --out",
            nothing,
            &line(&DIAGNOSE, "out", "notes.txt/out", &[]),
            &["--out notes.txt/out"],
        ),
        case(
            "--out where nothing may be written",
            nothing,
            &line(&DIAGNOSE, "out", "/proc/hysid", &[]),
            &["--out /proc/hysid"],
        ),
        columns("the simulated column is not there", "s_m", "z_m", &["est.csv, column `z_m`", "`s_m`"]),
        columns("the input is not there", "u_N", "z_N", &["est.csv, column `z_N`"]),
        columns("the output is not there", "x_m", "z_m", &["est.csv, column `z_m`"]),
        columns("the simulated column is the output", "s_m", "x_m", &["--simulated x_m: this column is given twice"]),
        columns("the input is the output", "u_N", "x_m", &["--output x_m: this column is given twice"]),
        columns("the time is the input", "u_N", "t_s", &["--input t_s: this is the time column"]),
        columns("the time is the output", "x_m", "t_s", &["--output t_s: this is the time column"]),
        case(
            "no clock in column mode",
            recording("est.csv", |t| t.replacen("t_s", "n", 1)),
            &COLUMN,
            &["est.csv", "t_s"],
        ),
        case(
            "a constant simulated column",
            recording("est.csv", column(4, |_| "2".into())),
            &COLUMN,
            &["est.csv", "`s_m`", "constant"],
        ),
        case(
            "a constant output in column mode",
            recording("est.csv", column(3, |_| "2".into())),
            &COLUMN,
            &["est.csv", "`x_m`", "constant"],
        ),
        case("one sample in column mode", recording("est.csv", first(2)), &COLUMN, &["est.csv", "1 sample;"]),
    ]
}

#[test]
fn each_kind_of_bad_input_ends_with_one_clear_message_and_nothing_written() {
    let cases: Vec<Case> = simulations().into_iter().chain(recordings()).chain(requests()).collect();
    assert!(cases.len() >= 30, "{}", cases.len());
    let mut wrong = String::new();
    for c in &cases {
        let dir = OscillatorFiles::write(300);
        std::fs::create_dir(dir.path().join("folder")).unwrap();
        std::fs::write(dir.path().join("notes.txt"), "mine").unwrap();
        (c.spoil)(dir.path());
        let before = files_of(dir.path());
        let (status, _, stderr) = hysid(&c.line, dir.path());
        // Progress is told on stderr too, in lines that end so.
        let told: Vec<&str> = stderr.lines().filter(|l| !l.ends_with(" ...")).collect();
        let mut complain = |problem: String| wrong += &format!("{}: {problem}: {stderr}\n", c.what);
        if status != 2 {
            complain(format!("exit status {status}"));
        }
        if told.len() != 1 || stderr.contains("panicked") {
            complain("not one message".into());
        }
        for fragment in c.message.iter().filter(|f| !stderr.contains(**f)) {
            complain(format!("no `{fragment}`"));
        }
        if files_of(dir.path()) != before || dir.path().join("out").exists() {
            complain(format!("files were left: {:?}", files_of(dir.path())));
        }
    }
    assert!(wrong.is_empty(), "{wrong}");
}

#[test]
fn options_that_do_not_exist_or_do_not_go_together_are_refused() {
    let dir = OscillatorFiles::write(60);
    let with = |more: &[&'static str]| line(&DIAGNOSE, "", "", more);
    let cases: Vec<(Vec<&str>, &str)> = vec![
        (with(&["--treads", "2"]), "--treads"),
        (with(&["--seed", "-1"]), "-1"),
        (with(&["--seed", "one"]), "one"),
        (with(&["--alpha", "small"]), "small"),
        (with(&["--simulated", "s_m", "--input", "u_N", "--output", "x_m"]), "--simulated"),
        (with(&["--output", "x_m"]), "--simulated"),
        (with(&["second.sim.toml"]), "second.sim.toml"),
        (line(&DIAGNOSE[..6], "", "", &[]), "--out"),
        (vec!["diagnose", "base.sim.toml", "--out", "out"], "--recording"),
        (vec!["diagnose", "--recording", "est.csv", "--out", "out"], "SIMULATION"),
        (vec!["diagnose", "--simulated", "s_m", "--recording", "est.csv", "--out", "out"], "--input"),
    ];
    let before = files_of(dir.path());
    for (args, fragment) in cases {
        let (status, _, stderr) = hysid(&args, dir.path());
        assert!(
            status == 2 && stderr.starts_with("hysid: ") && stderr.lines().count() == 1,
            "{args:?}: {status} {stderr}"
        );
        assert!(stderr.contains(fragment), "{args:?}: {stderr}");
        assert_eq!(files_of(dir.path()), before);
    }
}
