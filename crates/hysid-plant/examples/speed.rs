//! Times simulations (4000 samples, 3 steps in each) beside the same Runge-Kutta loops written by hand: one run, one run with
//! all its sensitivities, and runs of 32 parameter sets at once. Ratios are those of the smallest of many processor times, taken
//! in turns; run with `--release`. An argument selects the models whose name contains it.

use std::hint::black_box;

use hysid_plant::{Compiled, Data, Direction, Drive, Run, Settings, Simulation};

const PERIOD: f64 = 0.005;
const SAMPLES: usize = 4000;
const STEPS: usize = 3;

const OSCILLATOR: &str = r#"
m = { value = 2.0, min = 0.5, max = 8.0 }
c = { value = 3.0, min = 0.0, max = 30.0 }
k = { value = 200.0, min = 20.0, max = 2000.0 }
"#;

fn text(parameters: &str, states: &str) -> String {
    format!(
        "[time]\nperiod_s = 0.005\n[inputs]\nu = \"u_N\"\n[parameters]\n{OSCILLATOR}{parameters}\n[states]\n\
         x = {{ derivative = \"v\", initial = 0.0 }}\n{states}\n[outputs]\nx_m = \"x\"\n"
    )
}

/// The classical Runge-Kutta method on `N` states with a linear input; `end` sees the states at the end of every step.
#[inline(always)]
fn by_hand<const N: usize>(
    u: &[f64],
    out: &mut [f64],
    f: impl Fn(&[f64; N], f64, f64) -> [f64; N],
    mut end: impl FnMut(&[f64; N]),
) {
    let mut x = [0.0; N];
    let h = PERIOD / STEPS as f64;
    let ahead = |x: &[f64; N], k: &[f64; N], h: f64| std::array::from_fn(|i| x[i] + h * k[i]);
    for n in 0..u.len() {
        out[n] = x[0];
        let (u0, slope) = (u[n], (u.get(n + 1).copied().unwrap_or(u[n]) - u[n]) / PERIOD);
        for s in 0..STEPS {
            let t = h * s as f64;
            let at = |t: f64| u0 + slope * t;
            let now = n as f64 * PERIOD + t;
            let k1 = f(&x, at(t), now);
            let k2 = f(&ahead(&x, &k1, 0.5 * h), at(t + 0.5 * h), now + 0.5 * h);
            let k3 = f(&ahead(&x, &k2, 0.5 * h), at(t + 0.5 * h), now + 0.5 * h);
            let k4 = f(&ahead(&x, &k3, h), at(t + h), now + h);
            x = std::array::from_fn(|i| x[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]));
            end(&x);
        }
    }
}

/// The loops by hand: a regularised sign has its jump at 0, as in a plain loop.
fn hand(model: &str, u: &[f64], out: &mut [f64]) {
    let [m, c, k, p] = black_box([2.0, 3.0, 200.0, if model == "play" { 0.02 } else { 1.5 }]);
    let sign = |v: f64| {
        if v > 0.0 {
            1.0
        } else if v < 0.0 {
            -1.0
        } else {
            0.0
        }
    };
    match model {
        "oscillator" => by_hand(u, out, |&[x, v], u, _| [v, (u - c * v - k * x) / m], |_| ()),
        "dry friction" => by_hand(u, out, |&[x, v], u, _| [v, (u - c * v - k * x - p * sign(v)) / m], |_| ()),
        "play" => {
            let held = std::cell::Cell::new(0.0_f64);
            let play = |x: f64| held.get().max(x - p).min(x + p);
            by_hand(u, out, |&[x, v], u, _| [v, (u - c * v - k * play(x)) / m], |x| held.set(play(x[0])));
        }
        "delay" => {
            let late = |t: f64| {
                let at = ((t - 0.0123) / PERIOD).max(0.0);
                let (i, share) = (at as usize, at.fract());
                u[i] + share * (u.get(i + 1).unwrap_or(&u[i]) - u[i])
            };
            by_hand(u, out, |&[x, v], _, t| [v, (late(t) - c * v - k * x) / m], |_| ());
        }
        _ => by_hand(
            u,
            out,
            |&[x, v, z, w], u, _| {
                let spring = p * 100.0 * (x - z);
                [v, (u - c * v - k * x - spring) / m, w, (spring - c * w - k * z * z * z) / m]
            },
            |_| (),
        ),
    }
}

/// Processor time of this thread in seconds: other work on the machine does not count.
fn now() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

/// The smallest time of each task; the tasks take turns.
fn smallest(repetitions: usize, tasks: &mut [&mut dyn FnMut()]) -> Vec<f64> {
    let mut best = vec![f64::INFINITY; tasks.len()];
    for _ in 0..repetitions {
        for (task, best) in tasks.iter_mut().zip(&mut best) {
            let began = now();
            task();
            *best = best.min(now() - began);
        }
    }
    best
}

fn main() {
    let wanted = std::env::args().nth(1).unwrap_or_default();
    let models = [
        ("oscillator", text("", "v = { derivative = \"(u - c*v - k*x)/m\", initial = 0.0 }")),
        (
            "dry friction",
            text(
                "F_c = { value = 1.5, min = 0.0, max = 20.0 }",
                "v = { derivative = \"(u - c*v - k*x - F_c*sign(v))/m\", initial = 0.0 }",
            ),
        ),
        (
            "play",
            text(
                "r = { value = 0.02, min = 0.0, max = 1.0 }",
                "v = { derivative = \"(u - c*v - k*play(x, r))/m\", initial = 0.0 }",
            ),
        ),
        (
            "delay",
            text(
                "s = { value = 0.0123, min = 0.0, max = 0.1 }",
                "v = { derivative = \"(delay(u, s) - c*v - k*x)/m\", initial = 0.0 }",
            ),
        ),
        (
            "two masses",
            text(
                "k_2 = { value = 150.0, min = 0.0, max = 2000.0 }",
                "v = { derivative = \"(u - c*v - k*x - k_2*(x - z))/m\", initial = 0.0 }\n\
                 z = { derivative = \"w\", initial = 0.0 }\n\
                 w = { derivative = \"(k_2*(x - z) - c*w - k*z^3)/m\", initial = 0.0 }",
            ),
        ),
    ];
    let u: Vec<f64> = (0..SAMPLES).map(|i| 12.0 * (0.03 * i as f64).sin() + 6.0 * (0.071 * i as f64).sin()).collect();
    let drive = Drive::new(0.0, PERIOD, SAMPLES, vec![u.clone()]).expect("valid");
    println!("times of one run by hand (each of 32: the batch's time over 32)");
    println!(
        "{:14} {:>8} {:>8} {:>12} {:>13} {:>15} {:>12}",
        "model", "hand us", "one run", "all tangents", "each of 32", "of 32, 1 tang.", "error"
    );
    for (name, text) in models.iter().filter(|(name, _)| name.contains(&wanted)) {
        let compiled = Compiled::new(&Simulation::parse(text, "speed").expect("valid")).expect("valid");
        let theta = compiled.theta();
        let run = Run::new(&drive, &theta).with_substeps(STEPS);
        let sets: Vec<Vec<f64>> =
            (0..32).map(|i| theta.iter().map(|t| t * (1.0 + 0.01 * f64::from(i))).collect()).collect();
        let runs: Vec<Run<'_>> = sets.iter().map(|theta| Run { theta, ..run }).collect();
        let directions: Vec<Direction<'_>> = (0..theta.len()).map(Direction::Parameter).collect();
        let mut out = vec![0.0; SAMPLES];
        hand(name, &u, &mut out);
        let y = compiled.simulate(&run).outputs.swap_remove(0);
        let largest = y.iter().fold(0.0, |m: f64, y| m.max(y.abs()));
        let error = y.iter().zip(&out).fold(0.0, |m: f64, (a, b)| m.max((a - b).abs())) / largest;
        let mut by_hand = || hand(name, black_box(&u), black_box(&mut out));
        let mut one = || drop(black_box(compiled.simulate(black_box(&run))));
        let mut tangents = || drop(black_box(compiled.sensitivities(black_box(&run), &directions)));
        let mut many = || drop(black_box(compiled.simulate_many(black_box(&runs))));
        let mut many_tangents = || drop(black_box(compiled.sensitivities_many(black_box(&runs), &directions[..1])));
        let times = smallest(15, &mut [&mut by_hand, &mut one, &mut tangents, &mut many, &mut many_tangents]);
        let ratio = |i: usize, of: f64| times[i] / of / times[0];
        println!(
            "{:14} {:8.1} {:8.2} {:>8.2} ({}) {:13.2} {:15.2} {:12.1e}",
            name,
            times[0] * 1e6,
            ratio(1, 1.0),
            ratio(2, 1.0),
            directions.len(),
            ratio(3, 32.0),
            ratio(4, 32.0),
            error,
        );
    }
    if wanted.is_empty() {
        let text = &models[1].1;
        let mut simulation = Simulation::parse(text, "speed").expect("valid");
        let compiled = Compiled::new(&simulation).expect("valid");
        let theta = compiled.theta();
        let y = compiled.simulate(&Run::new(&drive, &theta).with_substeps(STEPS)).outputs;
        let data = Data::new(&compiled, "speed", drive.clone(), y).expect("valid");
        simulation.parameters.iter_mut().for_each(|p| p.value *= 1.25);
        let start = Compiled::new(&simulation).expect("valid");
        let data = std::slice::from_ref(&data);
        let mut calibrate = || drop(black_box(start.calibrate(black_box(data), &Settings::default()).ok()));
        let time = smallest(3, &mut [&mut calibrate])[0];
        println!("global calibration of dry friction: {:.1} ms", time * 1e3);
    }
}
