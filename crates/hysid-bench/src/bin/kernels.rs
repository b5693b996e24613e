//! Runs one kernel once on fixed input, for instruction counts; or writes the data file of a benchmark.
//!
//! `kernels data N SEED NOISE PATH` writes PATH.npy and PATH.json; `kernels NAME` runs a kernel; `kernels nothing` only makes the
//! inputs, which is subtracted.

use std::hint::black_box;
use std::io::Write;

use hysid_bench::{TRUTH, dictionary, known_model, known_system};
use hysid_dictionary::{Design, Record};
use hysid_linalg::Columns;
use hysid_select::{Criterion, Options, PressForm, Search, select};

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = args.iter().map(String::as_str).collect();
    match words[..] {
        ["data", n, seed, noise, path] => match (n.parse(), seed.parse(), noise.parse()) {
            (Ok(n), Ok(seed), Ok(noise)) => {
                if let Err(e) = write_data(n, seed, noise, path) {
                    eprintln!("{path}: {e}");
                    std::process::exit(1);
                }
            }
            _ => usage(),
        },
        [name] => run(name),
        _ => usage(),
    }
}

fn usage() {
    eprintln!("kernels data N SEED NOISE PATH | kernels nothing|gram|press|search|free-run");
    std::process::exit(2);
}

fn run(name: &str) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build();
    if pool.is_err() {
        eprintln!("no thread pool");
        std::process::exit(1);
    }
    let (u, y) = known_system(2000, 1, 0.01);
    let dictionary = dictionary(5);
    let small = hysid_bench::dictionary(3);
    let record = [Record::siso(&u, &y)];
    let (Ok(design), Ok(few)) = (Design::new(&dictionary, &record), Design::new(&small, &record)) else {
        return usage();
    };
    let target = few.target();
    match name {
        "nothing" => {}
        "gram" => {
            black_box(design.gram_columns(&[0, 17, 40, 99, 150, 200, 250, 285]));
        }
        "press" => {
            let criterion = Criterion::Press(PressForm::Exact);
            let _ =
                black_box(select(&few, &target, &Options { search: Search::Greedy, criterion, ..Options::default() }));
        }
        "search" => {
            let _ = black_box(select(&few, &target, &Options::default()));
        }
        "free-run" => {
            let model = known_model();
            for _ in 0..50 {
                let _ = black_box(model.free_run(&[&u], &y[..3], u.len(), 1e6));
            }
        }
        _ => usage(),
    }
}

fn write_data(n: usize, seed: u64, noise: f64, path: &str) -> std::io::Result<()> {
    let (u, y) = known_system(n, seed, noise);
    let shape = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({n}, 2), }}");
    // The header ends at a multiple of 64 bytes with a newline.
    let padded = format!("{shape:<width$}\n", width = (shape.len() + 11).div_ceil(64) * 64 - 11);
    let mut file = std::io::BufWriter::new(std::fs::File::create(format!("{path}.npy"))?);
    file.write_all(b"\x93NUMPY\x01\x00")?;
    file.write_all(&(padded.len() as u16).to_le_bytes())?;
    file.write_all(padded.as_bytes())?;
    for (u, y) in u.iter().zip(&y) {
        file.write_all(&u.to_le_bytes())?;
        file.write_all(&y.to_le_bytes())?;
    }
    file.flush()?;
    let truth: Vec<String> = TRUTH.iter().map(|(c, t)| format!("\"{t}\": {c}")).collect();
    std::fs::write(format!("{path}.json"), format!("{{\"truth\": {{{}}}}}\n", truth.join(", ")))
}
