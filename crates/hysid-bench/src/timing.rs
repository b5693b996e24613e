//! Timing of a piece of work and the JSON object that says what came of it: the same keys as the scripts in `peers/`.

use std::fmt::Write as _;
use std::io;
use std::path::Path;
use std::time::Instant;

/// Processor time of this thread in seconds; wall time where the machine has no such clock.
pub fn thread_seconds() -> f64 {
    #[cfg(unix)]
    {
        let now = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
        now.tv_sec as f64 + 1e-9 * now.tv_nsec as f64
    }
    #[cfg(not(unix))]
    {
        std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).map_or(0.0, |d| d.as_secs_f64())
    }
}

/// CPU and wall seconds of each of `reps` repetitions of work on this thread.
pub fn repeat(reps: usize, mut work: impl FnMut()) -> (Vec<f64>, Vec<f64>) {
    (0..reps.max(1))
        .map(|_| {
            let (wall, cpu) = (Instant::now(), thread_seconds());
            work();
            (thread_seconds() - cpu, wall.elapsed().as_secs_f64())
        })
        .unzip()
}

/// One JSON object: the seconds of each repetition, the `samples` that one went through, peak memory and load.
pub fn report(cpu: &[f64], wall: &[f64], samples: usize) -> String {
    let mut out = format!("{{\"cpu_s\": {}, \"wall_s\": {}, \"samples\": {samples}", list(cpu), list(wall));
    if let Some(peak) = peak_mib("self") {
        let _ = write!(out, ", \"peak_rss_mib\": {peak}");
    }
    if let Some(load) = load() {
        let _ = write!(out, ", \"loadavg\": {load}");
    }
    out + "}"
}

/// Numbers as a JSON list.
pub fn list(values: &[f64]) -> String {
    let words: Vec<String> = values.iter().map(|v| format!("{v:e}")).collect();
    format!("[{}]", words.join(", "))
}

/// The most memory that a running process has had, by its number or `self`, in MiB (Linux).
pub fn peak_mib(process: &str) -> Option<f64> {
    Some(status(&format!("/proc/{process}/status"), "VmHWM:")? / 1024.0)
}

/// The machine's load average (Linux).
pub fn load() -> Option<f64> {
    status("/proc/loadavg", "")
}

/// The number behind `key` in a file of the system.
fn status(file: &str, key: &str) -> Option<f64> {
    let text = std::fs::read_to_string(file).ok()?;
    text.lines().find_map(|l| l.strip_prefix(key))?.split_whitespace().next()?.parse().ok()
}

/// Reads a file of little-endian doubles.
///
/// # Errors
/// A file that cannot be read.
pub fn read_doubles(path: &Path) -> io::Result<Vec<f64>> {
    let bytes = std::fs::read(path)?;
    Ok(bytes.as_chunks::<8>().0.iter().map(|b| f64::from_le_bytes(*b)).collect())
}

/// Writes a file of little-endian doubles.
///
/// # Errors
/// A file that cannot be written.
pub fn write_doubles(path: &Path, values: &[f64]) -> io::Result<()> {
    std::fs::write(path, values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_object_has_the_seconds_of_each_repetition() {
        let mut count = 0;
        let (cpu, wall) = repeat(3, || count += 1);
        assert_eq!((count, cpu.len(), wall.len()), (3, 3, 3));
        let text = report(&[0.5, 1e-9], &[2.0], 7);
        assert!(text.starts_with("{\"cpu_s\": [5e-1, 1e-9], \"wall_s\": [2e0], \"samples\": 7"), "{text}");
        assert!(text.ends_with('}'));
    }

    #[test]
    fn doubles_come_back_as_written() {
        let path = std::env::temp_dir().join(format!("hysid-doubles-{}", std::process::id()));
        let values = [0.0, -1.5, f64::MIN_POSITIVE, 1e300];
        write_doubles(&path, &values).unwrap();
        assert_eq!(read_doubles(&path).unwrap(), values);
        std::fs::remove_file(&path).unwrap();
    }
}
