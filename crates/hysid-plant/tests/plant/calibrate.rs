//! Calibration recovers what made the data, from wrong starts, under noise.

use hysid_plant::{Compiled, Data, Drive, Effort, Flag, Run, Settings, Simulation, Start};
use hysid_signal::{Excitation, white_noise};

/// A simulation text and the true parameters of its data.
#[derive(Clone, Copy)]
struct Case<'a> {
    name: &'a str,
    text: &'a str,
    truth: &'a [f64],
    initial: &'a [f64],
    input: fn(usize, f64) -> Vec<f64>,
    noise: f64,
    /// Largest relative error of a parameter.
    allowed: f64,
}

fn multisine(n: usize, amplitude: f64) -> Vec<f64> {
    let shape = Excitation::Multisine { lowest_hz: 0.1, highest_hz: 6.0, period: 0 };
    shape.signal(n, 0.01, amplitude, 5).expect("valid")
}

fn steps(n: usize, amplitude: f64) -> Vec<f64> {
    Excitation::Steps { hold: 60 }.signal(n, 0.01, amplitude, 3).expect("valid")
}

const RESONANT: &str = r#"
[time]
period_s = 0.01
[inputs]
u = "u_N"
[parameters]
m = { value = 2.6, min = 0.5, max = 8.0 }
c = { value = 0.6, min = 0.01, max = 30.0 }
k = { value = 140.0, min = 20.0, max = 2000.0 }
[states]
x = { derivative = "v", initial = "free" }
v = { derivative = "(u - c*v - k*x)/m", initial = "free" }
[outputs]
x_m = "x"
"#;

pub const DRIVE: &str = r#"
[time]
period_s = 0.01
hold = "zero"
[inputs]
u = "u_N"
[parameters]
m = { value = 1.4, min = 0.1, max = 20.0 }
c = { value = 3.0, min = 0.0, max = 50.0 }
F_c = { value = 0.5, min = 0.0, max = 20.0 }
[states]
x = { derivative = "v", initial = 0.0 }
v = { derivative = "(u - c*v - F_c*sign(v))/m", initial = 0.0 }
[outputs]
x_m = "x"
"#;

const FIRST_ORDER: &str = r#"
[time]
period_s = 0.01
[inputs]
u = "u_V"
[parameters]
g = { value = 1.0, min = 0.0 }
tau = { value = 0.6, min = 0.01, max = 10.0 }
y0 = { value = 0.0, min = -1.0, max = 1.0 }
[states]
x = { derivative = "(g*u - x)/tau", initial = "free" }
[outputs]
y_C = "x + y0"
"#;

const STATIC: &str = r#"
[time]
period_s = 0.01
[inputs]
x = "x_mm"
[parameters]
c = { value = 0.1, min = -10.0, max = 50.0 }
k = { value = 1.0, min = -50.0, max = 100.0 }
F = { value = 0.2, min = 0.0, max = 200.0 }
r = { value = 0.2, min = 0.0, max = 3.0 }
[outputs]
F_N = "c*d(x) + k*x + F*tanh(5*d(x)) + 4*play(x, r)"
"#;

const TWO_MASSES: &str = r#"
[time]
period_s = 0.01
[inputs]
u = "u_N"
[parameters]
m1 = { value = 1.5, min = 0.2, max = 8.0 }
m2 = { value = 0.5, min = 0.1, max = 4.0 }
c = { value = 0.8, min = 0.01, max = 30.0 }
k1 = { value = 150.0, min = 20.0, max = 2000.0 }
k2 = { value = 250.0, min = 20.0, max = 2000.0 }
[states]
x1 = { derivative = "v1", initial = 0.0 }
v1 = { derivative = "(u - c*v1 - k1*x1 - k2*(x1 - x2))/m1", initial = 0.0 }
x2 = { derivative = "v2", initial = 0.0 }
v2 = { derivative = "(k2*(x1 - x2) - c*v2)/m2", initial = 0.0 }
[outputs]
x1_m = "x1"
x2_m = "x2"
"#;

const CASES: &[Case<'static>] = &[
    Case {
        name: "resonant oscillator",
        text: RESONANT,
        truth: &[2.0, 1.2, 200.0],
        initial: &[0.02, -0.1],
        input: multisine,
        noise: 0.02,
        allowed: 0.03,
    },
    Case {
        name: "friction drive",
        text: DRIVE,
        truth: &[2.0, 2.0, 1.5],
        initial: &[],
        input: steps,
        noise: 0.01,
        allowed: 0.06,
    },
    Case {
        name: "first order",
        text: FIRST_ORDER,
        truth: &[2.5, 0.35, 0.15],
        initial: &[0.4],
        input: steps,
        noise: 0.05,
        allowed: 0.2,
    },
    Case {
        name: "static",
        text: STATIC,
        truth: &[0.4, 2.0, 1.5, 0.5],
        initial: &[],
        input: multisine,
        noise: 0.03,
        allowed: 0.1,
    },
    Case {
        name: "two masses",
        text: TWO_MASSES,
        truth: &[1.0, 0.7, 0.5, 200.0, 180.0],
        initial: &[],
        input: multisine,
        noise: 0.02,
        allowed: 0.05,
    },
];

pub fn compile(text: &str) -> Compiled {
    Compiled::new(&Simulation::parse(text, "case").unwrap_or_else(|e| panic!("{e}"))).expect("valid")
}

pub fn noisy(clean: &[f64], noise: f64, seed: u64) -> Vec<f64> {
    let mean = clean.iter().sum::<f64>() / clean.len() as f64;
    let variance = clean.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / clean.len() as f64;
    let e = white_noise(clean.len(), noise * noise * variance, seed).expect("valid");
    clean.iter().zip(e).map(|(y, e)| y + e).collect()
}

fn data(case: &Case<'_>, compiled: &Compiled, n: usize, seed: u64) -> Data {
    let drive = Drive::new(0.0, 0.01, n, vec![(case.input)(n, 5.0)]).expect("valid");
    let run = Run::new(&drive, case.truth).from(Start::Document(case.initial)).with_substeps(8);
    let clean = compiled.simulate(&run);
    assert_eq!(clean.diverged, None, "{}", case.name);
    let measured = clean.outputs.iter().enumerate().map(|(j, y)| noisy(y, case.noise, seed + j as u64)).collect();
    Data::new(compiled, case.name, drive, measured).expect("valid")
}

#[test]
fn parameters_are_found_from_wrong_starts() {
    for case in CASES {
        let compiled = compile(case.text);
        for seed in [1, 2] {
            let data = data(case, &compiled, 2000, seed * 100);
            let result = compiled.calibrate(std::slice::from_ref(&data), &Settings::default()).expect("calibrates");
            for (i, (found, truth)) in result.theta.iter().zip(case.truth).enumerate() {
                let error = (found - truth).abs() / truth.abs();
                assert!(error < case.allowed, "{} seed {seed}, {i}: {found} for {truth}", case.name);
            }
            // The residual is the noise.
            for (j, rmse) in result.rmse.iter().enumerate() {
                let y = &data.measured[j];
                let mean = y.iter().sum::<f64>() / y.len() as f64;
                let rms = (y.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / y.len() as f64).sqrt();
                assert!((0.9..1.1).contains(&(rmse / (case.noise * rms))), "{}: {}", case.name, rmse / rms);
            }
            let covered = result.estimated.iter().filter(|&&i| {
                let (low, high) = result.interval(i).expect("estimated");
                let slack = high - low;
                (low - slack..high + slack).contains(&case.truth[i])
            });
            assert_eq!(covered.count(), case.truth.len(), "{}: intervals", case.name);
        }
    }
}

#[test]
fn what_is_behind_a_converter_is_calibrated() {
    let coarse = RESONANT
        .replace("x_m = \"x\"", "x_m = \"q*floor(x/q + 0.5)\"")
        .replace("[states]", "q = { value = 0.02, fixed = true }\n[states]");
    let case = Case { text: &coarse, noise: 0.002, name: "converter", ..CASES[0] };
    let compiled = compile(case.text);
    let truth = [2.0, 1.2, 200.0, 0.02];
    let data = data(&Case { truth: &truth, ..case }, &compiled, 2000, 7);
    let result = compiled.calibrate(&[data], &Settings::default()).expect("calibrates");
    for (found, truth) in result.theta.iter().zip(truth) {
        assert!((found / truth - 1.0).abs() < 0.01, "{:?} for {truth}", result.theta);
    }
}

#[test]
fn coloured_noise_is_weighted_by_its_colour() {
    let case = &CASES[0];
    let compiled = compile(case.text);
    let mut data = data(&Case { noise: 0.0, ..*case }, &compiled, 4000, 1);
    let noise = hysid_signal::autoregressive_noise(&[0.95], 4000, 1e-6, 4).expect("valid");
    data.measured[0].iter_mut().zip(&noise).for_each(|(y, e)| *y += e);
    let result = compiled.calibrate(&[data], &Settings::default()).expect("calibrates");
    let a = result.noise[0].coefficients();
    assert!(!a.is_empty() && (a[0] - 0.95).abs() < 0.05, "{a:?}");
    for (found, truth) in result.theta.iter().zip(case.truth) {
        assert!((found - truth).abs() < 0.05 * truth, "{:?}", result.theta);
    }
}

#[test]
fn a_gap_splits_a_recording_and_missing_outputs_do_not_count() {
    let case = &CASES[0];
    let compiled = compile(case.text);
    let whole = data(case, &compiled, 3000, 9);
    let channel = |name: &str, samples: Vec<f64>| hysid_signal::Channel { name: name.to_owned(), samples };
    let mut u = whole.drive.inputs()[0].clone();
    let mut y = whole.measured[0].clone();
    u[1500..1520].fill(f64::NAN);
    y[400..430].fill(f64::NAN);
    let clock = hysid_signal::Clock { start_s: 0.0, period_s: 0.01 };
    let recording =
        hysid_signal::Recording::new("gaps", clock, vec![channel("u_N", u), channel("x_m", y)]).expect("valid");
    let parts = Data::from_recording(&compiled, &recording).expect("usable");
    assert_eq!(parts.iter().map(|d| (d.offset, d.len())).collect::<Vec<_>>(), [(0, 1500), (1520, 1480)]);
    let result = compiled.calibrate(&parts, &Settings::default()).expect("calibrates");
    for (found, truth) in result.theta.iter().zip(case.truth) {
        assert!((found - truth).abs() < 0.03 * truth, "{:?}", result.theta);
    }
    assert!(result.residuals[0][0][410].is_nan());
}

#[test]
fn a_parameter_that_absorbs_missing_physics_is_flagged() {
    // Strong dry friction in the data, none in the simulation: the damping takes it.
    let compiled = compile(RESONANT);
    let truth = compile(&RESONANT.replace("- k*x", "- k*x - 2.5*sign(v)"));
    let drive = Drive::new(0.0, 0.01, 2000, vec![multisine(2000, 5.0)]).expect("valid");
    let y = truth.simulate(&Run::new(&drive, &[2.0, 0.6, 200.0])).outputs;
    let data = Data::new(&compiled, "friction", drive, y).expect("valid");
    let result = compiled.calibrate(&[data], &Settings::default()).expect("calibrates");
    assert!(
        result.flags.iter().any(|f| matches!(f, Flag::FarFromUser { parameter: 1, .. })),
        "{:?} {:?}",
        result.theta,
        result.flags
    );
}

#[test]
fn bounds_hold_and_are_flagged() {
    let compiled = compile(&RESONANT.replace("max = 2000.0", "max = 180.0"));
    let data = data(&Case { truth: &[2.0, 1.2, 200.0], ..CASES[0] }, &compiled, 2000, 1);
    let result = compiled.calibrate(&[data], &Settings::default()).expect("calibrates");
    assert!(result.theta.iter().zip(compiled.parameters()).all(|(t, p)| (p.lower()..=p.upper()).contains(t)));
    let local = Settings { effort: Effort::Local, ..Settings::default() };
    assert_ne!(local, Settings::default());
}

/// A valve's stem settles within a hundredth of a sampling period; the damping that fits lies far beyond what the steps bear that suit the user's.
#[test]
fn a_stiff_simulation_is_followed_to_where_its_steps_would_explode() {
    let text = r#"
[time]
period_s = 0.01
[inputs]
p = "u_N"
[parameters]
k = { value = 2.2e5, min = 5.0e4, max = 1.0e6 }
c = { value = 2000.0, min = 200.0, max = 20000.0 }
[states]
x = { derivative = "v", initial = 0.0 }
v = { derivative = "(p - k*x - c*v)/2", initial = 0.0 }
[outputs]
x_m = "x"
"#;
    let (k, c) = (2.5e5, 9000.0);
    let input: Vec<f64> = steps(1500, 2000.0);
    // So heavily damped that the mass does not show: a lag of c/k, in closed form where the input is linear between samples.
    let (tau, mut x) = (c / k, 0.0);
    let decay = (-0.01_f64 / tau).exp();
    let mut y = vec![x];
    for w in input.windows(2) {
        let slope = (w[1] - w[0]) / 0.01;
        x = (w[1] - slope * tau) / k + decay * (x - (w[0] - slope * tau) / k);
        y.push(x);
    }
    let compiled = compile(text);
    let drive = Drive::new(0.0, 0.01, input.len(), vec![input]).expect("valid");
    let data = Data::new(&compiled, "valve", drive, vec![y]).expect("valid");
    let c_found = compiled.calibrate(&[data], &Settings { gls_rounds: 0, ..Settings::default() }).expect("calibrates");
    assert!((c_found.theta[0] / k - 1.0).abs() < 0.01, "{:?}", c_found.theta);
    assert!((c_found.theta[1] / c - 1.0).abs() < 0.05, "{:?}", c_found.theta);
    assert!(c_found.steps.substeps > 8, "{:?}", c_found.steps);
}

#[test]
fn too_little_data_is_an_error() {
    let compiled = compile(RESONANT);
    let drive = Drive::new(0.0, 0.01, 4, vec![vec![1.0, 2.0, 1.0, 0.0]]).expect("valid");
    let constant = Data::new(&compiled, "c", drive.clone(), vec![vec![1.0; 4]]).expect("valid");
    let few = Data::new(&compiled, "f", drive, vec![vec![1.0, 2.0, 1.0, 3.0]]).expect("valid");
    for (data, expected) in
        [(vec![], "no data"), (vec![constant], "constant"), (vec![few], "4 measured samples cannot settle 5")]
    {
        let error = compiled.calibrate(&data, &Settings::default()).expect_err(expected).to_string();
        assert!(error.contains(expected), "{error}");
    }
}
