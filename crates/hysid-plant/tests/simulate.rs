//! Trajectories against closed forms, sensitivities against central differences.

mod common;

use hysid_plant::{Compiled, Direction, Drive, Injection, Observer, Response, Run, Simulation, Slot, Start};

fn compile(text: &str) -> Compiled {
    let simulation = Simulation::parse(text, "test.sim.toml").unwrap_or_else(|e| panic!("{e}"));
    Compiled::new(&simulation).expect("valid")
}

/// A simulation with these parameters (name, value), states (name, derivative, initial) and outputs.
fn model(hold: &str, parameters: &[(&str, f64)], states: &[(&str, &str, &str)], outputs: &[(&str, &str)]) -> Compiled {
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

fn drive(len: usize, u: impl Fn(f64) -> f64) -> Drive {
    Drive::new(0.0, 0.01, len, vec![(0..len).map(|n| u(0.01 * n as f64)).collect()]).expect("valid")
}

fn largest_error(y: &[f64], exact: impl Fn(f64) -> f64) -> f64 {
    y.iter().enumerate().map(|(n, y)| (y - exact(0.01 * n as f64)).abs()).fold(0.0, f64::max)
}

fn simulate(compiled: &Compiled, drive: &Drive, substeps: usize) -> Response {
    let theta = compiled.theta();
    compiled.simulate(&Run::new(drive, &theta).with_substeps(substeps))
}

#[test]
fn a_free_oscillator_follows_its_closed_form() {
    let (m, c, k) = (2.0, 3.0, 200.0);
    let compiled = model(
        "linear",
        &[("m", m), ("c", c), ("k", k)],
        &[("x", "v", "0.1"), ("v", "(u - c*v - k*x)/m", "0.0")],
        &[("y", "x")],
    );
    let y = simulate(&compiled, &drive(1000, |_| 0.0), 4);
    let (a, w) = (c / (2.0 * m), (k / m - (c / (2.0 * m)).powi(2)).sqrt());
    let exact = |t: f64| 0.1 * (-a * t).exp() * ((w * t).cos() + a / w * (w * t).sin());
    let error = largest_error(&y.outputs[0], exact);
    assert!(error < 5e-9, "{error:e}");
}

#[test]
fn a_step_response_follows_its_closed_form_with_a_held_input() {
    let compiled = model("zero", &[("a", 3.0)], &[("x", "a*(u - x)", "0.0")], &[("y", "x")]);
    let y = simulate(&compiled, &drive(500, |t| if t > 1.005 { 2.0 } else { 0.0 }), 4);
    let exact = |t: f64| if t > 1.005 { 2.0 * (1.0 - (-3.0 * (t - 1.01)).exp()) } else { 0.0 };
    let error = largest_error(&y.outputs[0], exact);
    assert!(error < 1e-9, "{error:e}");
}

#[test]
fn a_ramp_between_samples_is_a_ramp() {
    // The integral of a linear input is exact for linear interpolation.
    let compiled = model("linear", &[], &[("x", "u", "0.0")], &[("y", "x")]);
    let y = simulate(&compiled, &drive(300, |t| t), 1);
    assert!(largest_error(&y.outputs[0], |t| 0.5 * t * t) < 1e-12);
}

/// Displacement of a mass on a spring with dry friction, from rest at `x0`: half cycles about a shifted centre.
fn coulomb_exact(t: f64, x0: f64, w: f64, shift: f64) -> f64 {
    let half = std::f64::consts::PI / w;
    let (mut amplitude, mut start, mut side) = (x0, 0.0, 1.0);
    loop {
        if amplitude <= shift {
            return side * amplitude;
        }
        if t < start + half {
            return side * (shift + (amplitude - shift) * (w * (t - start)).cos());
        }
        amplitude -= 2.0 * shift;
        start += half;
        side = -side;
    }
}

#[test]
fn dry_friction_follows_its_piecewise_solution_and_sticks() {
    let (m, k, friction) = (2.0, 200.0, 1.7);
    let compiled = model(
        "linear",
        &[("m", m), ("k", k), ("F_c", friction)],
        &[("x", "v", "0.1"), ("v", "(u - k*x - F_c*sign(v))/m", "0.0")],
        &[("y", "x"), ("v_mps", "v"), ("force", "F_c*sign(v)")],
    );
    let y = simulate(&compiled, &drive(600, |_| 0.0), 4);
    let w = (k / m).sqrt();
    let error = largest_error(&y.outputs[0], |t| coulomb_exact(t, 0.1, w, friction / k));
    assert!(error < 1e-8, "{error:e}");
    let rest: Vec<f64> = y.outputs[1].iter().rev().take(100).copied().collect();
    assert!(rest.iter().all(|v| *v == 0.0), "{rest:?}");
    // At rest the friction is what balances the spring.
    let (x, force) = (y.outputs[0][599], y.outputs[2][599]);
    assert!((force + k * x).abs() < 1e-9, "{force} {x}");
}

#[test]
fn a_block_on_a_ramp_of_force_breaks_away_at_the_friction() {
    let compiled = model("linear", &[("F_c", 1.5)], &[("v", "u - F_c*sign(v)", "0.0")], &[("y", "v")]);
    let y = simulate(&compiled, &drive(401, |t| t), 1);
    let exact = |t: f64| if t < 1.5 { 0.0 } else { 0.5 * (t - 1.5).powi(2) };
    let error = largest_error(&y.outputs[0], exact);
    assert!(error < 1e-12, "{error:e}");
}

#[test]
fn two_blocks_with_friction_between_them_move_as_one_until_they_slip() {
    // A driven block carries another by friction: together while u/2 < F, apart afterwards.
    let compiled = model(
        "linear",
        &[("F", 1.0)],
        &[("a", "u - F*sign(a - b)", "0.0"), ("b", "F*sign(a - b)", "0.0")],
        &[("ya", "a"), ("yb", "b")],
    );
    let y = simulate(&compiled, &drive(401, |t| t), 1);
    let slip = |t: f64| (t - 2.0).max(0.0);
    let together = |t: f64| 0.25 * t.min(2.0).powi(2);
    let a = largest_error(&y.outputs[0], |t| together(t) + 2.0 * slip(t) + 0.5 * slip(t).powi(2) - slip(t));
    let b = largest_error(&y.outputs[1], |t| together(t) + slip(t));
    assert!(a < 1e-10 && b < 1e-10, "{a:e} {b:e}");
}

#[test]
fn both_of_two_masses_can_stick() {
    let compiled = model(
        "linear",
        &[("F", 1.0)],
        &[
            ("x", "v", "0.1"),
            ("v", "u - 50*(x - z) - F*sign(v)", "0.0"),
            ("z", "w", "-0.05"),
            ("w", "50*(x - z) - 30*z - F*sign(w)", "0.3"),
        ],
        &[("yx", "x"), ("yz", "z"), ("v", "v"), ("w", "w")],
    );
    let coarse = simulate(&compiled, &drive(1500, |_| 0.0), 4);
    let fine = simulate(&compiled, &drive(1500, |_| 0.0), 16);
    for (a, b) in coarse.outputs[0].iter().zip(&fine.outputs[0]) {
        assert!((a - b).abs() < 1e-7, "{a} {b}");
    }
    assert_eq!((coarse.outputs[2][1499], coarse.outputs[3][1499]), (0.0, 0.0));
}

#[test]
fn static_operators_follow_their_definitions() {
    let amplitude = |t: f64| (5.0 * t).sin();
    let compiled = model(
        "linear",
        &[("r", 0.3), ("tau", 0.2), ("s", 0.05)],
        &[],
        &[
            ("play", "play(u, r)"),
            ("lag", "lag(u, tau)"),
            ("delay", "delay(u, s)"),
            ("relay", "relay(u, -0.4, 0.6)"),
            ("rate", "d(u)"),
        ],
    );
    let y = simulate(&compiled, &drive(400, amplitude), 1);
    let (mut play, mut relay) = (0.0_f64, -1.0);
    for n in 0..400 {
        let u = amplitude(0.01 * n as f64);
        play = play.clamp(u - 0.3, u + 0.3);
        relay = if u > 0.6 {
            1.0
        } else if u < -0.4 {
            -1.0
        } else {
            relay
        };
        assert!((y.outputs[0][n] - play).abs() < 1e-15);
        assert_eq!(y.outputs[3][n], relay);
        let late = if n < 5 { 0.0 } else { amplitude(0.01 * (n - 5) as f64) };
        assert!((y.outputs[2][n] - late).abs() < 1e-9, "{n}: {} {late}", y.outputs[2][n]);
        if n > 0 && n < 399 {
            let slope = (amplitude(0.01 * (n + 1) as f64) - amplitude(0.01 * (n as f64 - 1.0))) / 0.02;
            assert!((y.outputs[4][n] - slope).abs() < 1e-9);
        }
    }
    // The lag of a sine, to the accuracy of the straight lines between samples.
    let (w, tau) = (5.0, 0.2);
    let exact = |t: f64| {
        let d = 1.0 + (w * tau) * (w * tau);
        ((w * t).sin() - w * tau * (w * t).cos() + w * tau * (-t / tau).exp()) / d
    };
    assert!(largest_error(&y.outputs[1], exact) < 3e-4);
    // Of a ramp it is exact.
    let ramp = simulate(&compiled, &drive(400, |t| t), 1);
    assert!(largest_error(&ramp.outputs[1], |t| t - tau + tau * (-t / tau).exp()) < 1e-12);
}

#[test]
fn an_explosion_is_a_result() {
    let compiled = model("linear", &[("a", 50.0)], &[("x", "a*x^3 + u", "1.0")], &[("y", "x")]);
    let y = simulate(&compiled, &drive(100, |_| 0.0), 4);
    let at = y.diverged.expect("diverges");
    assert!((1..10).contains(&at), "{at}");
    assert!(y.outputs[0][at].is_nan() && y.outputs[0][at - 1].is_finite());
}

/// Name, hold, parameters, states, outputs.
type Case = (
    &'static str,
    &'static str,
    &'static [(&'static str, f64)],
    &'static [(&'static str, &'static str, &'static str)],
    &'static [(&'static str, &'static str)],
);

const CASES: &[Case] = &[
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

fn wobble(t: f64) -> f64 {
    (7.3 * t).sin() + 0.6 * (13.1 * t + 1.0).sin() + 0.3 * (3.1 * t).cos()
}

#[test]
fn sensitivities_equal_central_differences() {
    for (name, hold, parameters, states, outputs) in CASES {
        let compiled = model(hold, parameters, states, outputs);
        let drive = drive(300, wobble);
        let theta = compiled.theta();
        let free = compiled.free_states();
        let x0: Vec<f64> = free.iter().map(|_| 0.02).collect();
        let run = Run::new(&drive, &theta).from(Start::Document(&x0));
        let injected: Vec<f64> = (0..300).map(|n| (0.05 * n as f64).cos()).collect();
        let mut slots = vec![Slot::Input(0), Slot::Output(0)];
        slots.extend((0..states.len()).map(Slot::State));
        let mut directions: Vec<Direction<'_>> = (0..theta.len()).map(Direction::Parameter).collect();
        directions.extend(free.iter().map(|&i| Direction::Initial(i)));
        let first_slot = directions.len();
        directions.extend(slots.iter().map(|&slot| Direction::Injection(Injection { slot, series: &injected })));
        let result = compiled.sensitivities(&run, &directions);
        assert_eq!(result.response, compiled.simulate(&run), "{name}: values do not depend on tangents");
        for (i, tangent) in result.tangents.iter().enumerate() {
            let size = if i < theta.len() { theta[i].abs() } else { 0.05 };
            let eps = 1e-5 * size;
            let shifted = |sign: f64| {
                let (mut theta, mut x0) = (theta.clone(), x0.clone());
                let series: Vec<f64> = injected.iter().map(|s| sign * eps * s).collect();
                let mut injections = Vec::new();
                if i < theta.len() {
                    theta[i] += sign * eps;
                } else if i < first_slot {
                    x0[i - theta.len()] += sign * eps;
                } else {
                    injections.push(Injection { slot: slots[i - first_slot], series: &series });
                }
                let run = Run { injections: &injections, theta: &theta, start: Start::Document(&x0), ..run };
                compiled.simulate(&run).outputs
            };
            let (up, down) = (shifted(1.0), shifted(-1.0));
            for (j, tangent) in tangent.iter().enumerate() {
                let scale = tangent.iter().fold(1e-9, |m: f64, t| m.max(t.abs()));
                let mut outliers = 0;
                for n in 0..300 {
                    let difference = (up[j][n] - down[j][n]) / (2.0 * eps);
                    if (tangent[n] - difference).abs() > 2e-3 * scale {
                        outliers += 1;
                        // A jump of the output itself moves with the parameter: a few samples may lie on both of its sides.
                        let jumps = *name == "coulomb" && j == 1;
                        assert!(
                            jumps && outliers < 6,
                            "{name}, direction {i}, output {j}, {n}: {} {difference}",
                            tangent[n]
                        );
                    }
                }
            }
        }
    }
}

#[test]
fn an_amplitude_at_zero_has_the_sensitivity_of_its_injection() {
    // Adding w*phi to the equation at w = 0 is injecting phi.
    let states = [("x", "v", "0.0"), ("v", "20*u - 3*v - 100*x + w*u^2", "0.0")];
    let compiled = model("linear", &[("w", 0.0)], &states, &[("y", "x")]);
    let drive = drive(300, |t| (4.0 * t).sin().signum());
    let theta = compiled.theta();
    let phi = vec![1.0; 300];
    let directions = [Direction::Parameter(0), Direction::Injection(Injection { slot: Slot::State(1), series: &phi })];
    let mut run = Run::new(&drive, &theta);
    run.substeps = 8;
    let s = compiled.sensitivities(&run, &directions);
    // u^2 is 1 except on the way between -1 and 1.
    let norm: f64 = s.tangents[1][0].iter().map(|x| x * x).sum::<f64>().sqrt();
    let gap: f64 = s.tangents[0][0].iter().zip(&s.tangents[1][0]).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
    assert!(gap < 0.05 * norm, "{gap} {norm}");
}

#[test]
fn the_linear_model_is_that_of_the_equations() {
    let states = [("x", "v", "0.0"), ("v", "(u - 3*v - k*sin(x))/m", "0.0")];
    let compiled = model("linear", &[("m", 2.0), ("k", 50.0)], &states, &[("y", "3*x + 0.5*u")]);
    let linear = compiled.linearise(&compiled.theta(), &[0.5, 0.0], &[1.0]);
    assert_eq!(linear.a[..2], [0.0, 1.0]);
    assert!((linear.a[2] + 25.0 * 0.5_f64.cos()).abs() < 1e-12 && (linear.a[3] + 1.5).abs() < 1e-12);
    assert_eq!((linear.b, linear.c, linear.d), (vec![0.0, 0.5], vec![3.0, 0.0], vec![0.5]));
}

#[test]
fn an_observer_leads_from_the_free_run_to_the_measurement() {
    let states = [("x", "v", "0.0"), ("v", "u - c*v - k*x", "0.0")];
    let truth = model("linear", &[("c", 0.5), ("k", 100.0)], &states, &[("y", "x")]);
    let wrong = model("linear", &[("c", 0.5), ("k", 60.0)], &states, &[("y", "x")]);
    let drive = drive(1000, wobble);
    let measured = simulate(&truth, &drive, 4).outputs;
    let data = hysid_plant::Data::new(&wrong, "m", drive.clone(), measured.clone()).expect("valid");
    let theta = wrong.theta();
    let mut errors = Vec::new();
    for strength in [0.0, 0.01, 0.1, 1.0] {
        let gain = wrong.observer_gain(&data, &theta, &[0.0, 0.0], strength);
        let run = Run::new(&drive, &theta).observing(Observer { gain: &gain, measured: &measured });
        let y = wrong.simulate(&run);
        if strength == 0.0 {
            assert_eq!(y, simulate(&wrong, &drive, 4));
        }
        let squares: f64 = y.outputs[0].iter().zip(&measured[0]).map(|(a, b)| (a - b).powi(2)).sum();
        errors.push(squares.sqrt());
    }
    assert!(errors.windows(2).all(|w| w[1] < w[0]) && errors[3] < 0.1 * errors[0], "{errors:?}");
}

#[test]
fn the_step_halving_check_asks_for_what_the_equations_need() {
    let states = [("x", "v", "0.1"), ("v", "u - k*x", "0.0")];
    let steps = |k: f64| {
        let compiled = model("linear", &[("k", k)], &states, &[("y", "x")]);
        let theta = compiled.theta();
        compiled.check_steps(&drive(400, wobble), &theta, Start::Document(&[]), 1e-4)
    };
    let (slow, fast) = (steps(100.0), steps(40_000.0));
    assert!(slow.substeps == 1 && slow.error < 1e-4, "{slow:?}");
    assert!(fast.substeps > 4 && fast.error < 1e-4, "{fast:?}");
}

#[test]
fn many_runs_are_what_each_is_alone() {
    let states = [("x", "v", "0.1"), ("v", "20*u - k*x - 2*sign(v)", "0.0")];
    let compiled = model("linear", &[("k", 100.0)], &states, &[("y", "x")]);
    let drive = drive(200, wobble);
    let thetas = [[80.0], [100.0], [150.0]];
    let runs: Vec<Run<'_>> = thetas.iter().map(|theta| Run::new(&drive, theta)).collect();
    for (run, response) in runs.iter().zip(compiled.simulate_many(&runs)) {
        assert_eq!(compiled.simulate(run), response);
    }
}

#[test]
fn runs_in_lanes_are_what_each_is_alone() {
    for (name, hold, parameters, states, outputs) in CASES {
        let compiled = model(hold, parameters, states, outputs);
        let drive = drive(300, wobble);
        let free = compiled.free_states().len();
        let theta = compiled.theta();
        let sets: Vec<Vec<f64>> =
            (0..11).map(|i| theta.iter().map(|t| t * (0.8 + 0.06 * f64::from(i))).collect()).collect();
        let starts: Vec<Vec<f64>> = (0..11).map(|i| vec![0.01 * f64::from(i); free]).collect();
        let pairs = sets.iter().zip(&starts);
        let runs: Vec<Run<'_>> = pairs.map(|(theta, x0)| Run::new(&drive, theta).from(Start::Document(x0))).collect();
        for (run, response) in runs.iter().zip(compiled.simulate_many(&runs)) {
            assert_eq!(compiled.simulate(run), response, "{name}");
        }
        let series: Vec<f64> = (0..300).map(|n| (0.05 * n as f64).cos()).collect();
        let injection = Direction::Injection(Injection { slot: Slot::Input(0), series: &series });
        for directions in [&[Direction::Parameter(0)][..], &[injection, Direction::Parameter(1)]] {
            for (run, sensitivity) in runs.iter().zip(compiled.sensitivities_many(&runs, directions)) {
                assert_eq!(compiled.sensitivities(run, directions), sensitivity, "{name}");
            }
        }
    }
}

#[test]
fn a_lane_that_diverges_does_not_disturb_the_others() {
    let compiled = model("linear", &[("a", 50.0)], &[("x", "a*x^3 + u", "1.0")], &[("y", "x")]);
    let drive = drive(100, |_| 0.0);
    let thetas = [[50.0], [-1.0], [-2.0]];
    let runs: Vec<Run<'_>> = thetas.iter().map(|theta| Run::new(&drive, theta)).collect();
    let all = compiled.simulate_many(&runs);
    assert_eq!(all[0].diverged, compiled.simulate(&runs[0]).diverged);
    assert!(all[0].diverged.is_some() && all[0].outputs[0][99].is_nan());
    assert_eq!(all[1..], [compiled.simulate(&runs[1]), compiled.simulate(&runs[2])]);
}
