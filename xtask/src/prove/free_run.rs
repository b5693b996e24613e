//! Free runs of the bank's machines over a recording, and how far outputs are from those without noise.

use hysid_concealed::case::{Case, Record};
use hysid_concealed::machine::Machine;
use hysid_concealed::refit::{Target, started};

/// Free-run error of a machine on a record. Where the simulation file leaves the initial state free, the machine has it from the samples that
/// are not scored, as the program under test has.
pub fn error(case: &Case, machine: &Machine, record: &Record) -> f64 {
    free_run(case, machine, record).map_or(f64::INFINITY, |y| distance(&y, &record.clean, &case.label.sigma))
}

/// The free run behind [`error`].
pub fn free_run(case: &Case, machine: &Machine, record: &Record) -> Option<Vec<Vec<f64>>> {
    if !case.free_initial {
        return machine.run(&record.input, None).ok();
    }
    let beginning: Vec<Vec<f64>> = record.y.iter().map(|y| y[..unscored(y.len())].to_vec()).collect();
    let target = Target { input: &record.input, y: &beginning };
    started(machine, target, &case.label.sigma).run(&record.input, None).ok()
}

/// The first 5 % of the samples, which are not scored and may settle an initial state.
pub fn unscored(samples: usize) -> usize {
    samples / 20
}

/// Rms over all channels of the difference in units of the noise, without what is [`unscored`].
pub fn distance(y: &[Vec<f64>], clean: &[Vec<f64>], sigma: &[f64]) -> f64 {
    let mut sum = 0.0;
    let mut count = 0;
    for ((a, b), s) in y.iter().zip(clean).zip(sigma) {
        for (a, b) in a.iter().zip(b).skip(unscored(b.len())) {
            sum += ((a - b) / s).powi(2);
            count += 1;
        }
    }
    let rms = (sum / f64::from(count.max(1))).sqrt();
    if rms.is_finite() { rms } else { f64::INFINITY }
}
