//! Whole diagnoses of an oscillator whose recordings come from a small integrator of this file's own, and bad input.

use hysid_diagnose::file::VerdictKind;
use hysid_diagnose::{DiagnoseError, Diagnosis, Hooks, Options, Request, diagnose};
use hysid_plant::Simulation;
use hysid_signal::{Channel, Clock, Recording};

const BASELINE: &str = r#"
title = "Oscillator"
[time]
column = "t_s"
[inputs]
u = "u_N"
[parameters]
m = { value = 1.2, min = 0.2, max = 5.0, unit = "kg" }
c = { value = 0.7, min = 0.0, max = 20.0, unit = "N s/m" }
k = { value = 130.0, min = 10.0, max = 1000.0, unit = "N/m" }
[states]
x = { derivative = "v", initial = 0.0, unit = "m" }
v = { derivative = "(u - c*v - k*x)/m", initial = 0.0, unit = "m/s" }
[outputs]
x_m = "x"
"#;

/// A linear congruential stream of roughly normal numbers.
fn noise(seed: u64) -> impl FnMut() -> f64 {
    let mut s = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    move || {
        (0..12)
            .map(|_| {
                s = s.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (s >> 11) as f64 / (1u64 << 53) as f64 - 0.5
            })
            .sum()
    }
}

fn recording(name: &str, seed: u64, n: usize, force: impl Fn(f64, f64) -> f64) -> Recording {
    let h = 0.025;
    let mut random = noise(seed);
    let phases: Vec<f64> = (0..40).map(|_| 3.0 * random()).collect();
    let u: Vec<f64> = (0..n)
        .map(|i| {
            let t = i as f64 * h;
            let level = if (t / 6.0) as usize % 2 == 0 { 2.0 } else { 1.0 };
            level * phases.iter().enumerate().map(|(j, p)| (0.6 * (j + 1) as f64 * t + p).cos()).sum::<f64>()
        })
        .collect();
    let (mut x, mut v) = (0.0, 0.0);
    let mut y = Vec::new();
    for i in 0..n {
        y.push(x);
        let (a, b) = (u[i], u[(i + 1).min(n - 1)]);
        for s in 0..40 {
            let f = a + (b - a) * f64::from(s) / 40.0;
            v += h / 40.0 * (f - 0.9 * v - 158.0 * x - force(x, v));
            x += h / 40.0 * v;
        }
    }
    let rms = (y.iter().map(|y| y * y).sum::<f64>() / n as f64).sqrt();
    y.iter_mut().for_each(|y| *y += 0.02 * rms * random());
    let channels = vec![Channel { name: "u_N".into(), samples: u }, Channel { name: "x_m".into(), samples: y }];
    Recording::new(name, Clock { start_s: 0.0, period_s: h }, channels).unwrap()
}

fn run(text: &str, estimation: &[Recording], holdout: &[Recording]) -> Result<Diagnosis, DiagnoseError> {
    let simulation = Simulation::parse(text, "test.sim.toml").unwrap();
    let hooks = Hooks { progress: &|_| {}, expired: &|_| false };
    let request = Request {
        simulation: &simulation,
        file: "test.sim.toml",
        estimation,
        holdout,
        questions: &[],
        options: Options::default(),
    };
    diagnose(&request, &hooks)
}

fn diagnosed(n: usize, force: impl Fn(f64, f64) -> f64 + Copy) -> Diagnosis {
    run(BASELINE, &[recording("est.csv", 1, n, force)], &[recording("val.csv", 2, n, force)]).unwrap()
}

#[test]
fn nothing_is_missing_in_a_simulation_with_wrong_parameters() {
    let d = diagnosed(900, |_, _| 0.0);
    assert_eq!(d.file.verdict, VerdictKind::NoSignificantMismatch, "{:?}", d.file.effects);
    assert!(d.augmented.is_none() && !d.file.mismatch.detectable.is_empty());
    let m = d.file.calibrated_parameters.iter().find(|p| p.name == "m").unwrap();
    assert!((m.value - 1.0).abs() < 0.03, "{m:?}");
}

#[test]
fn dry_friction_is_named_with_its_size_and_the_hold_out_improves() {
    let d = diagnosed(900, |_, v| 1.5 * (v / 5e-4).tanh());
    assert!(matches!(d.file.verdict, VerdictKind::Named | VerdictKind::Family), "{:?}", d.file.verdict);
    assert_eq!(d.file.effects.len(), 1);
    assert_eq!(d.file.effects[0].family, "dry_friction");
    let f = &d.file.fit[0];
    assert!(f.ratio.unwrap() < 0.5, "{f:?}");
    // What the user gets is what was judged: printed, parsed and diagnosed again it leaves nothing.
    let text = d.augmented.unwrap().to_toml();
    let again = run(&text, &[recording("est.csv", 1, 900, |_, v| 1.5 * (v / 5e-4).tanh())], &[]).unwrap();
    assert_eq!(again.file.verdict, VerdictKind::NoSignificantMismatch, "{text} {:?}", again.file.effects);
}

#[test]
fn the_same_bytes_for_any_number_of_threads() {
    let bytes = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let d = pool.install(|| diagnosed(400, |x, _| 300.0 * x * x * x));
        serde_json::to_vec(&d.file).unwrap()
    };
    assert!(bytes(1) == bytes(3));
}

#[test]
fn bad_input_is_refused_with_a_reason() {
    let good = || recording("est.csv", 1, 300, |_, _| 0.0);
    let with = |channels: Vec<Channel>, period_s: f64| {
        Recording::new("bad.csv", Clock { start_s: 0.0, period_s }, channels).unwrap()
    };
    let channel = |name: &str, samples: Vec<f64>| Channel { name: name.into(), samples };
    let ramp: Vec<f64> = (0..300).map(f64::from).collect();
    let cases: Vec<(&str, Result<Diagnosis, DiagnoseError>, &str)> = vec![
        ("no recording", run(BASELINE, &[], &[good()]), "at least one"),
        (
            "hold-out with other columns",
            run(
                BASELINE,
                &[good()],
                &[with(vec![channel("force_N", ramp.clone()), channel("x_m", ramp.clone())], 0.025)],
            ),
            "no column `u_N`",
        ),
        (
            "empty hold-out",
            run(BASELINE, &[good()], &[with(vec![channel("u_N", vec![]), channel("x_m", vec![])], 0.025)]),
            "usable samples",
        ),
        (
            "constant output",
            run(BASELINE, &[with(vec![channel("u_N", ramp.clone()), channel("x_m", vec![1.0; 300])], 0.025)], &[]),
            "constant",
        ),
        ("the same data twice", run(BASELINE, &[good()], &[good()]), "never sees"),
        ("too few samples", run(BASELINE, &[recording("short.csv", 1, 12, |_, _| 0.0)], &[]), "at least"),
        (
            "all inputs missing",
            run(BASELINE, &[with(vec![channel("u_N", vec![f64::NAN; 300]), channel("x_m", ramp.clone())], 0.025)], &[]),
            "usable samples",
        ),
        (
            "a state that explodes",
            run(&BASELINE.replace("(u - c*v - k*x)/m", "(u + 1e9*(c + sqrt(k*m))*v - k*x)/m"), &[good()], &[]),
            "diverges",
        ),
    ];
    for (what, outcome, expected) in cases {
        match outcome {
            Err(e) => assert!(e.to_string().contains(expected), "{what}: {e}"),
            Ok(d) => panic!("{what}: {:?}", d.file.verdict),
        }
    }
}
