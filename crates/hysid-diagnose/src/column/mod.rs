//! Column mode: the user's simulator is known by the column that it wrote, not by its equations.
//!
//! The column is a noise-free response, so a clone of it is identified first: static, first order, integrating, second order, two second
//! orders in a row, each calibrated globally. The smallest clone that follows, else the best one, takes the simulation's place if it follows the column closely. A mere parameter error of the user's
//! simulator is then a parameter error of the clone, not missing physics. Where no clone follows, the column itself is the simulation, with
//! a gain and an offset, and only what stands at the output or beside the plant can be told.

mod clones;

use hysid_plant::{BinaryOp, Expr, Simulation};
use hysid_signal::{Channel, Recording};

use crate::answer::bootstrap::rms;
use crate::calibration::global::calibrated_copy;
use crate::data::DataSet;
use crate::error::DiagnoseError;
use crate::file::ParameterRecord;
use crate::text::number;
use clones::{Wanted, meaning, quoted};

/// A clone is taken where its error is below this share of the column's rms about its mean.
const CLOSE: f64 = 0.03;
/// No larger clone is tried where the error is below this share: a column has so many digits.
const EXACT: f64 = 1e-3;
/// A parameter that moves by less than this share is not spoken of.
const NOTICED: f64 = 0.005;
/// Samples that a clone is identified from.
const MOST_SAMPLES: usize = 6000;
/// The time column: there is no simulation file that names another.
const TIME: &str = "t_s";

/// What stands for the user's simulator.
#[derive(Debug, Clone)]
pub struct StandIn {
    /// The simulation to diagnose; its output is the measured column.
    pub simulation: Simulation,
    /// What the user must know about it.
    pub note: String,
    /// Whether a clone was found; else the column itself is the simulation.
    pub clone: bool,
}

/// A simulation that stands for the column `simulated`, found on the estimation recordings.
///
/// # Errors
/// A missing column, a constant one, too few samples.
pub fn stand_in(
    inputs: &[String],
    output: &str,
    simulated: &str,
    recordings: &[Recording],
    seed: u64,
) -> Result<StandIn, DiagnoseError> {
    let Some(first) = recordings.first() else { return Err(DiagnoseError::NoRecording) };
    // Of a signal about its mean; 0 for one that never changes.
    let size = |name: &str| -> Result<f64, DiagnoseError> {
        let channel: &Channel = first.channel(name).ok_or_else(|| DiagnoseError::MissingColumn {
            recording: first.name().to_owned(),
            column: name.to_owned(),
            available: first.channels().iter().map(|c| format!("`{}`", c.name)).collect::<Vec<_>>().join(", "),
        })?;
        let finite: Vec<f64> = channel.samples.iter().copied().filter(|x| x.is_finite()).collect();
        if finite.windows(2).all(|w| w[0] == w[1]) {
            return Ok(0.0);
        }
        let mean = finite.iter().sum::<f64>() / finite.len() as f64;
        Ok(rms(&finite.iter().map(|x| x - mean).collect::<Vec<_>>()))
    };
    for name in [output, simulated] {
        if size(name)? == 0.0 {
            let value = first.channel(name).and_then(|c| c.samples.iter().copied().find(|x| x.is_finite()));
            return Err(DiagnoseError::ConstantOutput {
                recording: first.name().to_owned(),
                column: name.to_owned(),
                value: value.unwrap_or(f64::NAN),
            });
        }
    }
    let scale = size(simulated)?;
    let Some(&drive) = inputs.iter().map(|i| size(i)).collect::<Result<Vec<_>, _>>()?.iter().find(|s| **s > 0.0) else {
        return Err(DiagnoseError::NothingDrives { recording: first.name().to_owned(), columns: inputs.join("`, `") });
    };
    let finite: Vec<f64> = first
        .channel(simulated)
        .into_iter()
        .flat_map(|c| c.samples.iter().copied())
        .filter(|x| x.is_finite())
        .collect();
    let mean = finite.iter().sum::<f64>() / finite.len().max(1) as f64;
    let wanted = Wanted {
        inputs,
        column: simulated,
        output,
        time: TIME,
        period_s: first.clock().period_s,
        samples: first.len(),
        gain: scale / drive,
        mean,
        scale,
    };
    let mut best: Option<(f64, Simulation)> = None;
    for text in wanted.texts() {
        let Ok(clone) = Simulation::parse(&text, "clone") else { continue };
        let free = clone.parameters.iter().filter(|p| !p.fixed).count();
        let data = DataSet::new(&clone, recordings, free)?.within(MOST_SAMPLES);
        let Some((copy, error)) = calibrated_copy(&clone, &data, seed) else { continue };
        // A larger clone must be clearly better.
        if best.as_ref().is_none_or(|(e, _)| error < 0.7 * e) {
            best = Some((error, copy));
        }
        if best.as_ref().is_some_and(|(e, _)| *e < EXACT * scale) {
            break;
        }
    }
    if let Some((error, clone)) = best
        && error < CLOSE * scale
    {
        let note = format!(
            "the simulation is known by its column `{simulated}` only: a clone of it was identified ({:.2} % of the column's rms is left) and diagnosed in its place; \
             parameters are those of the clone, and errors before are those of the recalibrated clone",
            100.0 * error / scale
        );
        return Ok(StandIn { simulation: in_place(clone, output, scale), note, clone: true });
    }
    let text = format!(
        "title = {}\n[time]\ncolumn = {}\n[inputs]\ns = {}\n[parameters]\ng = {{ value = 1.0, min = 0.2, max = 5.0 }}\no = {{ value = 0.0, min = {:e}, max = {:e} }}\n[outputs]\n{} = \"g*s + o\"\n",
        quoted(&format!("Column {simulated}")),
        quoted(TIME),
        quoted(simulated),
        -3.0 * scale,
        3.0 * scale,
        quoted(output)
    );
    let simulation = Simulation::parse(&text, "column")
        .map_err(|e| DiagnoseError::Simulation { file: simulated.to_owned(), problem: e.to_string() })?;
    let note = format!(
        "the simulation is known by its column `{simulated}` only, and no linear clone up to fourth order follows it: \
         effects inside the plant cannot be told apart, only what stands at the output can be named; a simulation file says more"
    );
    Ok(StandIn { simulation, note, clone: false })
}

/// The calibrated clone as the measured column's simulation: its offset is the simulator's, and known.
fn in_place(mut clone: Simulation, output: &str, scale: f64) -> Simulation {
    let offset = clone.parameter("o").map_or(0.0, |p| p.value);
    let none = offset.abs() < EXACT * scale;
    if none {
        clone.parameters.retain(|p| p.name != "o");
    }
    clone.parameters.iter_mut().filter(|p| p.name == "o").for_each(|p| p.fixed = true);
    for o in &mut clone.outputs {
        o.column = output.to_owned();
        if let (true, Expr::Binary(BinaryOp::Add, inner, _)) = (none, &o.expression) {
            o.expression = (**inner).clone();
        }
    }
    clone
}

impl StandIn {
    /// The parameters in which the recording differs from what the simulator's column says, in a sentence; nothing where none does, or
    /// where no clone was found.
    pub fn moved(&self, calibrated: &[ParameterRecord]) -> Option<String> {
        let several = self.simulation.inputs.len() > 1;
        let parts: Vec<String> = calibrated
            .iter()
            .filter(|_| self.clone)
            .filter_map(|r| {
                let given = self.simulation.parameter(&r.name)?.value;
                let outside = r.low.is_some_and(|l| given < l) || r.high.is_some_and(|h| given > h);
                if !outside || (r.value - given).abs() < NOTICED * given.abs() {
                    return None;
                }
                let unit = if r.unit.is_empty() || r.unit == "-" { String::new() } else { format!(" {}", r.unit) };
                let which = if several && r.name.starts_with('g') { format!(" `{}`", r.name) } else { String::new() };
                let change = 100.0 * (r.value / given - 1.0);
                Some(format!(
                    "{}{which} {} -> {}{unit} ({change:+.0} %)",
                    meaning(&r.name),
                    number(given),
                    number(r.value)
                ))
            })
            .collect();
        (!parts.is_empty())
            .then(|| format!("Parameters of the simulator are not those of the recording: {}.", parts.join(", ")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hysid_signal::Clock;

    #[test]
    fn a_second_order_column_gets_a_close_clone() {
        let (n, h) = (1500, 0.02);
        let u: Vec<f64> = (0..n)
            .map(|i| (0.4 * (i as f64 * 0.11).sin() + (i as f64 * 0.031).sin() + 0.5 * (i as f64 * 0.29).cos()) * 3.0)
            .collect();
        let (mut x, mut v) = (0.0, 0.0);
        let mut s = Vec::new();
        for i in 0..n {
            s.push(x);
            let (a, b) = (u[i], u[(i + 1).min(n - 1)]);
            for k in 0..50 {
                let f = a + (b - a) * f64::from(k) / 50.0;
                v += h / 50.0 * (40.0 * f - 2.0 * v - 90.0 * x);
                x += h / 50.0 * v;
            }
        }
        let channels = vec![
            Channel { name: "u_V".into(), samples: u },
            Channel { name: "s_mm".into(), samples: s.clone() },
            Channel { name: "y_mm".into(), samples: s },
        ];
        let r = Recording::new("r.csv", Clock { start_s: 0.0, period_s: h }, channels).unwrap();
        let found = stand_in(&["u_V".into()], "y_mm", "s_mm", &[r], 1).unwrap();
        assert!(!found.simulation.is_static(), "{}", found.note);
        assert_eq!(found.simulation.outputs[0].column, "y_mm");
    }
}
