//! Whole diagnoses by sensors that are no displacement: an accelerometer, whose expression holds the forces, and a tachometer.

use hysid_diagnose::file::VerdictKind;
use hysid_signal::{Channel, Clock, Recording};

use super::oscillator::{BASELINE, PERIOD, REAL, drive, normal, rms};
use super::run;

/// Integration steps in a sampling period.
const STEPS: usize = 40;

/// A recording of an input and of what is measured of it, with noise of a fiftieth.
fn recorded(
    name: &str,
    columns: [&str; 2],
    u: Vec<f64>,
    mut y: Vec<f64>,
    random: &mut impl FnMut() -> f64,
) -> Recording {
    let noise = 0.02 * rms(&y);
    y.iter_mut().for_each(|y| *y += noise * random());
    let channels = columns.into_iter().zip([u, y]).map(|(name, samples)| Channel { name: name.into(), samples });
    Recording::new(name, Clock { start_s: 0.0, period_s: PERIOD }, channels.collect()).unwrap()
}

/// The acceleration of the oscillator with a spring that hardens.
fn accelerated(name: &str, seed: u64) -> Recording {
    let mut random = normal(seed);
    let u = drive(900, &mut random);
    let (m, c, k) = REAL;
    let (mut x, mut v) = (0.0, 0.0);
    let y = (0..u.len())
        .map(|i| {
            let (a, b) = (u[i], u[(i + 1).min(u.len() - 1)]);
            let force = |f: f64, x: f64, v: f64| (f - c * v - k * x - 3000.0 * x * x * x) / m;
            let here = force(a, x, v);
            for s in 0..STEPS {
                v += PERIOD / STEPS as f64 * force(a + (b - a) * s as f64 / STEPS as f64, x, v);
                x += PERIOD / STEPS as f64 * v;
            }
            here
        })
        .collect();
    recorded(name, ["u_N", "a_mps2"], u, y, &mut random)
}

#[test]
fn an_accelerometer_measures_the_force_that_is_missing() {
    let baseline = BASELINE.replace("x_m = \"x\"", "a_mps2 = \"(u - c*v - k*x)/m\"");
    let d = run(&baseline, &[accelerated("est.csv", 1)], &[accelerated("val.csv", 2)]).unwrap();
    let effect = d.file.effects.first().expect(&d.file.summary);
    assert_eq!((effect.mechanism.as_str(), effect.slot.as_str()), ("cubic_stiffness", "state:v"), "{}", d.file.summary);
    assert_eq!(d.file.verdict, VerdictKind::Named, "{}", d.file.summary);
    assert!((effect.parameters[0].value / 3000.0 - 1.0).abs() < 0.05, "{:?}", effect.parameters);
    let measured = d.augmented.unwrap().output("a_mps2").unwrap().expression.to_string();
    assert!(measured.contains("x^3"), "{measured}");
}

/// The speed of an inertia of 0.5 on which another one of 0.2 hangs by a spring: together they turn as one, and at 3 Hz they do not.
fn turned(name: &str, seed: u64) -> Recording {
    let mut random = normal(seed);
    let u = drive(900, &mut random);
    let (mut v, mut w, mut twist) = (0.0, 0.0, 0.0);
    let y = (0..u.len())
        .map(|i| {
            let (here, torque) = (v, u[i]);
            for _ in 0..STEPS {
                let spring = 0.2 * 355.0 * twist + 0.2 * 1.5 * (v - w);
                v += PERIOD / STEPS as f64 * (torque - 0.9 * v - spring) / 0.5;
                w += PERIOD / STEPS as f64 * spring / 0.2;
                twist += PERIOD / STEPS as f64 * (v - w);
            }
            here
        })
        .collect();
    recorded(name, ["torque_Nm", "speed_radps"], u, y, &mut random)
}

#[test]
fn a_mode_hangs_on_a_part_of_which_the_speed_is_known() {
    let baseline = "[time]\ncolumn = \"t_s\"\nhold = \"zero\"\n[inputs]\nu = \"torque_Nm\"\n[parameters]\n\
        J = { value = 0.6, min = 0.06, max = 6.0, unit = \"kg m^2\" }\nb = { value = 1.2, min = 0.1, max = 10.0, unit = \"N m s/rad\" }\n\
        [states]\nom = { derivative = \"(u - b*om)/J\", initial = 0.0, unit = \"rad/s\" }\n[outputs]\nspeed_radps = \"om\"\n";
    let d = run(baseline, &[turned("est.csv", 1)], &[turned("val.csv", 2)]).unwrap().file;
    let effect = d.effects.first().expect(&d.summary);
    assert_eq!((effect.mechanism.as_str(), effect.slot.as_str()), ("unmodelled_mode", "state:om"), "{}", d.summary);
    let of = |name: &str| effect.parameters.iter().find(|p| p.name == name).unwrap().value;
    // The other inertia, and the frequency at which it swings alone.
    assert!((of("m_a") / 0.2 - 1.0).abs() < 0.1 && (of("f_a") / 3.0 - 1.0).abs() < 0.05, "{:?}", effect.parameters);
    assert!(d.fit[0].ratio.is_some_and(|r| r < 0.2), "{:?}", d.fit);
}
