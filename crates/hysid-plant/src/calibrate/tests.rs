//! What the start from refined instrumental variables does for whole simulations.

use hysid_signal::{Autoregression, Excitation, white_noise};

use super::observer::rms_about_mean;
use super::search::{HOMOTOPY, Start};
use super::starts::{Core, design};
use super::{Data, Settings};
use crate::document::Simulation;
use crate::engine::{Compiled, Drive, Run};

const TWO_MASSES: &str = r#"
[time]
period_s = 0.01
hold = "zero"
[inputs]
u = "u_N"
[parameters]
m = { value = 1.0, min = 0.02, max = 50.0 }
n = { value = 0.5, min = 0.01, max = 25.0 }
c = { value = 0.7, min = 0.014, max = 35.0 }
k = { value = 200.0, min = 4.0, max = 1e4 }
h = { value = 180.0, min = 3.6, max = 9e3 }
[states]
x = { derivative = "v", initial = 0.0 }
v = { derivative = "(u - c*v - k*x - h*(x - y))/m", initial = 0.0 }
y = { derivative = "w", initial = 0.0 }
w = { derivative = "(h*(x - y) - c*w)/n", initial = 0.0 }
[outputs]
x_m = "x"
"#;

fn compile(text: &str) -> Compiled {
    Compiled::new(&Simulation::parse(text, "case").unwrap_or_else(|e| panic!("{e}"))).expect("valid")
}

fn data(compiled: &Compiled, inputs: Vec<Vec<f64>>, period: f64, noise: f64) -> Data {
    let samples = inputs.first().map_or(0, Vec::len);
    let drive = Drive::new(0.0, period, samples, inputs).expect("valid");
    let clean = compiled.simulate(&Run::new(&drive, &compiled.theta()).with_substeps(8)).outputs;
    let noisy = clean.iter().enumerate().map(|(j, y)| {
        let e = white_noise(samples, (noise * rms_about_mean(y)).powi(2), 11 + j as u64).expect("valid");
        y.iter().zip(&e).map(|(y, e)| y + e).collect()
    });
    Data::new(compiled, "case", drive.clone(), noisy.collect()).expect("valid")
}

fn steps(samples: usize, seed: u64) -> Vec<f64> {
    Excitation::Steps { hold: 20 }.signal(samples, 0.01, 5.0, seed).expect("valid")
}

/// A simulation whose parameters are these factors times its own, with as much room in the bounds.
fn wrong(text: &str, factors: &[f64]) -> Compiled {
    let mut simulation = Simulation::parse(text, "wrong").expect("valid");
    simulation.parameters.iter_mut().zip(factors).for_each(|(p, f)| p.value *= f);
    Compiled::new(&simulation).expect("valid")
}

/// The first start from the identification, nothing simulated yet.
fn start(compiled: &Compiled, data: &Data) -> Vec<f64> {
    let (estimated, user) = (compiled.estimated(), compiled.theta());
    let designed = design(compiled, &estimated, 64, 1);
    let core = Core::new(compiled, data, &estimated, &user, &designed, 2).expect("linear");
    core.by_identification(1).0.swap_remove(0)
}

fn assert_close(found: &[f64], truth: &[f64], relative: f64) {
    assert!(found.iter().zip(truth).all(|(f, t)| (f - t).abs() <= relative * t.abs()), "{found:?} for {truth:?}");
}

#[test]
fn a_short_record_calibrates_from_far_away_with_this_start_and_not_without() {
    let truth = compile(TWO_MASSES);
    let data = data(&truth, vec![steps(250, 3)], 0.01, 0.05);
    let measured = rms_about_mean(&data.measured[0]);
    for factors in [[10.0, 0.1, 0.1, 0.1, 0.1], [0.1, 0.1, 10.0, 10.0, 0.1], [0.1, 0.1, 10.0, 0.1, 10.0]] {
        let compiled = wrong(TWO_MASSES, &factors);
        let settings = Settings { gls_rounds: 0, ..Settings::default() };
        let with = compiled.calibrate(std::slice::from_ref(&data), &settings).expect("calibrates");
        assert!(with.rmse[0] < 0.055 * measured, "{factors:?}: {}", with.rmse[0] / measured);

        let (estimated, user) = (compiled.estimated(), compiled.theta());
        let designed = design(&compiled, &estimated, 64, 1);
        let core = Core::new(&compiled, &data, &estimated, &user, &designed, 1).expect("linear");
        let others = core.by_measured_response(2).into_iter().chain(designed.iter().step_by(11).cloned());
        let all = std::iter::once(user.clone()).chain(others).map(|theta| Start::new(theta, HOMOTOPY));
        let white = [Autoregression::white(measured)];
        let (best, _) = compiled.search_from(all, std::slice::from_ref(&data), &estimated, &white, 1);
        let local = Settings { gls_rounds: 0, ..Settings::local(best.expect("finite")) };
        let without = compiled.calibrate(std::slice::from_ref(&data), &local).expect("calibrates");
        assert!(without.rmse[0] > 0.1 * measured, "{factors:?}: {}", without.rmse[0] / measured);
    }
}

#[test]
fn units_do_not_change_the_start() {
    let text = |period: f64, g: f64, c: f64, w: f64| {
        let line =
            |name: &str, x: f64| format!("{name} = {{ value = {x:e}, min = {:e}, max = {:e} }}\n", x / 30.0, x * 30.0);
        format!(
            "[time]\nperiod_s = {period:?}\n[inputs]\nu = \"u\"\n[parameters]\n{}{}{}[states]\nx = {{ derivative = \"v\", \
             initial = 0.0 }}\nv = {{ derivative = \"g*u - c*v - w*x\", initial = 0.0 }}\n[outputs]\ny = \"x\"\n",
            line("g", g),
            line("c", c),
            line("w", w)
        )
    };
    let (g, c, w) = (3.0, 1.1, 90.0);
    let truth = data(&compile(&text(0.01, g, c, w)), vec![steps(300, 5)], 0.01, 0.1);
    let own = start(&wrong(&text(0.01, g, c, w), &[8.0, 0.2, 0.1]), &truth);
    assert_close(&own, &[g, c, w], 0.1);
    // Input by 50, output by 1e-3, time in milliseconds.
    let (of_input, of_output, of_time) = (50.0, 1e-3, 1e3);
    let scaled = |s: &[f64], factor: f64| s.iter().map(|x| x * factor).collect::<Vec<f64>>();
    let factors = [of_output / (of_input * of_time * of_time), 1.0 / of_time, 1.0 / (of_time * of_time)];
    let compiled = wrong(&text(10.0, g * factors[0], c * factors[1], w * factors[2]), &[8.0, 0.2, 0.1]);
    let drive = Drive::new(0.0, 10.0, 300, vec![scaled(&truth.drive.inputs()[0], of_input)]).expect("valid");
    let data = Data::new(&compiled, "scaled", drive, vec![scaled(&truth.measured[0], of_output)]).expect("valid");
    let other = start(&compiled, &data);
    let expected: Vec<f64> = own.iter().zip(factors).map(|(x, f)| x * f).collect();
    assert_close(&other, &expected, 1e-6);
}

#[test]
fn two_inputs_and_two_outputs_start_near_the_truth() {
    let text = TWO_MASSES
        .replace("u = \"u_N\"", "u = \"u_N\"\np = \"p_N\"")
        .replace("(h*(x - y) - c*w)/n", "(h*(x - y) - c*w + p)/n")
        .replace("x_m = \"x\"", "x_m = \"x\"\ny_m = \"y\"");
    let truth = compile(&text);
    let data = data(&truth, vec![steps(300, 3), steps(300, 8)], 0.01, 0.02);
    let found = start(&wrong(&text, &[0.1, 8.0, 3.0, 0.2, 10.0]), &data);
    assert_close(&found, &truth.theta(), 0.1);
}

#[test]
fn a_drive_in_closed_loop_starts_near_the_truth() {
    let text = r#"
[time]
period_s = 0.01
hold = "zero"
[inputs]
u = "u_N"
[parameters]
m = { value = 2.0, min = 0.01, max = 400.0 }
c = { value = 3.0, min = 0.01, max = 600.0 }
[states]
x = { derivative = "v", initial = 0.0 }
v = { derivative = "(u - c*v)/m", initial = 0.0 }
[outputs]
x_m = "x"
"#;
    // Position control on a noisy measurement; the plant from sample to sample in closed form.
    let (m, c, period) = (2.0, 3.0, 0.01_f64);
    let noise = white_noise(400, 1e-4, 3).expect("valid");
    let reference = steps(400, 6);
    let (mut x, mut v) = (0.0_f64, 0.0_f64);
    let (mut u, mut y) = (Vec::new(), Vec::new());
    let decay = (-c / m * period).exp();
    for (r, e) in reference.iter().zip(&noise) {
        let measured = x + e;
        let force = 60.0 * (r - measured) - 10.0 * v;
        u.push(force);
        y.push(measured);
        let end = force / c;
        x += end * period + (v - end) * (1.0 - decay) * m / c;
        v = end + (v - end) * decay;
    }
    for factors in [[10.0, 0.1], [0.05, 10.0]] {
        let compiled = wrong(text, &factors);
        let drive = Drive::new(0.0, period, 400, vec![u.clone()]).expect("valid");
        let data = Data::new(&compiled, "loop", drive, vec![y.clone()]).expect("valid");
        assert_close(&start(&compiled, &data), &[m, c], 0.02);
    }
}

#[test]
fn a_gap_in_the_measurement_gives_no_start() {
    let compiled = compile(TWO_MASSES);
    let mut data = data(&compiled, vec![steps(250, 3)], 0.01, 0.05);
    data.measured[0][100] = f64::NAN;
    let (estimated, user) = (compiled.estimated(), compiled.theta());
    let core = Core::new(&compiled, &data, &estimated, &user, &[], 1).expect("linear");
    assert!(core.by_identification(1).0.is_empty());
}
