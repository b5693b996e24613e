//! What is wrong with a simulation file is told with its place and in words; nothing panics.

use hysid_plant::Simulation;

/// Replaces `from` in the manual's example by `to`.
fn edited(from: &str, to: &str) -> String {
    assert!(crate::common::OSCILLATOR.contains(from), "the example has no `{from}`");
    crate::common::OSCILLATOR.replacen(from, to, 1)
}

#[test]
fn every_kind_of_bad_file_is_told() {
    // (what is replaced, by what, place, words in the message)
    let v = "(u - c*v - k*x)/m";
    let cases: &[(&str, &str, &str, &[&str])] = &[
        ("[time]", "[time", "3:", &["not TOML"]),
        ("u = \"force_N\"", "u = force_N", "7:", &["not TOML", "in quotes"]),
        ("initial = 0.0, unit = \"m\"", "initial = free, unit = \"m\"", "", &["not TOML", "in quotes"]),
        ("title = \"Oscillator\"", "title = 3", "1:9", &["`title`", "a text in quotes", "integer"]),
        ("title", "titel", "1:1", &["`titel`", "unknown key", "title"]),
        ("period_s = 0.01", "period = 0.01", "4:1", &["`time.period`", "unknown key", "period_s"]),
        ("period_s = 0.01", "hold = \"zero\"", "", &["`time`", "missing"]),
        ("period_s = 0.01", "period_s = 0.0", "4:12", &["sampling period", "above 0"]),
        ("period_s = 0.01", "period_s = \"0.01\"", "4:12", &["a number is expected", "string"]),
        ("period_s = 0.01", "column = \"t_s\"\nperiod_s = 0.01", "5:12", &["`time.period_s`", "already"]),
        ("period_s = 0.01", "period_s = 0.01\nhold = \"cubic\"", "5:8", &["linear", "zero", "cubic"]),
        ("[time]\nperiod_s = 0.01", "", "", &["`[time]` is missing"]),
        ("u = \"force_N\"", "u = 3", "7:5", &["`inputs.u`", "text"]),
        ("u = \"force_N\"", "u = \"\"", "7:5", &["name of a column"]),
        ("u = \"force_N\"", "u = \"force_N\"\nu = \"x\"", "8:1", &["not TOML", "duplicate key `u`"]),
        ("[states]", "[inputs]\nw = \"w_N\"\n[states]", "14:", &["not TOML", "duplicate key `inputs`"]),
        ("u = \"force_N\"", "u = \"force_N\"\nm = \"m_kg\"", "", &["`m` is already an input"]),
        ("u = \"force_N\"", "u = \"x_m\"", "", &["`x_m` is already", "input `u`"]),
        ("u = \"force_N\"", "sin = \"force_N\"", "7:1", &["`sin` is reserved"]),
        ("u = \"force_N\"", "t = \"force_N\"", "7:1", &["`t` is reserved"]),
        ("u = \"force_N\"", "2u = \"force_N\"", "7:1", &["`2u` cannot be a symbol"]),
        ("u = \"force_N\"", "\"u v\" = \"force_N\"", "7:1", &["cannot be a symbol"]),
        ("value = 2.0", "valeu = 2.0", "10:7", &["`parameters.m.valeu`", "unknown key", "value"]),
        ("value = 2.0, ", "", "10:5", &["`value` is missing"]),
        ("value = 2.0", "value = nan", "10:15", &["finite"]),
        ("value = 2.0", "value = inf", "10:15", &["finite"]),
        ("value = 2.0", "value = 9.0", "10:15", &["9", "above its upper bound 8"]),
        ("value = 2.0", "value = 0.1", "10:15", &["0.1", "below its lower bound 0.5"]),
        ("min = 0.5, max = 8.0", "min = 8.0, max = 0.5", "10:26", &["lower bound", "below the upper bound"]),
        (", min = 0.5, max = 8.0", "", "10:5", &["`parameters.m`", "needs `min` or `max`", "fixed"]),
        ("unit = \"kg\"", "unit = \"kg//m\"", "10:", &["not a unit", "N s/m"]),
        ("unit = \"kg\"", "unit = \"kg^0.37\"", "10:", &["not a unit", "only exponents such as"]),
        ("unit = \"kg\"", "fixed = \"yes\"", "10:", &["true or false"]),
        ("m = { value = 2.0, min = 0.5, max = 8.0, unit = \"kg\" }", "m = 2.0", "10:5", &["a table is expected"]),
        ("derivative = \"v\", ", "", "15:5", &["`derivative` is missing"]),
        ("derivative = \"v\", initial = 0.0", "derivative = \"v\"", "15:5", &["`initial` is missing"]),
        (v, "(u - c*w - k*x)/m", "16:28", &["unknown symbol `w`", "known: u m c k x v"]),
        (v, "(u - c*V - k*x)/m", "16:28", &["unknown symbol `V`", "is `v` meant?"]),
        (v, "(force_N - c*v)/m", "16:22", &["`force_N` is called `u`"]),
        (v, "(u - c*v - k*x/m", "16:21", &["never closed"]),
        (v, "u - c*v)/m", "16:28", &["without its `(`"]),
        (v, "u - c v", "16:27", &["operator", "missing"]),
        (v, "u - 2v", "16:26", &["write `*`"]),
        (v, "u -", "16:24", &["ends where"]),
        (v, "", "16:21", &["ends where"]),
        (v, "u - c**v", "16:26", &["`**`", "`^`"]),
        (v, "u*(x > 0)", "16:26", &["step(a - b)"]),
        (v, "u + sgn(v)", "16:25", &["`sgn` is not a function", "sign"]),
        (v, "u + sin", "16:25", &["`sin` is a function"]),
        (v, "atan2(u)", "16:21", &["takes 2 arguments, not 1"]),
        (v, "u; v", "16:22", &["`;` is not allowed"]),
        (v, "u + 1e999", "16:25", &["too large"]),
        (v, "u + c", "16:", &["units clash", "N s/m", "m/s^2"]),
        (v, "(u - c*v - k*v)/m", "16:", &["units clash", "c*v", "k*v"]),
        (v, "(u - sin(x))/m - sin(c)", "16:", &["units clash", "pure number"]),
        (v, "(u - k*play(x, m))/m", "16:", &["units clash", "kg"]),
        (v, "u*delay(u, m)", "16:", &["units clash", "seconds"]),
        (v, "play(x, v)", "16:", &["half-width", "parameters"]),
        (v, "u*d(x)", "16:", &["`d(w)`", "input"]),
        (v, "u - k*play(x, -0.1)/m", "16:27", &["half-width of `play` is -0.1", "not be below 0"]),
        (v, "play(x, k) + play(x, 1 - 2*pi)", "16:34", &["half-width of `play` is -5.283"]),
        (v, "u - play(u, sqrt(-1))", "16:25", &["half-width of `play` is NaN", "finite"]),
        (v, "u + relay(x, 0.2, min(0.1, 3))", "16:25", &["lower threshold of `relay` is 0.2", "upper one, 0.1"]),
        (v, "u + relay(x, 0.2, 1/0)", "16:25", &["threshold of `relay` is inf", "finite"]),
        (v, "u + delay(u, -0.1)", "16:25", &["delay of `delay` is -0.1"]),
        (v, "u + delay(u, 0/0)", "16:25", &["delay of `delay` is NaN"]),
        (v, "lag(lag(u, 0.1), -0.1)", "16:21", &["time constant of `lag` is -0.1"]),
        (v, "lag(lag(u, -0.1), 0.1)", "16:25", &["time constant of `lag` is -0.1"]),
        ("initial = 0.0, unit = \"m\" }", "initial = \"x\" }", "15:", &["cycle", "x -> x"]),
        ("initial = 0.0, unit = \"m\" }", "initial = \"v\" }", "15:", &["expression of parameters", "state `v`"]),
        ("initial = 0.0, unit = \"m\" }", "initial = \"u\" }", "15:", &["changes with time"]),
        ("initial = 0.0, unit = \"m\" }", "initial = \"fre\" }", "15:", &["unknown symbol `fre`"]),
        ("initial = 0.0, unit = \"m\" }", "initial = 0.0, units = \"m\" }", "15:", &["unknown key", "unit"]),
        ("[outputs]\nx_m = \"x\"", "", "", &["`[outputs]` is missing"]),
        ("x_m = \"x\"", "", "", &["there is no output"]),
        ("x_m = \"x\"", "x_m = \"2*m\"", "19:7", &["constant"]),
        ("x_m = \"x\"", "x_m = \"x - x\"", "19:7", &["`outputs.x_m`", "constant"]),
        ("x_m = \"x\"", "x_m = \"2*u\"", "19:7", &["depends on any state"]),
        ("x_m = \"x\"", "x_m = [1, 2]", "19:7", &["an expression in quotes"]),
        ("x_m = \"x\"", "x_m = \"x\"\n[options]\na = 1", "20:", &["`options`", "unknown key"]),
    ];
    assert!(cases.len() >= 30);
    let mut wrong = Vec::new();
    for (from, to, place, words) in cases {
        let text = edited(from, to);
        let message = match Simulation::parse(&text, "bad.sim.toml") {
            Ok(_) => "accepted".to_owned(),
            Err(error) => error.to_string(),
        };
        let start = if place.is_empty() { "bad.sim.toml".to_owned() } else { format!("bad.sim.toml:{place}") };
        let told = message.starts_with(&start) && words.iter().all(|word| message.contains(word));
        if !told || message.lines().count() != 1 {
            wrong.push(format!("`{to}`: expected at {place} with {words:?}: {message}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn numbers_at_the_edge_and_parameters_are_left_to_operators_with_memory() {
    for good in [
        "lag(u, 0)",
        "delay(u, 0)",
        "play(u, 0)",
        "relay(u, 0.1, 0.1)",
        "lag(u, 0.1 - m)",
        "relay(x, k, -k)",
        "play(u, abs(-0.1))",
    ] {
        // Without units, which would not fit.
        let text = edited("(u - c*v - k*x)/m", good);
        let text = ["kg", "N s/m", "N/m", "m", "m/s"]
            .iter()
            .fold(text, |t, unit| t.replace(&format!(", unit = \"{unit}\""), ""));
        Simulation::parse(&text, "good").unwrap_or_else(|e| panic!("{good}: {e}"));
    }
}

#[test]
fn long_names_are_cut_and_line_ends_escaped() {
    let long = "x".repeat(5000);
    for (from, to) in [
        ("unit = \"kg\"", format!("unit = \"{long}^3.37\"")),
        ("title", long.clone()),
        ("(u - c*v - k*x)/m", long.clone()),
        ("u = \"force_N\"", format!("\"a\\n{long}\" = \"force_N\"")),
    ] {
        let message = Simulation::parse(&edited(from, &to), "long").expect_err("it is bad").to_string();
        assert!(message.contains('…') && message.chars().count() < 400, "{message}");
        assert_eq!(message.lines().count(), 1, "{message}");
    }
}

#[test]
fn initial_values_in_a_ring_are_told_as_such() {
    let text = crate::common::OSCILLATOR.replacen("initial = 0.0, unit = \"m\" }", "initial = \"v\" }", 1).replacen(
        "initial = 0.0, unit = \"m/s\" }",
        "initial = \"x\" }",
        1,
    );
    let message = Simulation::parse(&text, "ring").expect_err("a ring").to_string();
    assert!(message.contains("cycle: x -> v -> x"), "{message}");
}

#[test]
fn depth_and_length_are_bounded() {
    for bad in ["(".repeat(100_000), "-".repeat(100_000), "1+".repeat(100_000), "x^".repeat(100_000)] {
        assert!(hysid_plant::Expr::parse(&bad).is_err());
    }
    let long = format!("title = \"{}\"", "x".repeat(2 << 20));
    assert!(Simulation::parse(&long, "long").is_err());
}
