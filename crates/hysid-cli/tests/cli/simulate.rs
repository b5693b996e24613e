//! `hysid simulate`: what it writes and how it fails.

use std::path::Path;

use assert_cmd::Command;

const SIMULATION: &str = r#"
[time]
column = "t_s"
[inputs]
u = "u_V"
[parameters]
tau = { value = 0.5, min = 0.01, max = 10.0, unit = "s" }
[states]
x = { derivative = "(u - x)/tau", initial = "free" }
[outputs]
y_V = "x"
twice_V = "2*x"
"#;

fn csv(measured: bool) -> String {
    let mut text = String::from(if measured { "t_s,u_V,y_V,twice_V\n" } else { "t_s,u_V\n" });
    for n in 0..200 {
        let t = 0.01 * f64::from(n);
        let y = 1.0 + (3.0 - 1.0) * (-t / 0.5).exp();
        text += &if measured { format!("{t:.2},1.0,{y},{}\n", 2.0 * y) } else { format!("{t:.2},1.0\n") };
    }
    text
}

fn run(folder: &Path, simulation: &str, input: &str) -> assert_cmd::assert::Assert {
    std::fs::write(folder.join("a.sim.toml"), simulation).expect("writes");
    std::fs::write(folder.join("in.csv"), input).expect("writes");
    let mut command = Command::new(assert_cmd::cargo::cargo_bin!("hysid"));
    command.current_dir(folder).args(["simulate", "a.sim.toml", "--input", "in.csv", "--out", "out.csv"]).assert()
}

fn columns(folder: &Path) -> (String, Vec<Vec<f64>>) {
    let text = std::fs::read_to_string(folder.join("out.csv")).expect("written");
    let mut lines = text.lines();
    let header = lines.next().expect("a header").to_owned();
    (header, lines.map(|l| l.split(',').map(|x| x.parse().unwrap_or(f64::NAN)).collect()).collect())
}

#[test]
fn it_writes_the_time_and_one_column_for_each_output() {
    let folder = tempfile::tempdir().expect("a folder");
    run(folder.path(), SIMULATION, &csv(false)).success();
    let (header, rows) = columns(folder.path());
    assert_eq!(header, "t_s,y_V,twice_V");
    assert_eq!(rows.len(), 200);
    // From rest at 0, as nothing was measured.
    let (t, y, twice) = (rows[150][0], rows[150][1], rows[150][2]);
    assert!((t - 1.5).abs() < 1e-12 && (y - (1.0 - (-3.0_f64).exp())).abs() < 1e-6 && (twice - 2.0 * y).abs() < 1e-12);
}

#[test]
fn a_free_initial_state_follows_the_first_measured_samples() {
    let folder = tempfile::tempdir().expect("a folder");
    let told = run(folder.path(), SIMULATION, &csv(true)).success();
    assert!(String::from_utf8_lossy(&told.get_output().stderr).contains("first 10 measured samples"));
    let (_, rows) = columns(folder.path());
    assert!((rows[0][1] - 3.0).abs() < 1e-6, "{:?}", rows[0]);
}

#[test]
fn a_missing_input_leaves_a_gap() {
    let folder = tempfile::tempdir().expect("a folder");
    run(folder.path(), SIMULATION, &csv(false).replace("0.50,1.0", "0.50,")).success();
    let (_, rows) = columns(folder.path());
    assert!(rows[50][1].is_nan() && rows[49][1].is_finite() && rows[51][1].is_finite());
}

#[test]
fn bad_input_ends_with_status_2_and_leaves_no_file() {
    let explodes = SIMULATION.replace("(u - x)/tau", "50*x^3 + u");
    let divides = SIMULATION.replace("(u - x)/tau", "u/(x*tau)");
    for (simulation, input, words) in [
        (SIMULATION.replace("tau)", "tau").replace("/tau", "/tua"), csv(false), "unknown symbol `tua`"),
        (SIMULATION.replace("u_V", "v_V"), csv(false), "v_V"),
        (SIMULATION.replace("t_s", "time"), csv(false), "time"),
        (SIMULATION.to_owned(), csv(false).replace("0.50,1.0", "0.50,one"), "one"),
        (SIMULATION.to_owned(), csv(false).replace("0.50,1.0", "0.58,1.0"), "t_s"),
        (SIMULATION.to_owned(), String::new(), "in.csv"),
        (
            SIMULATION.to_owned(),
            csv(true).replace("0.50,1.0,", "0.50,1.0,oops"),
            "in.csv, line 52, column `y_V`: `oops",
        ),
        (SIMULATION.to_owned(), csv(true).replace("1.99,1.0,", "1.99,1.0,1e"), "in.csv, line 201, column `y_V`"),
        (explodes, csv(false), "`states.x.derivative`: state `x` explodes"),
        (divides, csv(false), "`states.x.derivative`: the derivative of state `x` is inf at the first sample"),
        (SIMULATION.replace("2*x", "2*x/(u - u)"), csv(true), "`outputs.twice_V`: output `twice_V` is"),
    ] {
        let folder = tempfile::tempdir().expect("a folder");
        let failed = run(folder.path(), &simulation, &input).code(2);
        let stderr = String::from_utf8_lossy(&failed.get_output().stderr).into_owned();
        assert!(stderr.contains(words) && stderr.lines().count() == 1, "{words}: {stderr}");
        assert!(!folder.path().join("out.csv").exists());
    }
}

#[test]
fn an_output_column_without_a_measurement_is_no_fault() {
    let folder = tempfile::tempdir().expect("a folder");
    let rows = (0..200).map(|n| format!("{:.2},1.0,,{n}\n", 0.01 * f64::from(n)));
    let input = "t_s,u_V,y_V,twice_V\n".to_owned() + &rows.collect::<String>();
    let told = run(folder.path(), SIMULATION, &input).success();
    assert_eq!(String::from_utf8_lossy(&told.get_output().stderr), "free initial states (x): 0\n");
}

#[test]
fn where_the_result_cannot_go_is_found_before_the_work() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::create_dir(folder.path().join("out.csv")).expect("a folder");
    // The input's fault would be told first if it were read first.
    let failed = run(folder.path(), SIMULATION, "").code(2);
    let stderr = String::from_utf8_lossy(&failed.get_output().stderr).into_owned();
    assert_eq!(stderr, "hysid: out.csv cannot be written: it is a folder; name a file\n");
}
