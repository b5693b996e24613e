//! Times one simulation (oscillator with dry friction, 4000 samples, 3 steps in each) beside a loop written by hand, and its
//! sensitivities and a calibration beside one simulation. Smallest of many repetitions; run with `--release`.

use std::hint::black_box;
use std::time::Instant;

use hysid_plant::{Compiled, Data, Direction, Drive, Run, Settings, Simulation};

const TEXT: &str = r#"
[time]
period_s = 0.005
[inputs]
u = "u_N"
[parameters]
m = { value = 2.0, min = 0.5, max = 8.0 }
c = { value = 3.0, min = 0.0, max = 30.0 }
k = { value = 200.0, min = 20.0, max = 2000.0 }
F_c = { value = 1.5, min = 0.0, max = 20.0 }
[states]
x = { derivative = "v", initial = 0.0 }
v = { derivative = "(u - c*v - k*x - F_c*sign(v))/m", initial = 0.0 }
[outputs]
x_m = "x"
"#;

fn smallest(repetitions: usize, mut run: impl FnMut()) -> f64 {
    let times = (0..repetitions).map(|_| {
        let began = Instant::now();
        run();
        began.elapsed().as_secs_f64()
    });
    times.fold(f64::INFINITY, f64::min)
}

/// The same by hand, with a regularised sign as in a plain loop.
fn by_hand(u: &[f64], theta: [f64; 4], period: f64, out: &mut [f64]) {
    let [m, c, k, friction] = theta;
    let (mut x, mut v) = (0.0_f64, 0.0_f64);
    let h = period / 3.0;
    let f = |x: f64, v: f64, u: f64| {
        let sign = if v > 0.0 {
            1.0
        } else if v < 0.0 {
            -1.0
        } else {
            0.0
        };
        (v, (u - c * v - k * x - friction * sign) / m)
    };
    for n in 0..u.len() {
        out[n] = x;
        let (u0, slope) = (u[n], (u.get(n + 1).copied().unwrap_or(u[n]) - u[n]) / period);
        for s in 0..3 {
            let t = h * f64::from(s);
            let (a, b, d) = (u0 + slope * t, u0 + slope * (t + 0.5 * h), u0 + slope * (t + h));
            let k1 = f(x, v, a);
            let k2 = f(x + 0.5 * h * k1.0, v + 0.5 * h * k1.1, b);
            let k3 = f(x + 0.5 * h * k2.0, v + 0.5 * h * k2.1, b);
            let k4 = f(x + h * k3.0, v + h * k3.1, d);
            x += h / 6.0 * (k1.0 + 2.0 * k2.0 + 2.0 * k3.0 + k4.0);
            v += h / 6.0 * (k1.1 + 2.0 * k2.1 + 2.0 * k3.1 + k4.1);
        }
    }
}

fn main() {
    let simulation = Simulation::parse(TEXT, "speed").expect("valid");
    let compiled = Compiled::new(&simulation).expect("valid");
    let n = 4000;
    let u: Vec<f64> = (0..n).map(|i| 12.0 * (0.03 * i as f64).sin() + 6.0 * (0.071 * i as f64).sin()).collect();
    let drive = Drive::new(0.0, 0.005, n, vec![u.clone()]).expect("valid");
    let theta = compiled.theta();
    let run = Run::new(&drive, &theta).with_substeps(3);
    let mut out = vec![0.0; n];
    let hand = smallest(200, || by_hand(black_box(&u), [2.0, 3.0, 200.0, 1.5], 0.005, black_box(&mut out)));
    let one = smallest(60, || {
        black_box(compiled.simulate(black_box(&run)));
    });
    println!("by hand             {:8.1} us   1.00", hand * 1e6);
    println!("one simulation      {:8.1} us {:6.2}", one * 1e6, one / hand);
    let sets: Vec<Vec<f64>> =
        (0..32).map(|i| theta.iter().map(|t| t * (1.0 + 0.01 * f64::from(i))).collect()).collect();
    let runs: Vec<Run<'_>> = sets.iter().map(|theta| Run { theta, ..run }).collect();
    let many = smallest(20, || {
        black_box(compiled.simulate_many(black_box(&runs)));
    }) / 32.0;
    println!("each of 32          {:8.1} us {:6.2}", many * 1e6, many / hand);
    for count in [1, 2] {
        let directions: Vec<Direction<'_>> = (0..count).map(|i| Direction::Parameter(i % 4)).collect();
        let time = smallest(20, || {
            black_box(compiled.sensitivities_many(black_box(&runs), &directions));
        }) / 32.0;
        println!("each of 32 with {count:2}  {:8.1} us {:6.2}", time * 1e6, time / hand);
    }
    for count in [1, 2, 4, 8, 16] {
        let directions: Vec<Direction<'_>> = (0..count).map(|i| Direction::Parameter(i % 4)).collect();
        let time = smallest(20, || {
            black_box(compiled.sensitivities(black_box(&run), &directions));
        });
        println!("with {count:2} tangents    {:8.1} us {:6.2}", time * 1e6, time / hand);
    }
    let y = compiled.simulate(&run).outputs;
    let data = Data::new(&compiled, "speed", drive.clone(), y).expect("valid");
    let mut start = simulation.clone();
    for p in &mut start.parameters {
        p.value *= 1.25;
    }
    let start = Compiled::new(&start).expect("valid");
    let time = smallest(3, || {
        black_box(start.calibrate(black_box(std::slice::from_ref(&data)), &Settings::default()).ok());
    });
    println!("global calibration  {:8.1} ms", time * 1e3);
}
