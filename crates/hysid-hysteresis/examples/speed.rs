//! Prints how fast Bouc-Wen and Preisach run, as ratios against references run in turn with them.
//!
//! `cargo run --release -p hysid-hysteresis --example speed` compares the Bouc-Wen operator with the same arithmetic written out
//! by hand in one loop (and, where a C compiler is found, in C), and the Preisach staircase with the grid of relays.

use std::hint::black_box;
use std::process::Command;
use std::time::Instant;

use hysid_hysteresis::{BoucWen, Operator, PreisachPlane, Sampled};
use hysid_signal::white_noise;

const SAMPLES: usize = 1_000_000;

/// Seconds that `work` takes.
fn seconds(work: impl FnOnce()) -> f64 {
    let start = Instant::now();
    work();
    start.elapsed().as_secs_f64()
}

/// Median, least and largest of `of` over some rounds of a measurement.
fn spread(mut values: Vec<f64>) -> String {
    values.sort_by(f64::total_cmp);
    format!("{:.3} ({:.3} to {:.3})", values[values.len() / 2], values[0], values[values.len() - 1])
}

const C_SOURCE: &str = r#"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
static double now(void) { struct timespec t; clock_gettime(CLOCK_MONOTONIC, &t); return t.tv_sec + 1e-9 * t.tv_nsec; }
int main(int argc, char **argv) {
    long n = atol(argv[1]);
    double *u = malloc(n * sizeof *u), *y = malloc(n * sizeof *y);
    FILE *f = fopen(argv[2], "rb"); if (fread(u, sizeof *u, n, f) != (size_t)n) return 1; fclose(f);
    const double a = 0.9, b = 0.08, g = 0.02, d = 1.6, dt = 0.001;
    for (int r = 0; r < 5; r++) {
        double t0 = now(), h = 0;
        y[0] = d * u[0] - h;
        for (long k = 1; k < n; k++) {
            double v = (u[k] - u[k - 1]) / dt, w = fabs(v);
            double k1 = a * v - b * w * h - g * v * fabs(h);
            double x = h + 0.5 * dt * k1;
            double k2 = a * v - b * w * x - g * v * fabs(x);
            x = h + 0.5 * dt * k2;
            double k3 = a * v - b * w * x - g * v * fabs(x);
            x = h + dt * k3;
            double k4 = a * v - b * w * x - g * v * fabs(x);
            h += dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
            y[k] = d * u[k] - h;
        }
        double s = 0; for (long k = 0; k < n; k++) s += y[k];
        fprintf(stderr, "%.17g\n", s);
        printf("%.9f\n", now() - t0);
    }
}
"#;

/// The least of five runs of the C loop, in seconds; none where there is no C compiler.
fn c_seconds(u: &[f64]) -> Option<f64> {
    let directory = std::env::temp_dir().join(format!("hysid-speed-{}", std::process::id()));
    std::fs::create_dir_all(&directory).ok()?;
    let (source, program, data) = (directory.join("loop.c"), directory.join("loop"), directory.join("u.bin"));
    std::fs::write(&source, C_SOURCE).ok()?;
    std::fs::write(&data, u.iter().flat_map(|u| u.to_le_bytes()).collect::<Vec<u8>>()).ok()?;
    let compiled = Command::new("cc").args(["-O2", "-o"]).arg(&program).arg(&source).arg("-lm").status().ok()?;
    let output = compiled.success().then(|| Command::new(&program).arg(u.len().to_string()).arg(&data).output());
    let _ = std::fs::remove_dir_all(&directory);
    let text = String::from_utf8(output?.ok()?.stdout).ok()?;
    text.lines().filter_map(|line| line.parse().ok()).min_by(f64::total_cmp)
}

fn main() {
    // A sum of sines whose amplitude is modulated.
    let u: Vec<f64> = (0..SAMPLES)
        .map(|n| {
            let t = n as f64 * 1e-3;
            (1.0 + 0.6 * (1.07 * t).sin()) * (10.0 * (9.0 * t).sin() + 7.0 * (23.0 * t).sin() + 5.0 * (41.0 * t).sin())
        })
        .collect();
    let bouc_wen =
        Sampled::new(BoucWen::piezo(1.6, 0.9, 0.08, 0.02).expect("good parameters"), 1e-3, 1).expect("a period");
    let least = |mut work: Box<dyn FnMut() + '_>| (0..5).map(|_| seconds(&mut work)).fold(f64::MAX, f64::min);
    let mut ratios = Vec::new();
    let mut y = vec![0.0; SAMPLES];
    for _ in 0..7 {
        let ours = least(Box::new(|| bouc_wen.run_from(&mut bouc_wen.init(), black_box(&u), black_box(&mut y))));
        let Some(c) = c_seconds(&u) else { break };
        ratios.push(ours / c);
    }
    if ratios.is_empty() {
        println!("Bouc-Wen RK4: no C compiler to compare with");
    } else {
        println!("Bouc-Wen RK4, {SAMPLES} samples: time over that of a C loop {}", spread(ratios));
    }

    let random = white_noise(SAMPLES, 0.16, 1).expect("a good variance");
    for cells in [100, 1000] {
        let plane = PreisachPlane::uniform(-1.0, 1.0, cells);
        let (grid, fast) = (plane.grid().expect("a good plane"), plane.staircase().expect("a good plane"));
        let few = 2_000_000 / (cells * cells) + 20;
        let (mut ratios, mut rates) = (Vec::new(), Vec::new());
        for _ in 0..7 {
            let mut state = grid.init();
            let mut y = vec![0.0; few];
            let slow = seconds(|| grid.run_from(&mut state, black_box(&random[..few]), black_box(&mut y))) / few as f64;
            let quick = seconds(|| drop(black_box(fast.run(black_box(&random))))) / SAMPLES as f64;
            ratios.push(slow / quick);
            rates.push(1e-6 / quick);
        }
        println!(
            "Preisach, {cells} x {cells}, {SAMPLES} random samples: grid over staircase {}, staircase {} million samples/s",
            spread(ratios),
            spread(rates)
        );
    }
}
