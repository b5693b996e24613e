//! A whole diagnosis of a plant that only a controller behind the recorded input holds.

use hysid_diagnose::file::VerdictKind;
use hysid_signal::{Channel, Clock, Recording};

use super::oscillator::normal;
use super::run;

const PERIOD: f64 = 0.02;

/// A pendulum that stands on its foot, for small angles, with nothing missing.
const BASELINE: &str = r#"
[time]
column = "t_s"
[inputs]
u = "torque_Nm"
[parameters]
a = { value = 20.0, min = 5.0, max = 60.0, unit = "1/s^2" }
b = { value = 2.5, min = 0.5, max = 10.0 }
[states]
q = { derivative = "w", initial = "free", unit = "rad" }
w = { derivative = "a*q + b*u", initial = "free", unit = "rad/s" }
[outputs]
angle_rad = "q"
"#;

/// It is held upright by a torque that answers what a noisy sensor says.
fn held(name: &str, seed: u64) -> Recording {
    let mut random = normal(seed);
    let (mut q, mut w, mut last) = (0.02, 0.0, 0.02);
    let (mut u, mut y) = (Vec::new(), Vec::new());
    for n in 0..600 {
        let seen = q + 0.002 * random();
        let reference = 0.1 * (0.05 * f64::from(n)).sin();
        let torque = -30.0 * (seen - reference) - 3.0 * (seen - last) / PERIOD;
        last = seen;
        u.push(torque);
        y.push(seen);
        for _ in 0..40 {
            w += PERIOD / 40.0 * (25.0 * q + 2.0 * torque);
            q += PERIOD / 40.0 * w;
        }
    }
    let channels = [("torque_Nm", u), ("angle_rad", y)].map(|(name, samples)| Channel { name: name.into(), samples });
    Recording::new(name, Clock { start_s: 0.0, period_s: PERIOD }, channels.into()).unwrap()
}

#[test]
fn of_a_simulation_that_runs_away_nothing_is_said() {
    let d = run(BASELINE, &[held("est.csv", 1)], &[held("val.csv", 2)]).unwrap();
    assert_eq!(d.file.verdict, VerdictKind::Ambiguous, "{}", d.file.summary);
    assert!(d.file.summary.contains("runs away"), "{}", d.file.summary);
    assert!(d.file.effects.is_empty() && d.file.alternatives.is_empty() && d.augmented.is_none());
    assert!(d.file.notes.iter().any(|n| n.contains("put the controller into the simulation")), "{:?}", d.file.notes);
}
