//! Delays and lags of the command of a drive whose dry friction sticks: against closed forms, finer steps and central differences.

use crate::common::equations::model;
use hysid_plant::{Compiled, Direction, Drive, Run};

const PERIOD_S: f64 = 0.13;
const INERTIA: f64 = 0.4;
const VISCOUS: f64 = 0.21;
const DRY: f64 = 0.16;

/// Held torques of either sign, from well below the dry friction to far above it, without a pattern.
fn torques(samples: usize) -> Vec<f64> {
    let mut state = 12_345_u64;
    let mut uniform = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as f64 / (1_u64 << 31) as f64
    };
    let mut torque = move || (2.0 * uniform() - 1.0) * if uniform() < 0.5 { 0.3 } else { 5.0 };
    (0..samples).map(|_| torque()).collect()
}

fn drive(samples: usize) -> Drive {
    Drive::new(0.0, PERIOD_S, samples, vec![torques(samples)]).expect("valid")
}

/// The drive with its command seen through an operator (`delay` or `lag`) of `tau`.
fn machine(hold: &str, operator: &str, tau: f64) -> Compiled {
    let parameters = [("J", INERTIA), ("b", VISCOUS), ("F_c", DRY), ("tau", tau)];
    let torque = format!("({operator}(u, tau) - b*w - F_c*sign(w))/J");
    model(hold, &parameters, &[("q", "w", "0.0"), ("w", &torque, "0.0")], &[("q_rad", "q")])
}

fn positions(machine: &Compiled, drive: &Drive, theta: &[f64], substeps: usize) -> Vec<f64> {
    machine.simulate(&Run::new(drive, theta).with_substeps(substeps)).outputs[0].clone()
}

fn rms(a: &[f64], b: &[f64]) -> f64 {
    (a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / a.len() as f64).sqrt()
}

/// Goes on by `left` seconds under a constant torque: exponentials between the moments at which the velocity reaches zero.
fn under_constant_torque(q: &mut f64, w: &mut f64, torque: f64, mut left: f64) {
    let decay = INERTIA / VISCOUS;
    while left > 0.0 {
        if *w == 0.0 && torque.abs() <= DRY {
            return;
        }
        let side = if *w == 0.0 { torque.signum() } else { w.signum() };
        let end = (torque - side * DRY) / VISCOUS;
        let stop = if end * side < 0.0 && *w != 0.0 { -decay * (end / (end - *w)).ln() } else { f64::INFINITY };
        let time = left.min(stop);
        let rest = (-time / decay).exp();
        *q += end * time + (*w - end) * decay * (1.0 - rest);
        *w = if time == stop { 0.0 } else { end + (*w - end) * rest };
        left -= time;
    }
}

/// The positions of the drive with its held command delayed by less than a period, in closed form.
fn delayed_exactly(torques: &[f64], tau: f64) -> Vec<f64> {
    let (mut q, mut w) = (0.0, 0.0);
    let mut before = torques[0];
    let mut out = Vec::new();
    for &torque in torques {
        out.push(q);
        under_constant_torque(&mut q, &mut w, before, tau);
        under_constant_torque(&mut q, &mut w, torque, PERIOD_S - tau);
        before = torque;
    }
    out
}

#[test]
fn a_delayed_command_moves_a_sticking_drive_as_the_closed_form_says() {
    let drive = drive(400);
    for tau in [0.003, 0.02, 0.07, 0.125] {
        let machine = machine("zero", "delay", tau);
        let exact = delayed_exactly(&torques(400), tau);
        let size = rms(&exact, &[0.0; 400]);
        for substeps in [1, 3, 8] {
            let error = rms(&positions(&machine, &drive, &machine.theta(), substeps), &exact);
            assert!(error < 1e-5 * size, "delay of {tau}, {substeps} steps: {error} of {size}");
        }
    }
}

#[test]
fn sensitivities_pass_through_the_moment_at_which_the_command_sets_the_drive_free() {
    let drive = drive(300);
    for (hold, operator, tolerance) in [("zero", "delay", 1e-4), ("linear", "delay", 0.02), ("zero", "lag", 1e-3)] {
        for tau in [0.003, 0.02, 0.07] {
            let machine = machine(hold, operator, tau);
            sensitivities_are_central_differences(
                &machine,
                &drive,
                8,
                tolerance,
                &format!("{hold}, {operator} of {tau}"),
            );
        }
    }
}

/// Compares the derivatives of the position by every parameter with central differences; the tolerance is a share of their rms.
fn sensitivities_are_central_differences(
    machine: &Compiled,
    drive: &Drive,
    substeps: usize,
    tolerance: f64,
    which: &str,
) {
    let theta = machine.theta();
    let directions: Vec<Direction<'_>> = (0..theta.len()).map(Direction::Parameter).collect();
    let found = machine.sensitivities(&Run::new(drive, &theta).with_substeps(substeps), &directions);
    for (p, tangent) in found.tangents.iter().enumerate() {
        let eps = 1e-7;
        let shifted = |by: f64| {
            let mut theta = theta.clone();
            theta[p] += by;
            positions(machine, drive, &theta, substeps)
        };
        let (up, down) = (shifted(eps), shifted(-eps));
        let difference: Vec<f64> = up.iter().zip(&down).map(|(a, b)| (a - b) / (2.0 * eps)).collect();
        let size = rms(&difference, &vec![0.0; difference.len()]);
        let error = rms(&tangent[0], &difference);
        assert!(error < tolerance * size, "{which}, parameter {p}: {error} of {size}");
    }
}

#[test]
fn sensitivities_pass_through_the_moments_at_which_a_drive_comes_to_rest_or_turns() {
    let drive = drive(300);
    // They are those of the solution, which the steps come near with their order: differences of coarse steps are others.
    for (hold, spring) in [("zero", 0.0), ("linear", 0.0), ("zero", 9.0), ("linear", 9.0)] {
        for (substeps, tolerance) in [(2, 2e-3), (8, 1e-5)] {
            let parameters = [("J", INERTIA), ("b", VISCOUS), ("F_c", DRY), ("k", spring)];
            let torque = "(u - b*w - k*q - F_c*sign(w))/J";
            let machine = model(hold, &parameters, &[("q", "w", "0.0"), ("w", torque, "0.0")], &[("q_rad", "q")]);
            sensitivities_are_central_differences(
                &machine,
                &drive,
                substeps,
                tolerance,
                &format!("{hold}, {spring}, {substeps}"),
            );
        }
    }
}

#[test]
fn finer_steps_tell_the_same_of_a_lagging_command() {
    // Steps that are cut at an event may be a billionth of the time constant: what is left of them must be no jump.
    for hold in ["zero", "linear"] {
        let drive = drive(400);
        for tau in [0.003, 0.03, 0.3, 3.0] {
            let machine = machine(hold, "lag", tau);
            let at = |substeps| positions(&machine, &drive, &machine.theta(), substeps);
            let fine = at(200);
            let size = rms(&fine, &[0.0; 400]);
            for substeps in [20, 50, 101] {
                let error = rms(&at(substeps), &fine);
                assert!(error < 0.01 * size, "{hold}, lag of {tau}, {substeps} steps: {error} of {size}");
            }
        }
    }
}

#[test]
fn friction_that_is_told_in_another_unit_of_speed_sticks_with_the_other() {
    // A part of the friction as a function of the speed in thousandths, over a parameter, and the other way round.
    let parameters = |dry: f64| [("J", INERTIA), ("b", VISCOUS), ("F_c", dry), ("F_d", DRY - dry), ("n", -3.0)];
    let machine = |dry: f64, sign: &str| {
        let torque = format!("(u - b*w - F_c*sign(w) - F_d*{sign})/J");
        model("linear", &parameters(dry), &[("q", "w", "0.0"), ("w", &torque, "0.0")], &[("q_rad", "q")])
    };
    let drive = drive(300);
    let run = |machine: &Compiled| {
        let theta = machine.theta();
        let directions = [0, 1, 2, 3].map(Direction::Parameter);
        machine.sensitivities(&Run::new(&drive, &theta).with_substeps(8), &directions)
    };
    let whole = run(&machine(DRY, "sign(w)"));
    for sign in
        ["sign(1000*w)", "sign(w/0.001)", "(-sign(-w))", "(-sign(w/n))", "(-sign(2*n*w))", "(2*step(1000*w) - 1)"]
    {
        for dry in [DRY, 0.3 * DRY] {
            let parted = run(&machine(dry, sign));
            let size = rms(&whole.response.outputs[0], &[0.0; 300]);
            assert!(rms(&parted.response.outputs[0], &whole.response.outputs[0]) < 1e-9 * size, "{sign}");
            for (p, tangent) in parted.tangents.iter().enumerate() {
                let expected = &whole.tangents[p.min(2)][0];
                let error = rms(&tangent[0], expected);
                let size = rms(expected, &[0.0; 300]);
                assert!(error < 1e-6 * size, "{sign}, parameter {p}: {error} of {size}");
            }
        }
    }
}
