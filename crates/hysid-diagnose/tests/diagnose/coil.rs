//! Whole diagnoses of a coil on a core that saturates, whose current sensor errs by more the larger the current is.

use hysid_diagnose::file::VerdictKind;
use hysid_signal::{Channel, Clock, Recording};

use super::oscillator::{normal, rms};
use super::run;

const BASELINE: &str = r#"
title = "Inductor with a saturating core"
[time]
column = "t_s"
[inputs]
u = "coil_V"
[parameters]
R = { value = 1.7, min = 0.45, max = 7.2, unit = "ohm" }
ia = { value = 0.64, min = 0.21, max = 1.3, unit = "A" }
ib = { value = 0.35, min = 0.14, max = 1.5, unit = "A" }
p0 = { value = 0.035, fixed = true, unit = "V s" }
[states]
lam = { derivative = "u - R*(ia*lam/p0 + ib*(lam/p0)^5)", initial = 0.0, unit = "V s" }
[outputs]
coil_A = "ia*lam/p0 + ib*(lam/p0)^5"
"#;

/// Resistance in ohm, the two currents in A and the flux linkage of the real coil in V s, and the sampling period in s.
const REAL: (f64, f64, f64, f64) = (2.1, 0.9, 0.55, 0.035);
const PERIOD: f64 = 2e-4;
/// Steps of the integrator in a sampling period.
const STEPS: u32 = 200;

/// A voltage of many tones, and the current that it drives; beside what the resistance drops, the winding feels `lost` volts of the current.
fn recording(name: &str, seed: u64, level: f64, lost: impl Fn(f64) -> f64) -> Recording {
    let mut random = normal(seed);
    let tones: Vec<(f64, f64)> =
        (0..25).map(|j| (60.0 * 1.16_f64.powi(j) * (1.0 + 0.02 * random()), 3.0 * random())).collect();
    let voltage = |i: usize| {
        let t = i as f64 * PERIOD;
        let sum: f64 = tones.iter().map(|(w, phase)| (w * t + phase).sin()).sum();
        4.0 * level * sum * (1.0 - (-t / 0.004).exp())
    };
    let u: Vec<f64> = (0..1200).map(voltage).collect();
    let (r, ia, ib, p0) = REAL;
    let current = |flux: f64| ia * flux / p0 + ib * (flux / p0).powi(5);
    let mut flux = 0.0;
    let clean: Vec<f64> = (0..u.len())
        .map(|i| {
            let here = current(flux);
            let next = u[(i + 1).min(u.len() - 1)];
            for s in 0..STEPS {
                let v = u[i] + (next - u[i]) * (f64::from(s) + 0.5) / f64::from(STEPS);
                let rate = |flux: f64| v - r * current(flux) - lost(current(flux));
                let h = PERIOD / f64::from(STEPS);
                flux += h * rate(flux + 0.5 * h * rate(flux));
            }
            here
        })
        .collect();
    let size = rms(&clean);
    let read = |y: &f64| y + 0.03 * (0.35 * size + y.abs()) * random();
    let i = clean.iter().map(read).collect();
    let channels = vec![Channel { name: "coil_V".into(), samples: u }, Channel { name: "coil_A".into(), samples: i }];
    Recording::new(name, Clock { start_s: 0.0, period_s: PERIOD }, channels).unwrap()
}

#[test]
fn a_noise_that_grows_with_the_reading_is_no_effect() {
    for seed in [1, 21] {
        let of = |name: &str, seed, level| recording(name, seed, level, |_| 0.0);
        let d = run(BASELINE, &[of("est.csv", seed, 1.0)], &[of("val.csv", seed + 1, 0.8)]).unwrap().file;
        assert_eq!(
            d.verdict,
            VerdictKind::NoSignificantMismatch,
            "{seed}: {} {:?} {:?}",
            d.summary,
            d.mismatch.p_value,
            d.notes
        );
        assert!(d.notes.iter().any(|n| n.contains("at some samples")), "{seed}: {:?}", d.notes);
    }
}

/// Under the same noise a diode in the circuit is heard, since what is lost is large at small currents too; evidence that counts all samples alike is firm of nothing.
#[test]
fn an_effect_under_such_a_noise_is_heard() {
    let of = |name: &str, seed, level| recording(name, seed, level, |i| 0.8 * (8.0 * i).tanh());
    let d = run(BASELINE, &[of("est.csv", 1, 1.0)], &[of("val.csv", 2, 0.8)]).unwrap().file;
    assert!(d.verdict != VerdictKind::NoSignificantMismatch, "{} {:?}", d.summary, d.notes);
    assert!(d.effects.iter().all(|e| e.probability < 0.9), "{}", d.summary);
}
