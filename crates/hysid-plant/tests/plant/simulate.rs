//! Trajectories against closed forms; the observer and the check of the step.

use crate::common::equations::{drive, largest_error, model, simulate, wobble};
use hysid_plant::{Data, Drive, Observer, Run, Start};

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
fn an_output_that_is_not_finite_is_told_and_not_a_state() {
    let compiled = model(
        "linear",
        &[],
        &[("x", "1", "0.0"), ("z", "0", "5.0")],
        &[("fine", "z"), ("root", "sqrt(0.5 - x) + 0*u")],
    );
    let drive = drive(100, |_| 0.0);
    let response = simulate(&compiled, &drive, 1);
    assert_eq!(response.diverged_output, Some(1));
    let why = compiled.explain_divergence(&compiled.theta(), &[0.0, 5.0], &[0.0], &response);
    assert!(why.contains("output `root` is not finite") && !why.contains('z'), "{why}");
    let explodes = model("linear", &[], &[("x", "50 + 50*x^3", "0.0")], &[("y", "x + u")]);
    let response = simulate(&explodes, &drive, 1);
    assert!(response.diverged.is_some() && response.diverged_output.is_none());
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
            ("widening", "play(u, r*(1 + s*abs(d(u))))"),
        ],
    );
    let y = simulate(&compiled, &drive(400, amplitude), 1);
    let (mut play, mut widening, mut relay) = (0.0_f64, 0.0_f64, -1.0);
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
        let half = 0.3 * (1.0 + 0.05 * y.outputs[4][n].abs());
        widening = widening.clamp(u - half, u + half);
        assert!((y.outputs[5][n] - widening).abs() < 1e-14);
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
fn a_half_width_may_grow_with_the_step_from_the_sample_before() {
    let amplitude = |t: f64| (47.0 * t).sin() + 0.3 * (310.0 * t).cos();
    // A held input moves at its samples, a linear one between them too, where two steps for each sample meet it halfway.
    for (hold, points) in [("zero", 1), ("linear", 2)] {
        let states: [(&str, &str, &str); 1] = [("x", "play(u, r*(1 + s*abs(u - delay(u, h)))) - x", "0.0")];
        let outputs = [("widening", "play(u, r*(1 + s*abs(u - delay(u, h))))"), ("x", "x")];
        let compiled = model(hold, &[("r", 0.2), ("s", 1.5), ("h", 0.01)], &states, &outputs);
        let y = simulate(&compiled, &drive(3000, amplitude), 2);
        let sample = |n: i32| amplitude(0.01 * f64::from(n.max(0)));
        // An argument that came from 0 has taken it along by the first sample.
        let mut widening = 0.0_f64;
        for i in 0..3000 * points {
            let (n, share) = (i / points, f64::from(i % points) / f64::from(points));
            let at = |n: i32| sample(n) + share * (sample(n + 1) - sample(n));
            // Before the first sample everything is at rest.
            let before = if n == 0 { sample(0) } else { at(n - 1) };
            let half = 0.2 * (1.0 + 1.5 * (at(n) - before).abs());
            widening = widening.clamp(at(n) - half, at(n) + half);
            let found = y.outputs[0][n as usize];
            assert!(share > 0.0 || (found - widening).abs() < 1e-9, "{hold} {n}: {found} {widening}");
        }
    }
}

#[test]
fn an_explosion_is_a_result() {
    let compiled = model("linear", &[("a", 50.0)], &[("x", "a*x^3 + u", "1.0")], &[("y", "x")]);
    let y = simulate(&compiled, &drive(100, |_| 0.0), 4);
    let at = y.diverged.expect("diverges");
    assert!((1..10).contains(&at), "{at}");
    assert!(y.outputs[0][at].is_nan() && y.outputs[0][at - 1].is_finite());
}

#[test]
fn an_observer_leads_from_the_free_run_to_the_measurement() {
    let states = [("x", "v", "0.0"), ("v", "u - c*v - k*x", "0.0")];
    let truth = model("linear", &[("c", 0.5), ("k", 100.0)], &states, &[("y", "x")]);
    let wrong = model("linear", &[("c", 0.5), ("k", 60.0)], &states, &[("y", "x")]);
    let drive = drive(1000, wobble);
    let measured = simulate(&truth, &drive, 4).outputs;
    let data = Data::new(&wrong, "m", drive.clone(), measured.clone()).expect("valid");
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
    let steps = |k: f64, drive: &Drive| {
        let compiled = model("linear", &[("k", k)], &states, &[("y", "x")]);
        let theta = compiled.theta();
        compiled.check_steps(drive, &theta, Start::Document(&[]), 1e-4)
    };
    let (slow, fast) = (steps(100.0, &drive(400, wobble)), steps(40_000.0, &drive(400, wobble)));
    assert!(slow.substeps == 1 && slow.error < 1e-4, "{slow:?}");
    assert!(fast.substeps > 4 && fast.error < 1e-4, "{fast:?}");
    // A sweep that comes to the resonance (30 rad/s, at 37.5 s) at its end.
    let sweep = |t: f64| 1e4 * (0.4 * t * t).sin();
    let (early, whole) = (steps(900.0, &drive(2000, sweep)), steps(900.0, &drive(4000, sweep)));
    assert!(early.substeps < whole.substeps, "{early:?} {whole:?}");
}
