//! What this machine can do at most: multiply-adds from registers and from the nearest cache, and traffic to memory, on one thread and on more.
//!
//! The rates that the rows of `docs/performance.md` are held against. Every thread works on numbers of its own; a rate is that of all
//! threads together over the time of the slowest, the best of the rounds, since what disturbs can only slow it down.

use std::hint::black_box;
use std::sync::Barrier;
use std::time::Instant;

use hysid_linalg::lanes::{LANE, Lane, Machine, Row, Step, flat};

/// Rates of all threads together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Fused multiply-adds from registers: 10^9 floating-point operations a second, two for each.
    pub gflops: f64,
    /// The matrix product that selection is made of, on one tile that stays in the first-level cache: likewise.
    pub product_gflops: f64,
    /// a = b + s c over vectors larger than the caches: 10^9 bytes a second, 24 for each entry.
    pub gigabytes: f64,
}

/// Measures with this many threads.
pub fn measure(threads: usize, rounds: usize) -> Limits {
    let flops = 2.0 * (CHAINS * LANE * TURNS) as f64;
    let gflops = best(threads, rounds, flops, || (), |()| multiply_adds(black_box(1.0)));
    let flops = 2.0 * (ROWS * COLUMNS * TILE * LANE * PASSES) as f64;
    let product_gflops = best(threads, rounds, flops, Tile::new, Tile::multiply);
    let bytes = 24.0 * ENTRIES as f64;
    let vectors = || [0.0, 1.0, 2.0].map(|x| vec![x; ENTRIES]);
    let gigabytes = best(threads, rounds, bytes, vectors, |[a, b, c]| triad(a, b, c));
    Limits { gflops, product_gflops, gigabytes }
}

/// The best rate of all threads together, in 10^9 a second; `amount` is what one thread does in a round.
fn best<T>(
    threads: usize,
    rounds: usize,
    amount: f64,
    make: impl Fn() -> T + Sync,
    work: impl Fn(&mut T) + Sync,
) -> f64 {
    let barrier = Barrier::new(threads);
    let one = || {
        // Made by the thread that uses it, so that its pages lie near to it.
        let mut own = make();
        let mut seconds = Vec::with_capacity(rounds);
        for _ in 0..rounds.max(1) {
            barrier.wait();
            let began = Instant::now();
            work(&mut own);
            seconds.push(began.elapsed().as_secs_f64());
        }
        seconds
    };
    let seconds: Vec<Vec<f64>> = std::thread::scope(|scope| {
        let handles: Vec<_> = (0..threads).map(|_| scope.spawn(one)).collect();
        handles.into_iter().filter_map(|h| h.join().ok()).collect()
    });
    let slowest = |r: usize| seconds.iter().map(|s| s[r]).fold(0.0, f64::max);
    let quickest = (0..rounds.max(1)).map(slowest).fold(f64::INFINITY, f64::min);
    1e-9 * amount * seconds.len() as f64 / quickest
}

/// Chains of multiply-adds that do not wait for each other: more than latency times units of any processor, fewer than registers.
const CHAINS: usize = 12;
/// Multiply-adds of a chain in a round, about 0.1 s.
const TURNS: usize = 40_000_000;

fn multiply_adds(x: f64) {
    #[cfg(target_arch = "x86_64")]
    {
        if is_x86_feature_detected!("avx512f") {
            // SAFETY: the processor has the features.
            return unsafe { wide(x) };
        }
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
            // SAFETY: the processor has the features.
            return unsafe { fused(x) };
        }
    }
    black_box(chains(x, |a, b, c| a * b + c));
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,fma")]
fn wide(x: f64) {
    black_box(chains(x, f64::mul_add));
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn fused(x: f64) {
    black_box(chains(x, f64::mul_add));
}

#[inline(always)]
fn chains(x: f64, multiply_add: impl Fn(f64, f64, f64) -> f64) -> [[f64; LANE]; CHAINS] {
    let mut sums = [[x; LANE]; CHAINS];
    for _ in 0..TURNS {
        for sum in &mut sums {
            for s in sum {
                *s = multiply_add(*s, x, x);
            }
        }
    }
    sums
}

/// Rows and columns of the product, and lanes of a tile: 40 KB in all.
const ROWS: usize = 8;
const COLUMNS: usize = 12;
const TILE: usize = 32;
/// Products in a round, about 0.1 s.
const PASSES: usize = 100_000;

struct Tile {
    rows: Vec<Row>,
    columns: Vec<u32>,
    samples: Vec<Lane>,
    sums: Vec<Lane>,
}

impl Tile {
    fn new() -> Self {
        Self {
            rows: (0..ROWS).map(|i| Row { from: i * TILE, to: i * COLUMNS }).collect(),
            columns: (0..COLUMNS).map(|l| ((ROWS + l) * TILE * LANE) as u32).collect(),
            samples: vec![Lane([1e-3; LANE]); (ROWS + COLUMNS) * TILE],
            sums: vec![Lane::default(); ROWS * COLUMNS],
        }
    }

    fn multiply(&mut self) {
        let (machine, samples) = (Machine::detect(), black_box(&self.samples));
        for _ in 0..PASSES {
            let Self { rows, columns, sums, .. } = self;
            Step { t: TILE, rows, left: samples, columns, right: flat(samples), out: sums }.run(machine);
        }
        black_box(&self.sums);
    }
}

/// Entries of each of the three vectors of a thread: 256 MB.
const ENTRIES: usize = 32_000_000;

fn triad(a: &mut [f64], b: &[f64], c: &[f64]) {
    let s = black_box(3.0);
    for ((a, b), c) in a.iter_mut().zip(b).zip(c) {
        *a = b + s * c;
    }
    black_box(a);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rate_is_that_of_all_threads_over_the_time_of_the_slowest() {
        use std::time::Duration;
        let pause = |own: &mut u64| std::thread::sleep(Duration::from_millis(*own));
        // Two threads with 10^9 each in at least 50 ms.
        let rate = best(2, 3, 1e9, || 50, pause);
        assert!((1.0..=40.0).contains(&rate), "{rate}");
    }
}
