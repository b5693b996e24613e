//! Small simulations written in a line or two, and a drive for them.

use hysid_plant::{Compiled, Drive, Response, Run, Simulation};

pub fn compile(text: &str) -> Compiled {
    let simulation = Simulation::parse(text, "test.sim.toml").unwrap_or_else(|e| panic!("{e}"));
    Compiled::new(&simulation).expect("valid")
}

/// A simulation with these parameters (name, value), states (name, derivative, initial) and outputs.
pub fn model(
    hold: &str,
    parameters: &[(&str, f64)],
    states: &[(&str, &str, &str)],
    outputs: &[(&str, &str)],
) -> Compiled {
    let mut text = format!("[time]\nperiod_s = 0.01\nhold = \"{hold}\"\n[inputs]\nu = \"u_V\"\n[parameters]\n");
    for (name, value) in parameters {
        text += &format!("{name} = {{ value = {value:?}, min = -1e6, max = 1e6 }}\n");
    }
    if !states.is_empty() {
        text += "[states]\n";
    }
    for (name, derivative, initial) in states {
        text += &format!("{name} = {{ derivative = \"{derivative}\", initial = {initial} }}\n");
    }
    text += "[outputs]\n";
    for (name, expression) in outputs {
        text += &format!("{name} = \"{expression}\"\n");
    }
    compile(&text)
}

pub fn drive(len: usize, u: impl Fn(f64) -> f64) -> Drive {
    Drive::new(0.0, 0.01, len, vec![(0..len).map(|n| u(0.01 * n as f64)).collect()]).expect("valid")
}

pub fn largest_error(y: &[f64], exact: impl Fn(f64) -> f64) -> f64 {
    y.iter().enumerate().map(|(n, y)| (y - exact(0.01 * n as f64)).abs()).fold(0.0, f64::max)
}

pub fn simulate(compiled: &Compiled, drive: &Drive, substeps: usize) -> Response {
    let theta = compiled.theta();
    compiled.simulate(&Run::new(drive, &theta).with_substeps(substeps))
}

/// Name, hold, parameters, states, outputs.
pub type Case = (
    &'static str,
    &'static str,
    &'static [(&'static str, f64)],
    &'static [(&'static str, &'static str, &'static str)],
    &'static [(&'static str, &'static str)],
);

pub const CASES: &[Case] = &[
    (
        "a play that widens with the rate",
        "linear",
        &[("m", 2.0), ("c", 3.0), ("k", 200.0), ("r", 0.2), ("lambda", 0.1)],
        &[("x", "v", "\"free\""), ("v", "(play(u, r*(1 + lambda*abs(d(u)))) - c*v - k*x)/m", "0.0")],
        &[("x_m", "x")],
    ),
    (
        "oscillator",
        "linear",
        &[("m", 2.0), ("c", 3.0), ("k", 200.0)],
        &[("x", "v", "\"free\""), ("v", "(u - c*v - k*x)/m", "\"free\"")],
        &[("y", "x"), ("a", "(u - c*v - k*x)/m")],
    ),
    (
        "coulomb",
        "zero",
        &[("m", 2.0), ("c", 1.0), ("F_c", 3.0), ("k", 150.0)],
        &[("x", "v", "0.01"), ("v", "(20*u - c*v - k*x - F_c*sign(v))/m", "0.0")],
        &[("y", "x"), ("f", "F_c*sign(v)")],
    ),
    (
        "coulomb, linear",
        "linear",
        &[("m", 2.0), ("c", 1.0), ("F_c", 5.0)],
        &[("v", "(20*u - c*v - F_c*sign(v))/m", "0.0")],
        &[("y", "v")],
    ),
    (
        "asymmetric with step and drop",
        "linear",
        &[("p", 2.0), ("n", 3.0), ("k", 150.0), ("g", 0.03)],
        &[("x", "v", "\"free\""), ("v", "20*u - v - k*x - p*step(v) + n*step(-v) - 300*step(x - g)*(x - g)", "0.0")],
        &[("y", "x")],
    ),
    (
        "bouc-wen",
        "linear",
        &[("k", 100.0), ("b", 40.0), ("g", 10.0), ("n", 1.5)],
        &[
            ("x", "v", "0.0"),
            ("v", "20*u - v - k*x - 30*z", "0.0"),
            ("z", "v - b*abs(v)*abs(z)^(n - 1)*z - g*v*abs(z)^n", "0.0"),
        ],
        &[("y", "x")],
    ),
    (
        "memory of states and inputs",
        "linear",
        &[("k", 100.0), ("r", 0.02), ("tau", 0.05), ("s", 0.033)],
        &[("x", "v", "0.0"), ("v", "20*lag(u, tau) - 3*v - k*delay(x, s) - 20*play(x, r)", "0.0")],
        &[("y", "lag(x, tau) + delay(u, s)")],
    ),
    (
        "held and delayed",
        "zero",
        &[("k", 100.0), ("tau", 0.05), ("s", 0.033)],
        &[("x", "v", "0.0"), ("v", "20*delay(u, s) + lag(u, tau) - 3*v - k*x", "0.0")],
        &[("y", "x")],
    ),
    (
        "functions",
        "linear",
        &[("p", 0.7), ("q", 1.3)],
        &[("x", "sin(p*u) + cos(q*x)*exp(-x^2) - atan2(x, q) - tanh(p*x)", "\"p*q/10\"")],
        &[
            ("y", "sqrt(1 + x^2)*ln(2 + q^p) + min(x, p/10) + max(x, 0.1)*log10(3 + abs(x)^q)"),
            ("z", "asin(x/9) + x/q"),
        ],
    ),
];

pub fn wobble(t: f64) -> f64 {
    (7.3 * t).sin() + 0.6 * (13.1 * t + 1.0).sin() + 0.3 * (3.1 * t).cos()
}
