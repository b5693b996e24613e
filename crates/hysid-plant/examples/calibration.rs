//! How often a global calibration reaches the best known minimum, and what it spends: random plants whose user's values are wrong
//! by up to a factor, on short and long records, beside a local search from the truth. Run with `--release`; arguments: number
//! of cases in each class (20), a part of a class's name.

use hysid_plant::{Calibration, Compiled, Data, Drive, Run, Settings, Simulation};
use hysid_signal::{Excitation, autoregressive_noise};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// Name, parameters with a typical value, states with derivative, outputs, inputs; times in seconds.
struct Plant {
    name: &'static str,
    parameters: &'static [(&'static str, f64)],
    states: &'static [(&'static str, &'static str)],
    outputs: &'static [&'static str],
    inputs: usize,
}

const PLANTS: &[Plant] = &[
    Plant {
        name: "resonant",
        parameters: &[("m", 2.0), ("c", 1.2), ("k", 200.0)],
        states: &[("x", "v"), ("v", "(u0 - c*v - k*x)/m")],
        outputs: &["x"],
        inputs: 1,
    },
    Plant {
        name: "servo",
        parameters: &[("j", 0.02), ("b", 0.1)],
        states: &[("q", "w"), ("w", "(u0 - b*w)/j")],
        outputs: &["q"],
        inputs: 1,
    },
    Plant {
        name: "servo, friction",
        parameters: &[("j", 0.02), ("b", 0.1), ("f", 0.3)],
        states: &[("q", "w"), ("w", "(u0 - b*w - f*sign(w))/j")],
        outputs: &["q"],
        inputs: 1,
    },
    Plant {
        name: "motor",
        parameters: &[("l", 0.05), ("r", 1.0), ("k", 0.5), ("j", 0.05), ("b", 0.02)],
        states: &[("i", "(u0 - r*i - k*w)/l"), ("w", "(k*i - b*w)/j")],
        outputs: &["i", "w"],
        inputs: 1,
    },
    Plant {
        name: "two masses",
        parameters: &[("m", 1.0), ("n", 0.5), ("c", 0.7), ("k", 200.0), ("h", 180.0)],
        states: &[("x", "v"), ("v", "(u0 - c*v - k*x - h*(x - y))/m"), ("y", "w"), ("w", "(h*(x - y) - c*w)/n")],
        outputs: &["x"],
        inputs: 1,
    },
    Plant {
        name: "two inputs",
        parameters: &[("c", 3.0), ("d", 1.0), ("g", 2.0), ("h", 0.7)],
        states: &[("x", "(u0 - g*x - h*(x - y))/c"), ("y", "(u1 - h*(y - x))/d")],
        outputs: &["x", "y"],
        inputs: 2,
    },
    Plant {
        name: "stiffening",
        parameters: &[("m", 2.0), ("c", 1.2), ("k", 200.0), ("p", 3e4)],
        states: &[("x", "v"), ("v", "(u0 - c*v - k*x - p*x^3)/m")],
        outputs: &["x"],
        inputs: 1,
    },
];

/// A plant with other values than those that made its data.
struct Case {
    compiled: Compiled,
    data: Data,
    truth: Vec<f64>,
}

fn case(plant: &Plant, samples: usize, off: f64, noise: f64, seed: u64) -> Option<Case> {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let mut within = |factor: f64| factor.powf(2.0 * random.random::<f64>() - 1.0);
    let mut text = "[time]\nperiod_s = 0.01\nhold = \"zero\"\n[inputs]\n".to_owned();
    for i in 0..plant.inputs {
        text += &format!("u{i} = \"u{i}_V\"\n");
    }
    text += "[parameters]\n";
    let mut truth = Vec::new();
    for (name, typical) in plant.parameters {
        let value = typical * within(2.0);
        let user = value * within(off);
        let room = within(3.0) * 2.0 * off;
        text += &format!("{name} = {{ value = {user:e}, min = {:e}, max = {:e} }}\n", user / room, user * room);
        truth.push(value);
    }
    text += "[states]\n";
    for (name, derivative) in plant.states {
        text += &format!("{name} = {{ derivative = \"{derivative}\", initial = 0.0 }}\n");
    }
    text += "[outputs]\n";
    for name in plant.outputs {
        text += &format!("{name}_m = \"{name}\"\n");
    }
    let compiled = Compiled::new(&Simulation::parse(&text, "case").expect("valid")).expect("valid");
    let shape = Excitation::Steps { hold: 10 + (seed % 4) as usize * 10 };
    let inputs = (0..plant.inputs).map(|i| shape.signal(samples, 0.01, 5.0, seed * 10 + i as u64).expect("valid"));
    let drive = Drive::new(0.0, 0.01, samples, inputs.collect()).expect("valid");
    let response = compiled.simulate(&Run::new(&drive, &truth).with_substeps(8));
    if response.diverged.is_some() {
        return None;
    }
    let measured = response.outputs.iter().enumerate().map(|(j, y)| {
        let mean = y.iter().sum::<f64>() / y.len() as f64;
        let variance = y.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / y.len() as f64;
        let colour = if seed.is_multiple_of(2) { 0.9 } else { 0.0 };
        let e = autoregressive_noise(&[colour], samples, noise * noise * variance, seed + 7000 * j as u64);
        y.iter().zip(e.expect("valid")).map(|(y, e)| y + e).collect()
    });
    let data = Data::new(&compiled, "case", drive.clone(), measured.collect()).expect("valid");
    Some(Case { compiled, data, truth })
}

/// The sum of squares, each output by its own.
fn cost(case: &Case, result: &Calibration) -> f64 {
    let power = |y: &[f64]| y.iter().map(|y| y * y).sum::<f64>();
    let outputs = result.residuals.iter().flatten().zip(&case.data.measured);
    outputs.map(|(e, y)| power(e) / power(y)).sum()
}

fn now() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let count: u64 = arguments.next().and_then(|n| n.parse().ok()).unwrap_or(20);
    let wanted = arguments.next().unwrap_or_default();
    println!(
        "{:16} {:>7} {:>6} {:>6} {:>8} {:>12} {:>10}",
        "plant", "samples", "off", "noise", "reached", "simulations", "seconds"
    );
    let mut all = (0, 0, 0, 0.0);
    for plant in PLANTS.iter().filter(|p| p.name.contains(&wanted)) {
        for (samples, off, noise) in
            [(150, 3.0, 0.05), (150, 10.0, 0.01), (150, 10.0, 0.2), (600, 30.0, 0.05), (3000, 10.0, 0.05)]
        {
            let (mut cases, mut reached, mut simulations, mut seconds) = (0, 0, 0, 0.0);
            for seed in 1..=count {
                let Some(case) = case(plant, samples, off, noise, seed) else { continue };
                let data = std::slice::from_ref(&case.data);
                let settings = Settings { gls_rounds: 0, ..Settings::default() };
                let from_truth = Settings { gls_rounds: 0, ..Settings::local(case.truth.clone()) };
                let best = case.compiled.calibrate(data, &from_truth).map_or(f64::INFINITY, |c| cost(&case, &c));
                let began = now();
                let found = case.compiled.calibrate(data, &settings);
                seconds += now() - began;
                cases += 1;
                if let Ok(found) = found {
                    simulations += found.simulations;
                    reached += usize::from(cost(&case, &found) <= 1.01 * best);
                }
            }
            let each = |x: f64| x / f64::from(cases.max(1));
            println!(
                "{:16} {samples:7} {off:6} {noise:6} {:>5}/{:<3} {:11.1} {:10.4}",
                plant.name,
                reached,
                cases,
                each(simulations as f64),
                each(seconds)
            );
            all = (all.0 + reached, all.1 + cases, all.2 + simulations, all.3 + seconds);
        }
    }
    println!("all: {} of {} reached, {} simulations, {:.1} s", all.0, all.1, all.2, all.3);
}
