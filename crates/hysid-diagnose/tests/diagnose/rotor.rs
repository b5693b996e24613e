//! Whole diagnoses of a rotor of which the speed is simulated, and no angle.

use std::f64::consts::PI;

use hysid_diagnose::file::VerdictKind;
use hysid_plant::Simulation;
use hysid_signal::{Channel, Clock, Recording};

use super::oscillator::normal;
use super::run;

const BASELINE: &str = r#"
title = "Spindle"
[time]
column = "t_s"
hold = "zero"
[inputs]
M = "torque_Nm"
[parameters]
J = { value = 0.06, min = 0.005, max = 0.5, unit = "kg m^2" }
b = { value = 0.03, min = 0.002, max = 0.2, unit = "N m s" }
[states]
w = { derivative = "(M - b*w)/J", initial = 0.0, unit = "rad/s" }
[outputs]
spindle_rpm = "w*30/pi"
"#;

/// Inertia in kg m^2, damping in N m s, size in N m and number of the pole pairs of the real spindle, and the sampling period in s.
const REAL: (f64, f64) = (0.05, 0.02);
const RIPPLE: (f64, f64) = (0.03, 6.0);
const PERIOD: f64 = 0.02;

/// Torque in steps, and the speed that follows from an angle in rad.
fn recording(name: &str, seed: u64, mut angle: f64) -> Recording {
    let mut random = normal(seed);
    let (mut torque, mut speed, mut w, mut level) = (Vec::new(), Vec::new(), 0.0, 0.0);
    let parts = 50;
    for i in 0..1500 {
        if i % 60 == 0 {
            level = 0.08 + 0.1 * random();
        }
        torque.push(level);
        speed.push(w * 30.0 / PI + 0.3 * random());
        for _ in 0..parts {
            let ripple = RIPPLE.0 * (RIPPLE.1 * angle).sin();
            w += PERIOD / f64::from(parts) * (level - REAL.1 * w - ripple) / REAL.0;
            angle += PERIOD / f64::from(parts) * w;
        }
    }
    let channels = vec![
        Channel { name: "torque_Nm".into(), samples: torque },
        Channel { name: "spindle_rpm".into(), samples: speed },
    ];
    Recording::new(name, Clock { start_s: 0.0, period_s: PERIOD }, channels).unwrap()
}

/// The hold-out begins at another angle than the recording does: nobody knows at which.
#[test]
fn what_returns_with_the_turn_is_named_over_an_angle_that_nobody_recorded() {
    let d = run(BASELINE, &[recording("est.csv", 1, 0.0)], &[recording("val.csv", 2, 0.8)]).unwrap();
    let effect = d.file.effects.first().expect(&d.file.summary);
    assert_eq!((effect.mechanism.as_str(), effect.slot.as_str()), ("cogging", "state:w"), "{}", d.file.summary);
    assert_eq!(d.file.verdict, VerdictKind::Named, "{}", d.file.summary);
    let value = |name: &str| effect.parameters.iter().find(|p| p.name == name).map(|p| p.value);
    assert!(value("p_x").is_some_and(|p| (p * RIPPLE.1 / (2.0 * PI) - 1.0).abs() < 0.01), "{:?}", effect.parameters);
    assert!(value("A").is_some_and(|a| (a / RIPPLE.0 - 1.0).abs() < 0.1), "{:?}", effect.parameters);
    // What is written can be read; where the hold-out begins is told by its first twentieth.
    let written = d.augmented.unwrap().to_toml();
    assert!(
        written.contains("turn = { derivative = \"w\", initial = \"free\"") && Simulation::parse(&written, "a").is_ok()
    );
    assert!(d.file.fit[0].ratio.is_some_and(|r| r < 0.25), "{:?}", d.file.fit);
    // The simulation as it is stays as the user has it.
    assert_eq!(d.baseline.states.len(), 1);
}
