//! A lag before a plant, however short beside the integration step: held inputs jump, and the response is that of the closed form.

use hysid_plant::{Compiled, Drive, Run, Simulation};

const PERIOD_S: f64 = 0.01;
const SAMPLES: usize = 300;

/// Levels held for a few samples, from a small generator of its own.
fn levels() -> Vec<f64> {
    let mut state = 7u64;
    let mut level = 0.0;
    (0..SAMPLES)
        .map(|n| {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            if n % 3 == 0 {
                level = (state >> 33) as f64 / f64::from(1u32 << 31) * 2.0 - 1.0;
            }
            level
        })
        .collect()
}

fn double_integrator(tau: f64) -> Compiled {
    let text = format!(
        "[time]\nperiod_s = {PERIOD_S}\nhold = \"zero\"\n[inputs]\nu = \"u_V\"\n[parameters]\ntau = {{ value = {tau:?}, min = -1.0, max = 1e6 }}\n\
         [states]\nx = {{ derivative = \"v\", initial = 0.0 }}\nv = {{ derivative = \"lag(u, tau)\", initial = 0.0 }}\n[outputs]\nx_m = \"x\"\nv_m_s = \"v\"\n"
    );
    Compiled::new(&Simulation::parse(&text, "lag.sim.toml").expect("valid")).expect("compiles")
}

#[test]
fn a_lag_of_any_length_moves_a_plant_as_its_closed_form_says() {
    let u = levels();
    let drive = Drive::new(0.0, PERIOD_S, SAMPLES, vec![u.clone()]).expect("valid");
    for substeps in [1, 2, 5] {
        for lengths in [0.0, 0.003, 0.05, 0.4, 1.0, 7.0, 300.0, 2e4] {
            let tau = lengths * PERIOD_S;
            let compiled = double_integrator(tau);
            let theta = compiled.theta();
            let y = compiled.simulate(&Run::new(&drive, &theta).with_substeps(substeps));
            let h = PERIOD_S;
            let left = if tau > 0.0 { (-h / tau).exp() } else { 0.0 };
            let gone = if tau > 0.0 { -(-h / tau).exp_m1() } else { 1.0 };
            let (mut lag, mut v, mut x) = (u[0], 0.0, 0.0);
            for n in 0..SAMPLES {
                let error = (y.outputs[0][n] - x).abs().max((y.outputs[1][n] - v).abs());
                assert!(error < 1e-9, "{substeps} steps, tau = {lengths} periods, sample {n}: {error:e}");
                let jump = lag - u[n];
                x += v * h + 0.5 * u[n] * h * h + jump * tau * (h - tau * gone);
                v += u[n] * h + jump * tau * gone;
                lag = u[n] + jump * left;
            }
        }
    }
}
