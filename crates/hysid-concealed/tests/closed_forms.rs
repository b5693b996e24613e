//! The bank's integrator against closed forms.

use hysid_concealed::body::Kind;
use hysid_concealed::input::{Hold, Input};
use hysid_concealed::law::{Effect, Law};
use hysid_concealed::machine::Machine;

fn oscillator(theta: [f64; 3], effects: Vec<Effect>, q0: f64) -> Machine {
    Machine {
        kind: Kind::Oscillator,
        theta: theta.to_vec(),
        effects,
        initial: vec![q0, 0.0],
        channels: 1,
        regularised: None,
    }
}

fn held(values: Vec<f64>, period: f64, hold: Hold) -> Input {
    Input::Held { values, period, hold }
}

#[test]
fn free_decay_with_dry_friction_loses_the_same_amount_each_half_period() {
    // m q'' + k q + F sgn v = 0 from q0: turning points q0 - 2jF/k in size, then rest where k|q| <= F.
    let (m, k, f, q0): (f64, f64, f64, f64) = (2.0, 800.0, 3.0, 0.05);
    let half = std::f64::consts::PI / (k / m).sqrt();
    // 16 samples for each half period, so that samples fall on the turning points.
    let period = half / 16.0;
    let machine = oscillator([m, 0.0, k], vec![Effect::new(Law::Coulomb, vec![f])], q0);
    let y = &machine.run(&held(vec![0.0; 16 * 12], period, Hold::Zero), None).unwrap()[0];
    let loss = 2.0 * f / k;
    for j in 0..6 {
        let expected = (q0 - loss * j as f64) * if j % 2 == 0 { 1.0 } else { -1.0 };
        assert!((y[16 * j] - expected).abs() < 1e-7, "turning point {j}: {} against {expected}", y[16 * j]);
    }
    // 0.05 - 6 x 0.0075 = 0.005 would still exceed F/k = 0.00375: one more half period, then it sticks for ever.
    let rest = y[16 * 7 + 1];
    assert!((rest.abs() - (q0 - 7.0 * loss).abs()).abs() < 1e-7, "rests at {rest}");
    assert!(y[16 * 7 + 1..].iter().all(|v| *v == rest), "it does not stick");
}

#[test]
fn a_linear_oscillator_follows_its_formula() {
    // Step response of m q'' + c q' + k q = u.
    let (m, c, k, u): (f64, f64, f64, f64) = (1.3, 2.0, 90.0, 7.0);
    let (w, z) = ((k / m).sqrt(), c / (2.0 * (k * m).sqrt()));
    let wd = w * (1.0 - z * z).sqrt();
    for hold in [Hold::Zero, Hold::Linear] {
        let period = 0.02;
        let y = &oscillator([m, c, k], vec![], 0.0).run(&held(vec![u; 400], period, hold), None).unwrap()[0];
        for (i, v) in y.iter().enumerate() {
            let t = i as f64 * period;
            let e = (-z * w * t).exp();
            let expected = u / k * (1.0 - e * ((wd * t).cos() + z * w / wd * (wd * t).sin()));
            assert!((v - expected).abs() < 5e-7 * u / k, "{hold:?} t = {t}: {v} against {expected}");
        }
    }
}

#[test]
fn a_delay_of_a_fraction_of_a_sample_shifts_the_response() {
    // First-order plant, held step that reaches the plant tau later: y = g (1 - exp(-(t - tau)/T)).
    let (g, lag, tau, period) = (2.0, 0.3, 0.137, 0.05);
    let machine = Machine {
        kind: Kind::Circuit,
        theta: vec![g, lag],
        effects: vec![Effect::new(Law::Delay, vec![tau])],
        initial: vec![0.0],
        channels: 1,
        regularised: None,
    };
    let mut u = vec![1.0; 60];
    u[0] = 0.0;
    let y = &machine.run(&held(u, period, Hold::Zero), None).unwrap()[0];
    for (i, v) in y.iter().enumerate() {
        let t = i as f64 * period - period - tau;
        let expected = if t > 0.0 { g * (1.0 - (-t / lag).exp()) } else { 0.0 };
        assert!((v - expected).abs() < 2e-7, "sample {i}: {v} against {expected}");
    }
}

#[test]
fn play_in_the_output_follows_the_operator() {
    // The operator on a dense record of the same motion: w = max(q - r, min(q + r, w)).
    let (period, n) = (0.02, 900);
    let u: Vec<f64> = (0..n).map(|k| (k as f64 * 0.11).sin() * 30.0 + (k as f64 * 0.047).sin() * 20.0).collect();
    let r = 0.08;
    let machine = |effects| oscillator([1.0, 3.0, 100.0], effects, 0.0);
    let with = &machine(vec![Effect::new(Law::OutputBacklash, vec![r])])
        .run(&held(u.clone(), period, Hold::Zero), None)
        .unwrap()[0];
    // Held twenty times finer, the same command gives the same motion.
    let fine: Vec<f64> = u.iter().flat_map(|v| [*v; 20]).collect();
    let q = &machine(vec![]).run(&held(fine, period / 20.0, Hold::Zero), None).unwrap()[0];
    let mut w = 0.0_f64;
    let mut moved = 0;
    for (i, q) in q.iter().enumerate() {
        let before = w;
        w = w.min(q + r).max(q - r);
        moved += usize::from(w != before);
        if i % 20 == 0 {
            assert!((with[i / 20] - w).abs() < 2e-4 * r.max(0.5), "sample {}: {} against {w}", i / 20, with[i / 20]);
        }
    }
    assert!(moved > 1000, "the play never engaged");
}

#[test]
fn play_of_the_command_is_exact_between_samples() {
    // Static check through a fast plant with a linear hold: command ramps up, turns, ramps back.
    let (period, n) = (0.1, 200);
    let u: Vec<f64> = (0..n).map(|k| (k as f64 * 0.05).sin()).collect();
    let run = |period: f64, u: Vec<f64>| {
        let machine = Machine {
            kind: Kind::Circuit,
            theta: vec![1.0, 0.05],
            effects: vec![Effect::new(Law::InputBacklash, vec![0.3])],
            initial: vec![0.0],
            channels: 1,
            regularised: None,
        };
        machine.run(&held(u, period, Hold::Linear), None).unwrap().remove(0)
    };
    let coarse = run(period, u.clone());
    let fine: Vec<f64> = (0..(n - 1) * 10 + 1)
        .map(|i| {
            let (k, s) = (i / 10, (i % 10) as f64 / 10.0);
            u[k] + s * (u.get(k + 1).unwrap_or(&u[k]) - u[k])
        })
        .collect();
    let dense = run(period / 10.0, fine);
    for (k, v) in coarse.iter().enumerate() {
        assert!((v - dense[10 * k]).abs() < 5e-6, "sample {k}: {v} against {}", dense[10 * k]);
    }
}

#[test]
fn a_stop_reflects_as_its_spring_says() {
    // Without damping, energy: half m v0^2 = half k d^2 + half k_g (d - g)^2 fixes the depth d.
    let (m, k, kg, g, q0) = (1.0, 100.0, 2000.0, 0.02, -0.06_f64);
    let machine = oscillator([m, 0.0, k], vec![Effect::new(Law::GapStop, vec![kg, 0.02])], q0);
    let y = &machine.run(&held(vec![0.0; 40_000], 1e-4, Hold::Zero), None).unwrap()[0];
    // It starts on the other stop: energy there.
    let energy = 0.5 * k * q0 * q0 + 0.5 * kg * (q0.abs() - g).powi(2);
    let deepest = y.iter().fold(0.0_f64, |a, v| a.max(*v));
    let at = 0.5 * k * deepest * deepest + 0.5 * kg * (deepest - g).powi(2);
    assert!((at / energy - 1.0).abs() < 2e-5, "{at} against {energy}");
    assert!((deepest - q0.abs()).abs() < 1e-6);
}
