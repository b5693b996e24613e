//! Times one of our operators, the simulation of a `.sim.toml`, or selection of growing size, on one thread; prints one JSON object.
//!
//! The same arguments and the same object as the scripts and the C loop in `peers/`, so that any of them can stand beside the
//! others. Inputs and outputs are files of little-endian doubles.

use std::error::Error;
use std::hint::black_box;
use std::path::Path;

use hysid_bench::limits::{Limits, measure};
use hysid_bench::timing::{list, read_doubles, repeat, report, thread_seconds, write_doubles};
use hysid_bench::{dictionary, known_system};
use hysid_dictionary::{Design, Record};
use hysid_hysteresis::{BoucWen, Operator, PreisachPlane, Sampled};
use hysid_plant::{ClockSource, Compiled, Drive, Run, Simulation};
use hysid_select::{Criterion, Options, Search, select};

const USAGE: &str = "timed input random|modulated|force SAMPLES OUT
timed staircase|grid CELLS SAMPLES REPS IN OUT
timed bouc-wen SAMPLES REPS IN OUT D A B G PERIOD
timed simulate one|batch STEPS SAMPLES REPS MODEL IN OUT
timed scaling ROUNDS
timed limits THREADS ROUNDS";

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = args.iter().map(String::as_str).collect();
    match run(&words) {
        Ok(text) => println!("{text}"),
        Err(e) => {
            eprintln!("{e}\n{USAGE}");
            std::process::exit(2);
        }
    }
}

fn run(words: &[&str]) -> Result<String, Box<dyn Error>> {
    rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build_global()?;
    match words {
        ["input", kind, samples, out] => {
            write_doubles(Path::new(out), &input(kind, samples.parse()?)?)?;
            Ok(format!("wrote {out}"))
        }
        [form @ ("staircase" | "grid"), cells, samples, reps, from, to] => {
            let u = first(from, samples.parse()?)?;
            preisach(form, cells.parse()?, &u, reps.parse()?, Path::new(to))
        }
        ["bouc-wen", samples, reps, from, to, d, a, b, g, period] => {
            let operator = BoucWen::piezo(d.parse()?, a.parse()?, b.parse()?, g.parse()?)?;
            let sampled = Sampled::new(operator, period.parse()?, 1)?;
            let u = first(from, samples.parse()?)?;
            operate(&sampled, &u, reps.parse()?, Path::new(to))
        }
        ["simulate", form, steps, samples, reps, model, from, to] => {
            let u = first(from, samples.parse()?)?;
            simulate(form, steps.parse()?, Path::new(model), u, reps.parse()?, Path::new(to))
        }
        ["scaling", rounds] => scaling(rounds.parse()?),
        ["limits", threads, rounds] => {
            let Limits { gflops, product_gflops, gigabytes } = measure(threads.parse()?, rounds.parse()?);
            Ok(format!(
                "{{\"gflops\": {gflops:.1}, \"product_gflops\": {product_gflops:.1}, \"gigabytes\": {gigabytes:.1}}}"
            ))
        }
        _ => Err("unknown words".into()),
    }
}

/// The beginning of a file of doubles.
fn first(path: &str, samples: usize) -> Result<Vec<f64>, Box<dyn Error>> {
    let mut u = read_doubles(Path::new(path))?;
    if u.len() < samples {
        return Err(format!("{path} has {} samples, not {samples}", u.len()).into());
    }
    u.truncate(samples);
    Ok(u)
}

/// The inputs of the cases.
fn input(kind: &str, samples: usize) -> Result<Vec<f64>, Box<dyn Error>> {
    let by = |f: fn(f64) -> f64| (0..samples).map(|n| f(n as f64)).collect();
    match kind {
        // Gaussian, so that nearly all of it lies in the Preisach plane from -1 to 1.
        "random" => Ok(hysid_signal::white_noise(samples, 0.16, 1)?),
        // Sines whose common amplitude is modulated.
        "modulated" => Ok(by(|n| {
            let t = n * 1e-3;
            (1.0 + 0.6 * (1.07 * t).sin()) * (10.0 * (9.0 * t).sin() + 7.0 * (23.0 * t).sin() + 5.0 * (41.0 * t).sin())
        })),
        "force" => Ok(by(|n| 12.0 * (0.03 * n).sin() + 6.0 * (0.071 * n).sin())),
        _ => Err(format!("no input `{kind}`").into()),
    }
}

fn preisach(form: &str, cells: usize, u: &[f64], reps: usize, to: &Path) -> Result<String, Box<dyn Error>> {
    let plane = PreisachPlane::uniform(-1.0, 1.0, cells);
    match form {
        "grid" => operate(&plane.grid()?, u, reps, to),
        _ => operate(&plane.staircase()?, u, reps, to),
    }
}

fn operate(operator: &impl Operator, u: &[f64], reps: usize, to: &Path) -> Result<String, Box<dyn Error>> {
    let mut y = vec![0.0; u.len()];
    let (cpu, wall) = repeat(reps, || operator.run_from(&mut operator.init(), black_box(u), black_box(&mut y)));
    write_doubles(to, &y)?;
    Ok(report(&cpu, &wall, u.len()))
}

/// Parameter sets that a batch runs: the file's, and 31 about it.
const BATCH: usize = 32;

fn simulate(
    form: &str,
    steps: usize,
    model: &Path,
    u: Vec<f64>,
    reps: usize,
    to: &Path,
) -> Result<String, Box<dyn Error>> {
    let simulation = Simulation::parse(&std::fs::read_to_string(model)?, &model.to_string_lossy())?;
    let ClockSource::Period(period) = simulation.time.clock else {
        return Err(format!("{} has no period_s", model.display()).into());
    };
    let samples = u.len();
    let compiled = Compiled::new(&simulation)?;
    let drive = Drive::new(0.0, period, samples, vec![u])?;
    let theta = compiled.theta();
    let run = Run::new(&drive, &theta).with_substeps(steps);
    let mut y = Vec::new();
    if form == "one" {
        let (cpu, wall) = repeat(reps, || y = compiled.simulate(black_box(&run)).outputs);
        write_doubles(to, y.first().map_or(&[], Vec::as_slice))?;
        return Ok(report(&cpu, &wall, samples));
    }
    let sets: Vec<Vec<f64>> = (0..BATCH).map(|i| theta.iter().map(|t| t * (1.0 + 0.01 * i as f64)).collect()).collect();
    let runs: Vec<Run<'_>> = sets.iter().map(|theta| Run { theta, ..run }).collect();
    let (cpu, wall) = repeat(reps, || {
        y = compiled.simulate_many(black_box(&runs)).into_iter().next().map_or_else(Vec::new, |run| run.outputs);
    });
    write_doubles(to, y.first().map_or(&[], Vec::as_slice))?;
    Ok(report(&cpu, &wall, BATCH * samples))
}

/// What one axis of the cost of a selection is measured over: its value, samples, lags and terms.
type Point = (usize, usize, usize, usize);

/// CPU seconds of a selection against samples N, candidates M and chosen terms n; every round goes through all points.
fn scaling(rounds: usize) -> Result<String, Box<dyn Error>> {
    let samples = [10_000, 31_623, 100_000, 316_228, 1_000_000];
    let axes: [(&str, Vec<Point>); 3] = [
        ("N", samples.iter().map(|&n| (n, n, 5, 15)).collect()),
        ("M", [3, 5, 8, 12, 16, 20].iter().map(|&lags| (dictionary(lags).len(), 20_000, lags, 15)).collect()),
        ("n", [4, 8, 16, 32, 64].iter().map(|&terms| (terms, 20_000, 5, terms)).collect()),
    ];
    let (u, y) = known_system(1_000_000, 1, 0.01);
    let mut parts = Vec::new();
    for (name, points) in axes {
        let mut seconds = vec![Vec::new(); points.len()];
        for _ in 0..rounds.max(1) {
            for (&(_, n, lags, terms), seconds) in points.iter().zip(&mut seconds) {
                let began = thread_seconds();
                let dictionary = dictionary(lags);
                let design = Design::new(&dictionary, &[Record::siso(&u[..n], &y[..n])])?;
                let options =
                    Options { search: Search::Greedy, criterion: Criterion::Terms(terms), ..Options::default() };
                black_box(select(&design, &design.target(), &options)?);
                seconds.push(thread_seconds() - began);
            }
        }
        let points: Vec<String> =
            points.iter().zip(&seconds).map(|((x, ..), s)| format!("{{\"x\": {x}, \"cpu_s\": {}}}", list(s))).collect();
        parts.push(format!("{{\"axis\": \"{name}\", \"points\": [{}]}}", points.join(", ")));
    }
    Ok(format!("[{}]", parts.join(", ")))
}
