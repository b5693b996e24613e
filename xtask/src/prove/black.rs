//! The NARX competitors: `hysid fit` on the recording itself, and on what the recalibrated baseline leaves.

use std::fmt::Write as _;
use std::path::Path;

use hysid_concealed::case::{Case, Record};
use hysid_concealed::input::Input;
use hysid_concealed::machine::Machine;

use super::free_run::{distance, free_run};
use super::trial::{Bench, read_columns};

/// Errors of a black box: on the hold-out, and at 1.5 times the amplitude.
pub type Errors = (f64, Option<f64>);

impl Bench {
    /// NARX on the first output; infinite where none is found or it diverges.
    pub fn narx(&self, case: &Case) -> Errors {
        self.learn(case, "narx", None)
    }

    /// NARX on the residual of the recalibrated baseline.
    pub fn narx_on_residual(&self, case: &Case, calibrated: &Machine) -> Errors {
        self.learn(case, "residual", Some(calibrated))
    }

    fn learn(&self, case: &Case, name: &str, baseline: Option<&Machine>) -> Errors {
        let folder = self.root.join(name).join(&case.label.id);
        let failed = (f64::INFINITY, None);
        if std::fs::create_dir_all(&folder).is_err() {
            return failed;
        }
        let base = |record: &Record| match baseline {
            Some(machine) => free_run(case, machine, record).map(|mut y| y.remove(0)),
            None => Some(vec![0.0; record.input.len()]),
        };
        let write = |record: &Record, y: &[f64], file: &str| -> Option<Vec<f64>> {
            let base = base(record)?;
            let e: Vec<f64> = y.iter().zip(&base).map(|(a, b)| a - b).collect();
            std::fs::write(folder.join(file), table(record, &e)).ok()?;
            Some(base)
        };
        if write(&case.est, &case.est.y[0], "est.csv").is_none() {
            return failed;
        }
        let inputs: &[&str] =
            if case.design.kind.inputs().len() > 1 { &["--input", "u", "--input", "v"] } else { &["--input", "u"] };
        let mut arguments = vec!["fit", "--recording", "est.csv", "--output", "y", "--threads", "1"];
        arguments.extend(inputs);
        if self.call(&folder, &arguments, &["--out"], Path::new("model")).is_err() {
            return failed;
        }
        let error = |record: &Record, y: &[f64], file: &str| -> Option<f64> {
            let base = write(record, y, file)?;
            let out = format!("predicted-{file}");
            self.call(
                &folder,
                &["predict", "model/model.json", "--recording", file, "--mode", "free-run"],
                &["--out"],
                Path::new(&out),
            )
            .ok()?;
            let text = std::fs::read_to_string(folder.join(&out)).ok()?;
            let mut e = read_columns(&text, &["y"]).ok()?.remove(0);
            e.iter_mut().zip(&base).for_each(|(e, b)| *e += b);
            Some(distance(&[e], &record.clean[..1], &case.label.sigma))
        };
        let val = error(&case.val, &case.val.y[0], "val.csv").unwrap_or(f64::INFINITY);
        let louder = case.louder.as_ref().map(|l| error(l, &l.y[0], "louder.csv").unwrap_or(f64::INFINITY));
        (val, louder)
    }
}

/// Time, inputs and one output as CSV.
fn table(record: &Record, y: &[f64]) -> String {
    let two = matches!(record.input, Input::Motion { .. });
    let mut text = String::from(if two { "t_s,u,v,y\n" } else { "t_s,u,y\n" });
    let period = record.input.period();
    for (k, y) in y.iter().enumerate() {
        let t = k as f64 * period;
        let _ = match &record.input {
            Input::Held { values, .. } => writeln!(text, "{t:.12e},{:.9e},{y:.9e}", values[k]),
            Input::Motion { motion, .. } => {
                let (q, v) = motion.at(t);
                writeln!(text, "{t:.12e},{q:.9e},{v:.9e},{y:.9e}")
            }
        };
    }
    text
}
