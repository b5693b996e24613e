//! Whole diagnoses of a tank, whose columns end in compound units.

use hysid_diagnose::file::VerdictKind;
use hysid_signal::{Channel, Clock, Recording};

use super::oscillator::normal;
use super::run;

/// Area in m^2 and outflow coefficient in m^2/s of the real tank, and the sampling period in s.
const REAL: (f64, f64) = (0.8, 0.02);
const PERIOD: f64 = 3.0;
/// Inflow that the pump does not exceed, in m^3/s.
const LIMIT: f64 = 0.02;

/// The tank with parameters that are somewhat wrong; `inflow` is the column of its input.
fn baseline(inflow: &str) -> String {
    format!(
        "[time]\ncolumn = \"t_s\"\nhold = \"zero\"\n[inputs]\nu = \"{inflow}\"\n[parameters]\n\
         A = {{ value = 0.6, min = 0.06, max = 6.0, unit = \"m^2\" }}\nc = {{ value = 0.03, min = 0.003, max = 0.3, unit = \"m^2/s\" }}\n\
         [states]\nh = {{ derivative = \"(u - c*h)/A\", initial = 0.0 }}\n[outputs]\nlevel_m = \"h\"\n"
    )
}

/// The exact step of a linear tank under a constant inflow, over so many seconds.
fn relaxed(level: f64, inflow: f64, outflow: f64, seconds: f64) -> f64 {
    let rest = inflow / outflow;
    rest + (level - rest) * (-outflow / REAL.0 * seconds).exp()
}

/// Inflow in steps of a minute and more, and the level that follows it, with the noise of its sensor; `next` is the level after a sampling period, of the
/// number of that period, the inflow before and in it and the level at its beginning.
fn filled(name: &str, inflow: &str, seed: u64, next: impl Fn(usize, [f64; 2], f64) -> f64) -> Recording {
    let mut random = normal(seed);
    let (mut u, mut level, mut h, mut flow) = (Vec::new(), Vec::new(), 0.0, 0.0);
    for i in 0..1200 {
        let before = flow;
        if i % 25 == 0 {
            flow = (0.014 + 0.006 * random()).max(0.0);
        }
        u.push(flow);
        level.push(h + 0.004 * random());
        h = next(i, [if i == 0 { flow } else { before }, flow], h);
    }
    let channels =
        vec![Channel { name: inflow.into(), samples: u }, Channel { name: "level_m".into(), samples: level }];
    Recording::new(name, Clock { start_s: 0.0, period_s: PERIOD }, channels).unwrap()
}

/// The same of a tank that is as its simulation but for what enters.
fn recording(name: &str, inflow: &str, seed: u64, enters: impl Fn(f64) -> f64) -> Recording {
    filled(name, inflow, seed, |_, [_, flow], h| relaxed(h, enters(flow), REAL.1, PERIOD))
}

/// Under a column that ends in a flow, and under one whose end is taken for a unit that clashes with those of the file.
#[test]
fn a_pump_that_does_not_follow_is_named_whatever_its_column_ends_in() {
    for inflow in ["inflow_m3_s", "pump_A"] {
        let of = |name: &str, seed| recording(name, inflow, seed, |u| u.min(LIMIT));
        let d = run(&baseline(inflow), &[of("est.csv", 1)], &[of("val.csv", 2)]).unwrap().file;
        let effect = d.effects.first().expect(&d.summary);
        assert_eq!((effect.mechanism.as_str(), effect.slot.as_str()), ("input_saturation", "input:u"), "{}", d.summary);
        assert_eq!(d.verdict, VerdictKind::Named, "{inflow}: {}", d.summary);
        assert!((effect.parameters[0].value / LIMIT - 1.0).abs() < 0.02, "{:?}", effect.parameters);
        assert_eq!(effect.parameters[0].unit, if inflow == "pump_A" { "A" } else { "m^3/s" });
    }
}

/// White noise with an offset of several times its size looks like noise of a long memory to an autoregression that follows the mean.
#[test]
fn an_offset_beside_white_noise_is_no_noise() {
    let of = |name: &str, seed| {
        let quiet = recording(name, "inflow_m3_s", seed, |u| u);
        let mut channels = quiet.channels().to_vec();
        channels[1].samples.iter_mut().for_each(|y| *y += 0.02);
        Recording::new(name, quiet.clock(), channels).unwrap()
    };
    let d = run(&baseline("inflow_m3_s"), &[of("est.csv", 1)], &[of("val.csv", 2)]).unwrap().file;
    let families: Vec<&str> = d.effects.iter().map(|e| e.family.as_str()).collect();
    assert_eq!(families, ["bias"], "{}", d.summary);
    // The noise of the sensor is left.
    assert!(d.fit[0].rmse_after.is_some_and(|r| r < 1.1 * 0.004), "{:?}", d.fit);
}

/// A gauge that counts from far below and reads no more than so much.
#[test]
fn a_gauge_that_stops_is_named_however_far_from_zero_it_reads() {
    let (datum, most) = (40.0, 41.0);
    let of = |name: &str, seed| {
        let quiet = recording(name, "inflow_m3_s", seed, |u| u);
        let mut channels = quiet.channels().to_vec();
        let mut random = normal(seed + 10);
        channels[1].samples.iter_mut().for_each(|y| *y = (*y + datum).min(most) + 0.002 * random());
        Recording::new(name, quiet.clock(), channels).unwrap()
    };
    let text = baseline("inflow_m3_s").replace("\"h\"\n", "\"h + 40\"\n");
    let d = run(&text, &[of("est.csv", 1)], &[of("val.csv", 2)]).unwrap().file;
    let effect = d.effects.first().expect(&d.summary);
    assert_eq!((effect.mechanism.as_str(), d.verdict), ("output_saturation", VerdictKind::Named), "{}", d.summary);
    assert!((effect.parameters[0].value - most).abs() < 0.01, "{:?}", effect.parameters);
}

/// Beside a delay an outlet that clogs a little and a gauge that reads too little explain nothing one after the other: either leaves what is slow, which
/// a noise model takes for noise.
#[test]
fn two_slow_effects_beside_a_third_are_found_together() {
    let (delay, moment, clogged, offset) = (1.8, 520, 0.992, -0.01);
    let of = |name: &str, seed, worn: usize| {
        let real = filled(name, "inflow_m3_s", seed, |i, [before, flow], h| {
            let outflow = if i < worn { REAL.1 } else { clogged * REAL.1 };
            relaxed(relaxed(h, before, outflow, delay), flow, outflow, PERIOD - delay)
        });
        let mut channels = real.channels().to_vec();
        channels[1].samples.iter_mut().for_each(|y| *y += offset);
        Recording::new(name, real.clock(), channels).unwrap()
    };
    let d = run(&baseline("inflow_m3_s"), &[of("est.csv", 1, moment)], &[of("val.csv", 2, 0)]).unwrap().file;
    let mut families: Vec<&str> = d.effects.iter().map(|e| e.family.as_str()).collect();
    families.sort_unstable();
    assert_eq!(families, ["bias", "signal_path_lag", "time_variation"], "{}", d.summary);
}
