//! Whole diagnoses of an oscillator whose recordings come from a small integrator of the tests' own, and bad input.

mod actuator;
mod coil;
mod held;
mod oscillator;
mod rotor;
mod sensed;
mod store;

use hysid_diagnose::file::VerdictKind;
use hysid_diagnose::{DiagnoseError, Diagnosis, Hooks, Options, Request, diagnose};
use hysid_plant::{Compiled, Drive, Run, Simulation};
use hysid_signal::{Channel, Clock, Recording};
use oscillator::{BASELINE, PERIOD, REAL, drive, normal, respond, rms};

fn recording(name: &str, seed: u64, n: usize, force: impl Fn(f64, f64) -> f64) -> Recording {
    let mut random = normal(seed);
    let u = drive(n, &mut random);
    let mut y = respond(&u, REAL, force);
    let noise = 0.02 * rms(&y);
    y.iter_mut().for_each(|y| *y += noise * random());
    let channels = vec![Channel { name: "u_N".into(), samples: u }, Channel { name: "x_m".into(), samples: y }];
    Recording::new(name, Clock { start_s: 0.0, period_s: PERIOD }, channels).unwrap()
}

fn run(text: &str, estimation: &[Recording], holdout: &[Recording]) -> Result<Diagnosis, DiagnoseError> {
    run_until(&|_| false, text, estimation, holdout)
}

fn run_until(
    expired: &(dyn Fn(f64) -> bool + Sync),
    text: &str,
    estimation: &[Recording],
    holdout: &[Recording],
) -> Result<Diagnosis, DiagnoseError> {
    let simulation = Simulation::parse(text, "test.sim.toml").unwrap();
    let hooks = Hooks { expired, ..Hooks::SILENT };
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

/// The simulation has the friction that the machine has, smoothed over the speeds at which the machine moves.
#[test]
fn a_smoothed_friction_law_is_told_from_physics_that_is_missing() {
    let friction = |_: f64, v: f64| 6.0 * v.signum();
    let text = BASELINE
        .replace("- k*x)/m", "- k*x - F_c*tanh(v/0.8))/m")
        .replace("[states]", "F_c = { value = 4.0, min = 0.0, max = 40.0, unit = \"N\" }\n[states]");
    let d = run(&text, &[recording("est.csv", 1, 900, friction)], &[recording("val.csv", 2, 900, friction)]).unwrap();
    let effect = d.file.effects.first().unwrap();
    assert_eq!((effect.mechanism.as_str(), effect.slot.as_str()), ("solver_artefact", "state:v"));
    assert!(effect.probability >= 0.9 && effect.sentence.contains("sticks"), "{effect:?}");
    assert!(d.augmented.unwrap().to_toml().contains("F_c*sign("));
    assert!(d.file.fit[0].ratio.unwrap() < 0.1, "{:?}", d.file.fit);
}

/// A spring pulled to and fro, and what it answers with Dahl's friction beside it: 2 N, sliding after 7 mm, less than a sample's travel.
fn pulled(name: &str, seed: u64, n: usize) -> Recording {
    let mut random = normal(seed);
    let phases: Vec<f64> = (0..8).map(|_| 3.0 * random()).collect();
    let at = |t: f64| 0.05 * phases.iter().zip(1..).map(|(p, j)| (0.9 * f64::from(j) * t + p).cos()).sum::<f64>();
    let (mut here, mut friction) = (at(0.0), 0.0);
    let (mut x, mut f) = (Vec::new(), Vec::new());
    for i in 0..n {
        x.push(here);
        f.push(40.0 * here + friction + 0.02 * random());
        for s in 1..=40 {
            let next = at((i as f64 + f64::from(s) / 40.0) * PERIOD);
            let end = 2.0 * f64::signum(next - here);
            friction = end + (friction - end) * (-f64::abs(next - here) / 0.007).exp();
            here = next;
        }
    }
    let channels = vec![Channel { name: "x_m".into(), samples: x }, Channel { name: "f_N".into(), samples: f }];
    Recording::new(name, Clock { start_s: 0.0, period_s: PERIOD }, channels).unwrap()
}

#[test]
fn a_static_simulation_is_stepped_finely_enough_for_the_memory_that_an_effect_adds() {
    let text = "[time]\nperiod_s = 0.025\n[inputs]\nx = \"x_m\"\n[parameters]\nk = { value = 45.0, min = 1.0, max = 200.0, unit = \"N/m\" }\n[outputs]\nf_N = \"k*x\"\n";
    let holdout = pulled("val.csv", 2, 900);
    let d = run(text, &[pulled("est.csv", 1, 900)], std::slice::from_ref(&holdout)).unwrap();
    let families: Vec<&str> = d.file.effects.iter().map(|e| e.family.as_str()).collect();
    assert_eq!(families, ["presliding"], "{}", d.file.summary);
    // What is told of the hold-out holds in the simulation that is written, however finely that is integrated.
    let compiled = Compiled::new(d.augmented.as_ref().unwrap()).unwrap();
    assert!(!compiled.simulation().is_static(), "{}", d.file.summary);
    let [x, f] = [&holdout.channels()[0].samples, &holdout.channels()[1].samples];
    let drive = Drive::new(0.0, PERIOD, x.len(), vec![x.clone()]).unwrap();
    let theta = compiled.theta();
    let y = compiled.simulate(&Run::new(&drive, &theta).with_substeps(64)).outputs.swap_remove(0);
    let fine = rms(&f.iter().zip(&y).map(|(a, b)| a - b).collect::<Vec<_>>());
    let told = d.file.fit[0].rmse_after.unwrap();
    assert!((told / fine - 1.0).abs() < 0.01, "told {told}, {fine} on fine steps: {}", d.file.summary);
}

#[test]
fn a_search_that_was_cut_short_is_never_firm_and_says_so() {
    use std::sync::atomic::{AtomicUsize, Ordering};
    let friction = |_: f64, v: f64| 1.5 * (v / 5e-4).tanh();
    let (est, val) = (recording("est.csv", 1, 900, friction), recording("val.csv", 2, 900, friction));
    // Time is up at the so-many-th time that it is asked for.
    for last in [0, 1, 5, 12, 25, 60] {
        let asked = AtomicUsize::new(0);
        let expired = |_: f64| asked.fetch_add(1, Ordering::Relaxed) >= last;
        let d = run_until(&expired, BASELINE, std::slice::from_ref(&est), std::slice::from_ref(&val)).unwrap().file;
        assert!(d.effects.iter().all(|e| e.probability < 0.9 && e.family_probability < 0.9), "{last}");
        assert!(d.notes.iter().any(|n| n.starts_with("the time limit left out")), "{last}: {:?}", d.notes);
        assert_eq!(d.verdict, VerdictKind::Ambiguous, "{last}: what is significant stays so: {}", d.summary);
        assert!(d.fit[0].rmse_after.is_some_and(f64::is_finite) || d.fit[0].rmse_before.is_some(), "{last}");
    }
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

/// Five samples that are wrong by three times the motion would bend the calibration and hide the friction.
#[test]
fn glitches_of_the_sensor_hide_nothing() {
    let friction = |_: f64, v: f64| 1.5 * (v / 5e-4).tanh();
    let clean = recording("est.csv", 1, 900, friction);
    let mut channels = clean.channels().to_vec();
    let size = 3.0 * rms(&channels[1].samples);
    [31, 222, 413, 604, 795].into_iter().for_each(|n: usize| channels[1].samples[n] += size);
    let bad = Recording::new("est.csv", clean.clock(), channels).unwrap();
    let d = run(BASELINE, &[bad], &[recording("val.csv", 2, 900, friction)]).unwrap();
    assert_eq!(d.file.effects.first().map(|e| e.family.as_str()), Some("dry_friction"), "{}", d.file.summary);
    assert!(d.file.fit[0].ratio.unwrap() < 0.5, "{:?}", d.file.fit);
    assert!(d.file.notes.iter().any(|n| n.starts_with("5 samples stand out")), "{:?}", d.file.notes);
}

#[test]
fn a_hum_is_found_although_a_noise_model_would_swallow_it() {
    let with_hum = |name: &str, seed: u64| {
        let quiet = recording(name, seed, 900, |_, _| 0.0);
        let mut channels = quiet.channels().to_vec();
        let size = 0.08 * rms(&channels[1].samples);
        channels[1].samples.iter_mut().enumerate().for_each(|(i, y)| *y += size * (3.1 * i as f64 * PERIOD).sin());
        Recording::new(name, quiet.clock(), channels).unwrap()
    };
    let d = run(BASELINE, &[with_hum("est.csv", 1)], &[with_hum("val.csv", 2)]).unwrap();
    assert!(d.file.mismatch.p_value.unwrap() < 0.01, "{}", d.file.summary);
    assert_eq!(d.file.effects[0].family, "external_disturbance", "{}", d.file.summary);
    assert!(d.file.fit[0].ratio.unwrap() < 0.5, "{:?}", d.file.fit);
}

/// The step is read from the recording and no fitted number: it has no interval, rather than one of no width.
#[test]
fn the_step_of_a_coarse_sensor_is_told_without_an_interval() {
    let coarse = |name: &str, seed: u64| {
        let fine = recording(name, seed, 900, |_, _| 0.0);
        let mut channels = fine.channels().to_vec();
        channels[1].samples.iter_mut().for_each(|y| *y = STEP * (*y / STEP).round());
        Recording::new(name, fine.clock(), channels).unwrap()
    };
    let d = run(BASELINE, &[coarse("est.csv", 1)], &[coarse("val.csv", 2)]).unwrap();
    let effect = d.file.effects.iter().find(|e| e.mechanism == "quantisation").expect(&d.file.summary);
    let q = &effect.parameters[0];
    assert!((q.value / STEP - 1.0).abs() < 1e-3 && q.low.is_none() && q.high.is_none(), "{q:?}");
}

/// Metres; the motion of these recordings is some tenths of a metre.
const STEP: f64 = 0.05;

#[test]
fn a_law_that_the_catalogue_does_not_have_is_not_given_a_firm_name() {
    // Damping that rises and falls with the position and never drives.
    let d = diagnosed(900, |x, v| 1.2 * v * (1.0 + (40.0 * x).sin()));
    assert_eq!(d.file.verdict, VerdictKind::NotInCatalogue, "{} {:?}", d.file.summary, d.file.remaining);
    assert!(d.file.effects.iter().all(|e| e.family_probability < 0.9), "{:?}", d.file.effects);
    let correction = d.file.correction.expect("generic terms model it");
    assert!(correction.ratio.unwrap() < 0.97 && correction.slot == "state:v", "{correction:?}");
    // It stands in the simulation that is written, refitted, and helps on a recording that it never saw.
    let text = d.augmented.map(|a| a.to_toml()).unwrap_or_default();
    assert!(text.contains("g = {") && !text.contains("g_2 = {"), "{correction:?} {:?} {text}", d.file.notes);
    assert!(d.file.fit[0].ratio.unwrap() < 0.8, "{:?} {text}", d.file.fit);
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
    let part = || {
        let cut = |c: &Channel| channel(&c.name, c.samples[100..250].to_vec());
        with(good().channels().iter().map(cut).collect(), PERIOD)
    };
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
        ("a part of the data once more", run(BASELINE, &[good()], &[part()]), "150 of its rows"),
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
