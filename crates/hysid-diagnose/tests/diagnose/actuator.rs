//! Whole diagnoses of an actuator whose recordings come from plays of the tests' own: the form of the law is the one that the recording asks for.

use crate::oscillator::{PERIOD, drive, normal};
use hysid_diagnose::file::ParameterRecord;
use hysid_diagnose::{Diagnosis, Hooks, Options, Request, diagnose};
use hysid_plant::Simulation;
use hysid_signal::{Channel, Clock, Recording};

/// A static actuator with a gain that is somewhat wrong.
const BASELINE: &str = r#"
title = "Actuator"
[time]
column = "t_s"
hold = "zero"
[inputs]
u = "u_V"
[parameters]
g = { value = 0.13, min = 0.01, max = 1.0, unit = "um/V" }
[outputs]
y_um = "g*u"
"#;

/// The gain of the real one, in um/V.
const GAIN: f64 = 0.1;

/// Plays (weight, half-width in V); the half-widths grow by `widening` of themselves for each volt of the step from the sample before.
#[derive(Debug, Clone, Copy)]
struct Loop<'a> {
    plays: &'a [(f64, f64)],
    widening: f64,
}

/// What a sum of plays makes of the input, in um, with noise of this size in um.
fn recording(name: &str, seed: u64, plays: Loop<'_>, noise: f64) -> Recording {
    let mut random = normal(seed);
    let u = drive(1200, &mut random);
    answer(name, u, plays, noise, random)
}

/// The same of any input, in V; `random` gives the noise.
fn answer(
    name: &str,
    u: Vec<f64>,
    Loop { plays, widening }: Loop<'_>,
    noise: f64,
    mut random: impl FnMut() -> f64,
) -> Recording {
    // At rest before, without an input.
    let (mut held, mut before) = (vec![0.0_f64; plays.len()], u[0]);
    let y = u.iter().map(|&u| {
        let wider = 1.0 + widening * (u - before).abs();
        before = u;
        let mut sum = u;
        for (z, (weight, radius)) in held.iter_mut().zip(plays) {
            *z = z.clamp(u - radius * wider, u + radius * wider);
            sum += weight * (*z - u);
        }
        GAIN * sum + noise * random()
    });
    let y = y.collect();
    let channels = vec![Channel { name: "u_V".into(), samples: u }, Channel { name: "y_um".into(), samples: y }];
    Recording::new(name, Clock { start_s: 0.0, period_s: PERIOD }, channels).unwrap()
}

fn diagnosed(plays: Loop<'_>, noise: f64) -> Diagnosis {
    of_recordings(recording("est.csv", 1, plays, noise), recording("val.csv", 2, plays, noise))
}

fn of_recordings(estimation: Recording, holdout: Recording) -> Diagnosis {
    let simulation = Simulation::parse(BASELINE, "test.sim.toml").unwrap();
    let request = Request {
        simulation: &simulation,
        file: "test.sim.toml",
        estimation: &[estimation],
        holdout: &[holdout],
        questions: &[],
        options: Options::default(),
    };
    diagnose(&request, &Hooks::SILENT).unwrap()
}

/// What a diagnosis tells of its only effect, after what must hold of all: the family, and what is left on the hold-out over the noise.
fn told(d: &Diagnosis, noise: f64, most: f64) -> &[ParameterRecord] {
    let families: Vec<&str> = d.file.effects.iter().map(|e| e.family.as_str()).collect();
    assert_eq!(families, ["actuator_hysteresis"], "{}", d.file.summary);
    let left = d.file.fit[0].rmse_after.unwrap() / noise;
    assert!(left < most, "{left} of the noise is left: {}", d.file.summary);
    &d.file.effects[0].parameters
}

fn value(parameters: &[ParameterRecord], name: &str) -> f64 {
    parameters.iter().find(|p| p.name == name).unwrap_or_else(|| panic!("no {name}: {parameters:?}")).value
}

#[test]
fn plays_whose_widths_stand_nowhere_in_particular_are_found_with_their_spacing() {
    // Five plays 3.1 V apart; the input reaches some 30 V.
    let plays: Vec<(f64, f64)> =
        (1..=5).zip([0.04, 0.08, 0.03, 0.07, 0.05]).map(|(i, w)| (w, 3.1 * f64::from(i))).collect();
    let noise = 0.005;
    let d = diagnosed(Loop { plays: &plays, widening: 0.0 }, noise);
    let parameters = told(&d, noise, 1.1);
    let spacing = value(parameters, "r_s");
    assert!((spacing / 3.1 - 1.0).abs() < 0.02, "{spacing} V: {parameters:?}");
    for (i, (weight, _)) in (1..).zip(&plays) {
        let found = value(parameters, &format!("p_{i}"));
        assert!((found - weight).abs() < 0.01, "p_{i}: {parameters:?}");
    }
    assert!((value(parameters, "share") - 0.27).abs() < 0.01, "{parameters:?}");
}

#[test]
fn a_faint_loop_of_a_smooth_density_is_told_by_two_numbers() {
    // Sixty plays, half of a normal density of 12 V: the noise hides the loop but for its size and width.
    let weight = |r: f64| 0.004 * (-(r / 12.0).powi(2)).exp();
    let plays: Vec<(f64, f64)> = (0..60).map(|i| 0.6 * (f64::from(i) + 0.5)).map(|r| (weight(r), r)).collect();
    let noise = 0.04;
    let d = diagnosed(Loop { plays: &plays, widening: 0.0 }, noise);
    let parameters = told(&d, noise, 1.05);
    let (width, share) = (value(parameters, "r_d"), value(parameters, "share"));
    let whole: f64 = plays.iter().map(|p| p.0).sum();
    assert!((width / 12.0).ln().abs() < 0.5, "{width} V: {parameters:?}");
    assert!((share / whole).ln().abs() < 0.5, "{share} for {whole}: {parameters:?}");
}

#[test]
fn a_loop_that_widens_with_the_rate_of_a_rough_input_is_followed() {
    // Five plays 2.5 V apart, twice as wide where the input steps by 4 V from one sample to the next.
    let plays: Vec<(f64, f64)> = (1..=5).map(|i| (0.05, 2.5 * f64::from(i))).collect();
    let noise = 0.005;
    let d = diagnosed(Loop { plays: &plays, widening: 0.25 }, noise);
    let parameters = told(&d, noise, 1.15);
    assert_eq!(d.file.effects[0].mechanism, "rate_dependent_hysteresis", "{}", d.file.summary);
    let growth = value(parameters, "lambda") / PERIOD;
    assert!((growth / 0.25).ln().abs() < 0.1, "{growth} 1/V: {parameters:?}");
}

#[test]
fn backlash_is_firm_only_where_the_input_turns_often_enough() {
    // Straight lines up and down, each somewhat shorter than the one before.
    let zigzag = |lines: usize| -> Vec<f64> {
        let corner =
            |k: usize| 30.0 * (1.0 - 0.4 * k as f64 / lines as f64) * if k.is_multiple_of(2) { -1.0 } else { 1.0 };
        let at = |i: usize| {
            let place = i as f64 * lines as f64 / 1200.0;
            let (k, part) = (place.floor() as usize, place.fract());
            corner(k) * (1.0 - part) + corner(k + 1) * part
        };
        (0..1200).map(at).collect()
    };
    let noise = 0.005;
    let play = Loop { plays: &[(1.0, 1.5)], widening: 0.0 };
    for (lines, often) in [(4, false), (16, true)] {
        let of = |name, seed| answer(name, zigzag(lines), play, noise, normal(seed));
        let file = of_recordings(of("est.csv", 1), of("val.csv", 2)).file;
        let [effect] = file.effects.as_slice() else { panic!("{lines}: {}", file.summary) };
        assert_eq!(effect.mechanism, "backlash", "{lines}: {}", file.summary);
        assert_eq!(effect.probability >= 0.9, often, "{lines}: {}", file.summary);
        assert_eq!(effect.family_probability >= 0.9, often, "{lines}: {}", file.summary);
        let told = file.notes.iter().any(|n| n.starts_with("backlash: for a firm answer the recording lacks"));
        assert_eq!(told, !often, "{lines}: {:?}", file.notes);
    }
}
