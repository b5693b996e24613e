//! The simulation file that a command was given, or one message that says what is wrong with it and where; and why it explodes.

use std::path::Path;

use hysid_io::InputProblem;
use hysid_plant::{Compiled, Data, Drive, LARGEST_FILE, Response, Run, Simulation, Start};
use hysid_signal::Recording;

use crate::failure::Failure;

/// Reads and checks a simulation; returns it with the name under which messages tell of it.
///
/// # Errors
/// A file that cannot be read, is no text, or is no simulation.
pub fn read(path: &Path) -> Result<(Simulation, String), Failure> {
    let name = path.display().to_string();
    let text = hysid_io::read_text(path, LARGEST_FILE as u64).map_err(|error| {
        if error.problem == InputProblem::IsDirectory {
            let problem = "this is a directory; a simulation file (`NAME.sim.toml`) is needed";
            return Failure::BadInput(format!("{name}: {problem}"));
        }
        Failure::bad_input(error)
    })?;
    let simulation = Simulation::parse(&text, &name).map_err(Failure::bad_input)?;
    Ok((simulation, name))
}

/// Which state or output of a simulation that diverged is not finite, and since when.
pub fn explain(compiled: &Compiled, drive: &Drive, start: &[f64], response: &Response) -> String {
    let u: Vec<f64> = drive.inputs().iter().map(|s| s.first().copied().unwrap_or(0.0)).collect();
    compiled.explain_divergence(&compiled.theta(), start, &u, response)
}

/// The same for a simulation with the values of its file on a recording (free initial states 0); `None` where it does not diverge.
pub fn explosion(simulation: &Simulation, recording: &Recording) -> Option<String> {
    let compiled = Compiled::new(simulation).ok()?;
    let theta = compiled.theta();
    Data::from_recording(&compiled, recording).ok()?.iter().find_map(|data| {
        let start = data.start_states(&compiled, &theta, &vec![0.0; data.free.len()]);
        let response = compiled.simulate(&Run::new(&data.drive, &theta).from(Start::States(&start)));
        response.diverged.is_some().then(|| explain(&compiled, &data.drive, &start, &response))
    })
}
