//! Prints how fast a CSV file is read, beside reading its bytes alone: `cargo run --release -p hysid-io --example read_speed FILE.csv`.

use std::path::PathBuf;
use std::time::Instant;

use hysid_io::{ReadOptions, read_recording};

fn main() {
    let Some(file) = std::env::args().nth(1).map(PathBuf::from) else {
        eprintln!("give a CSV file with a time column t_s");
        return;
    };
    let start = Instant::now();
    let bytes = std::fs::read(&file).map_or(0, |b| b.len());
    let raw = start.elapsed().as_secs_f64();
    let start = Instant::now();
    match read_recording(&file, &ReadOptions::default()) {
        Ok(r) => {
            let parsed = start.elapsed().as_secs_f64();
            let speed = |s: f64| bytes as f64 / s / 1e6;
            println!("{} samples; parsed at {:.0} MB/s, bytes alone at {:.0} MB/s", r.len(), speed(parsed), speed(raw));
        }
        Err(error) => eprintln!("{error}"),
    }
}
