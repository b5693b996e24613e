//! What Linux tells of this process and of those that it starts.

use std::process::Command;
use std::time::Duration;

use hysid_bench::timing::peak_mib;

/// How often the memory of a program that runs is looked at.
const LOOK: Duration = Duration::from_millis(10);

/// Runs a program and tells the most memory that it had, as it was last seen, in MiB.
pub fn run_with_peak(command: &mut Command) -> anyhow::Result<Option<f64>> {
    let mut child = command.spawn()?;
    let process = child.id().to_string();
    let mut peak = None;
    loop {
        peak = peak_mib(&process).or(peak);
        if let Some(status) = child.try_wait()? {
            anyhow::ensure!(status.success(), "{} failed: {status}", command.get_program().display());
            return Ok(peak);
        }
        std::thread::sleep(LOOK);
    }
}

/// What stands before a command that runs before all others on the machine (Linux), as this process and those that it starts do now.
pub fn before_all_others() -> &'static str {
    // The priority among such processes; 0 for an ordinary one.
    match own_state(37) {
        None | Some(0.0) => "",
        Some(_) => "chrt -f 1 ",
    }
}

/// A number of what Linux tells of this process (`/proc/self/stat`), counted from the state, 0, behind the name, which may hold anything but
/// ends at the last parenthesis.
fn own_state(place: usize) -> Option<f64> {
    let text = std::fs::read_to_string("/proc/self/stat").ok()?;
    text.rsplit_once(')')?.1.split_whitespace().nth(place)?.parse().ok()
}

/// CPU seconds of the processes that this one started and that have ended (Linux, to 0.01 s).
pub fn children_seconds() -> Option<f64> {
    Some((own_state(13)? + own_state(14)?) / 100.0)
}
