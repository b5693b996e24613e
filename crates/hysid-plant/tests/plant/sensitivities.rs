//! Sensitivities against central differences, and the linear model against the equations.

use crate::common::equations::{CASES, drive, model, wobble};
use hysid_plant::{Direction, Injection, Run, Slot, Start};

#[test]
fn sensitivities_equal_central_differences() {
    for (name, hold, parameters, states, outputs) in CASES {
        let compiled = model(hold, parameters, states, outputs);
        let drive = drive(300, wobble);
        let theta = compiled.theta();
        let free = compiled.free_states();
        let x0: Vec<f64> = free.iter().map(|_| 0.02).collect();
        let run = Run::new(&drive, &theta).from(Start::Document(&x0));
        let injected: Vec<f64> = (0..300).map(|n| (0.05 * n as f64).cos()).collect();
        let mut slots = vec![Slot::Input(0), Slot::Output(0)];
        slots.extend((0..states.len()).map(Slot::State));
        let mut directions: Vec<Direction<'_>> = (0..theta.len()).map(Direction::Parameter).collect();
        directions.extend(free.iter().map(|&i| Direction::Initial(i)));
        let first_slot = directions.len();
        directions.extend(slots.iter().map(|&slot| Direction::Injection(Injection { slot, series: &injected })));
        let result = compiled.sensitivities(&run, &directions);
        assert_eq!(result.response, compiled.simulate(&run), "{name}: values do not depend on tangents");
        for (i, tangent) in result.tangents.iter().enumerate() {
            let size = if i < theta.len() { theta[i].abs() } else { 0.05 };
            let eps = 1e-5 * size;
            let shifted = |sign: f64| {
                let (mut theta, mut x0) = (theta.clone(), x0.clone());
                let series: Vec<f64> = injected.iter().map(|s| sign * eps * s).collect();
                let mut injections = Vec::new();
                if i < theta.len() {
                    theta[i] += sign * eps;
                } else if i < first_slot {
                    x0[i - theta.len()] += sign * eps;
                } else {
                    injections.push(Injection { slot: slots[i - first_slot], series: &series });
                }
                let run = Run { injections: &injections, theta: &theta, start: Start::Document(&x0), ..run };
                compiled.simulate(&run).outputs
            };
            let (up, down) = (shifted(1.0), shifted(-1.0));
            for (j, tangent) in tangent.iter().enumerate() {
                let scale = tangent.iter().fold(1e-9, |m: f64, t| m.max(t.abs()));
                let mut outliers = 0;
                for n in 0..300 {
                    let difference = (up[j][n] - down[j][n]) / (2.0 * eps);
                    if (tangent[n] - difference).abs() > 2e-3 * scale {
                        outliers += 1;
                        // A jump of the output itself moves with the parameter: a few samples may lie on both of its sides.
                        let jumps = *name == "coulomb" && j == 1;
                        assert!(
                            jumps && outliers < 6,
                            "{name}, direction {i}, output {j}, {n}: {} {difference}",
                            tangent[n]
                        );
                    }
                }
            }
        }
    }
}

#[test]
fn an_amplitude_at_zero_has_the_sensitivity_of_its_injection() {
    // Adding w*phi to the equation at w = 0 is injecting phi.
    let states = [("x", "v", "0.0"), ("v", "20*u - 3*v - 100*x + w*u^2", "0.0")];
    let compiled = model("linear", &[("w", 0.0)], &states, &[("y", "x")]);
    let drive = drive(300, |t| (4.0 * t).sin().signum());
    let theta = compiled.theta();
    let phi = vec![1.0; 300];
    let directions = [Direction::Parameter(0), Direction::Injection(Injection { slot: Slot::State(1), series: &phi })];
    let mut run = Run::new(&drive, &theta);
    run.substeps = 8;
    let s = compiled.sensitivities(&run, &directions);
    // u^2 is 1 except on the way between -1 and 1.
    let norm: f64 = s.tangents[1][0].iter().map(|x| x * x).sum::<f64>().sqrt();
    let gap: f64 = s.tangents[0][0].iter().zip(&s.tangents[1][0]).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
    assert!(gap < 0.05 * norm, "{gap} {norm}");
}

#[test]
fn the_linear_model_is_that_of_the_equations() {
    let states = [("x", "v", "0.0"), ("v", "(u - 3*v - k*sin(x))/m", "0.0")];
    let compiled = model("linear", &[("m", 2.0), ("k", 50.0)], &states, &[("y", "3*x + 0.5*u")]);
    let linear = compiled.linearise(&compiled.theta(), &[0.5, 0.0], &[1.0]);
    assert_eq!(linear.a[..2], [0.0, 1.0]);
    assert!((linear.a[2] + 25.0 * 0.5_f64.cos()).abs() < 1e-12 && (linear.a[3] + 1.5).abs() < 1e-12);
    assert_eq!((linear.b, linear.c, linear.d), (vec![0.0, 0.5], vec![3.0, 0.0], vec![0.5]));
}
