//! Many runs at a time, in lanes: each is bit for bit what it is alone.

use crate::common::equations::{CASES, drive, model, wobble};
use hysid_plant::{Direction, Injection, Run, Slot, Start};

#[test]
fn many_runs_are_what_each_is_alone() {
    let states = [("x", "v", "0.1"), ("v", "20*u - k*x - 2*sign(v)", "0.0")];
    let compiled = model("linear", &[("k", 100.0)], &states, &[("y", "x")]);
    let drive = drive(200, wobble);
    let thetas = [[80.0], [100.0], [150.0]];
    let runs: Vec<Run<'_>> = thetas.iter().map(|theta| Run::new(&drive, theta)).collect();
    for (run, response) in runs.iter().zip(compiled.simulate_many(&runs)) {
        assert_eq!(compiled.simulate(run), response);
    }
}

#[test]
fn runs_in_lanes_are_what_each_is_alone() {
    for (name, hold, parameters, states, outputs) in CASES {
        let compiled = model(hold, parameters, states, outputs);
        let drive = drive(300, wobble);
        let free = compiled.free_states().len();
        let theta = compiled.theta();
        let sets: Vec<Vec<f64>> =
            (0..11).map(|i| theta.iter().map(|t| t * (0.8 + 0.06 * f64::from(i))).collect()).collect();
        let starts: Vec<Vec<f64>> = (0..11).map(|i| vec![0.01 * f64::from(i); free]).collect();
        let pairs = sets.iter().zip(&starts);
        let runs: Vec<Run<'_>> = pairs.map(|(theta, x0)| Run::new(&drive, theta).from(Start::Document(x0))).collect();
        for (run, response) in runs.iter().zip(compiled.simulate_many(&runs)) {
            assert_eq!(compiled.simulate(run), response, "{name}");
        }
        let series: Vec<f64> = (0..300).map(|n| (0.05 * n as f64).cos()).collect();
        let injection = Direction::Injection(Injection { slot: Slot::Input(0), series: &series });
        for directions in [&[Direction::Parameter(0)][..], &[injection, Direction::Parameter(1)]] {
            for (run, sensitivity) in runs.iter().zip(compiled.sensitivities_many(&runs, directions)) {
                assert_eq!(compiled.sensitivities(run, directions), sensitivity, "{name}");
            }
        }
    }
}

#[test]
fn a_lane_that_diverges_does_not_disturb_the_others() {
    let compiled = model("linear", &[("a", 50.0)], &[("x", "a*x^3 + u", "1.0")], &[("y", "x")]);
    let drive = drive(100, |_| 0.0);
    let thetas = [[50.0], [-1.0], [-2.0]];
    let runs: Vec<Run<'_>> = thetas.iter().map(|theta| Run::new(&drive, theta)).collect();
    let all = compiled.simulate_many(&runs);
    assert_eq!(all[0].diverged, compiled.simulate(&runs[0]).diverged);
    assert!(all[0].diverged.is_some() && all[0].outputs[0][99].is_nan());
    assert_eq!(all[1..], [compiled.simulate(&runs[1]), compiled.simulate(&runs[2])]);
}
