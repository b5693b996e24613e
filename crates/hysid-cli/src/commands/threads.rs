//! The threads that a command works on.

use anyhow::Context;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::failure::Failure;

/// Threads at most.
const MOST_THREADS: usize = 1024;

/// Bytes of each thread's stack: an equation of as many terms as may be written is a tree as deep.
const STACK: usize = 32 << 20;

/// A pool of as many threads as `--threads` says, of all cores where it says nothing.
///
/// # Errors
/// None, or too many.
pub fn pool(threads: Option<usize>) -> Result<ThreadPool, Failure> {
    if let Some(n) = threads.filter(|n| !(1..=MOST_THREADS).contains(n)) {
        return Err(Failure::BadInput(format!("--threads is {n}; allowed is 1 to {MOST_THREADS}")));
    }
    let threads = threads.unwrap_or(0);
    Ok(ThreadPoolBuilder::new().num_threads(threads).stack_size(STACK).build().context("starting the threads")?)
}
