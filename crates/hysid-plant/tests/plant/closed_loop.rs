//! Calibration recovers what made the data in closed loop.

use hysid_plant::{Data, Drive, Run, Settings};
use hysid_signal::white_noise;

use super::calibrate::{DRIVE, compile, noisy};

#[test]
fn a_closed_loop_record_of_an_integrating_plant_calibrates() {
    let compiled = compile(DRIVE);
    let (m, c, friction) = (2.0, 2.0, 1.5);
    // Position control by PD on a coarse Euler simulation of its own; the force is what was recorded.
    let (n, fine) = (3000, 200);
    let reference = |t: f64| 0.5 * (0.9 * t).sin() + 0.3 * (2.3 * t).sin();
    let (mut x, mut v) = (0.0_f64, 0.0_f64);
    let (mut u, mut y) = (Vec::new(), Vec::new());
    let noise = white_noise(n, 1e-6, 11).expect("valid");
    for (i, e) in noise.iter().enumerate() {
        let measured = x + e;
        let force = 60.0 * (reference(0.01 * i as f64) - measured) - 8.0 * v;
        u.push(force);
        y.push(measured);
        for _ in 0..fine {
            let h = 0.01 / fine as f64;
            let pull = force - c * v;
            let next =
                if v == 0.0 && pull.abs() <= friction { 0.0 } else { v + h * (pull - friction * v.signum()) / m };
            v = if v != 0.0 && next * v < 0.0 { 0.0 } else { next };
            x += h * v;
        }
    }
    let drive = Drive::new(0.0, 0.01, n, vec![u]).expect("valid");
    let data = Data::new(&compiled, "loop", drive, vec![y]).expect("valid");
    let result = compiled.calibrate(&[data], &Settings::default()).expect("calibrates");
    for (found, truth) in result.theta.iter().zip([m, c, friction]) {
        assert!((found - truth).abs() < 0.05 * truth, "{:?}", result.theta);
    }
    assert!(result.rmse[0] < 0.01, "{:?}", result.rmse);
}

/// The position loop of a belt axis whose motor sticks in the pauses of a reference that ramps and holds.
const BELT: &str = r#"
[time]
period_s = 0.002
[inputs]
r = "ref_rad"
[parameters]
J1 = { value = 0.00372, min = 0.00093, max = 0.0093 }
J2 = { value = 0.004221, min = 0.00201, max = 0.0201 }
b1 = { value = 0.01596, min = 0.0036, max = 0.036 }
kt = { value = 50.54, min = 11.4, max = 114.0 }
ct = { value = 0.026, min = 0.006, max = 0.06 }
Tc = { value = 0.252, min = 0.0, max = 1.0 }
[states]
q1 = { derivative = "w1", initial = 0.0 }
w1 = { derivative = "(5*(r - q1) - 0.16*w1 - b1*w1 - Tc*sign(w1) - kt*(q1 - q2) - ct*(w1 - w2))/J1", initial = 0.0 }
q2 = { derivative = "w2", initial = 0.0 }
w2 = { derivative = "(kt*(q1 - q2) + ct*(w1 - w2))/J2", initial = 0.0 }
[outputs]
motor_rad = "q1"
torque_Nm = "5*(r - q1) - 0.16*w1"
"#;

#[test]
fn a_position_loop_that_sticks_is_found_from_far_values() {
    let targets = white_noise(20, 0.6, 5).expect("valid");
    // Each target is reached in the first half of its 0.5 s.
    let reference = |n: usize| {
        let (at, share) = (n / 250, (n % 250) as f64 / 125.0);
        let from = if at > 0 { targets[at - 1] } else { 0.0 };
        from + (targets[at] - from) * 0.5 * (1.0 - (std::f64::consts::PI * share.min(1.0)).cos())
    };
    let compiled = compile(BELT);
    let truth = [0.0031, 0.0067, 0.012, 38.0, 0.02, 0.21];
    let drive = Drive::new(0.0, 0.002, 5000, vec![(0..5000).map(reference).collect()]).expect("valid");
    let clean = compiled.simulate(&Run::new(&drive, &truth).with_substeps(8)).outputs;
    let measured = clean.iter().zip(11..).map(|(y, seed)| noisy(y, 0.012, seed)).collect();
    let data = Data::new(&compiled, "belt", drive, measured).expect("valid");
    let settings = Settings { gls_rounds: 0, iterations: 40, ..Settings::default() };
    let result = compiled.calibrate(&[data], &settings).expect("calibrates");
    for (found, truth) in result.theta.iter().zip(truth).take(4) {
        assert!((found / truth - 1.0).abs() < 0.05, "{:?}", result.theta);
    }
}
