//! Column mode: the user's simulator is known by the column that it wrote, not by its equations.
//!
//! The column is a noise-free response, so a clone of it is identified first: first order, second order, two second orders in a row, each
//! calibrated globally. The best clone takes the simulation's place if it follows the column closely. A mere parameter error of the user's
//! simulator is then a parameter error of the clone, not missing physics. Where no clone follows, the column itself is the simulation, with
//! a gain and an offset, and only what stands at the output or beside the plant can be told.

use hysid_plant::{Compiled, Data, Simulation};
use hysid_signal::{Channel, Recording};

use crate::bootstrap::rms;
use crate::calibrate::calibrated_copy;
use crate::data::DataSet;
use crate::error::DiagnoseError;

/// A clone is taken where its error is below this share of the column's rms about its mean.
const CLOSE: f64 = 0.03;

/// What stands for the user's simulator.
#[derive(Debug, Clone)]
pub struct StandIn {
    /// The simulation to diagnose; its output is the measured column.
    pub simulation: Simulation,
    /// What the user must know about it.
    pub note: String,
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
    let period_s = first.clock().period_s;
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
    let sizes = inputs.iter().map(|i| size(i)).collect::<Result<Vec<_>, _>>()?;
    let gain = scale / sizes.first().copied().unwrap_or(1.0).max(f64::MIN_POSITIVE);
    let mut best: Option<(f64, Simulation)> = None;
    for text in clones(inputs, simulated, period_s, gain, first.len()) {
        let Ok(clone) = Simulation::parse(&text, "clone") else { continue };
        let free = clone.parameters.iter().filter(|p| !p.fixed).count();
        let data = DataSet::new(&clone, recordings, free)?.within(6000);
        let Some((copy, error)) = calibrated_copy(&clone, &data, seed) else { continue };
        // A larger clone must be clearly better.
        if best.as_ref().is_none_or(|(e, _)| error < 0.7 * e) {
            best = Some((error, copy));
        }
    }
    if let Some((error, mut clone)) = best
        && error < CLOSE * scale
    {
        for o in &mut clone.outputs {
            o.column = output.to_owned();
        }
        let note = format!(
            "the simulation is known by its column `{simulated}` only: a clone of it was identified ({:.2} % of the column's rms is left) and diagnosed in its place; \
             parameters are those of the clone, and errors before are those of the recalibrated clone",
            100.0 * error / scale
        );
        return Ok(StandIn { simulation: clone, note });
    }
    let text = format!(
        "title = \"Column {simulated}\"\n[time]\n{}\n[inputs]\ns = \"{simulated}\"\n[parameters]\ng = {{ value = 1.0, min = 0.2, max = 5.0 }}\no = {{ value = 0.0, min = {:e}, max = {:e} }}\n[outputs]\n\"{output}\" = \"g*s + o\"\n",
        clock(period_s),
        -3.0 * scale,
        3.0 * scale
    );
    let simulation = Simulation::parse(&text, "column")
        .map_err(|e| DiagnoseError::Simulation { file: simulated.to_owned(), problem: e.to_string() })?;
    let note = format!(
        "the simulation is known by its column `{simulated}` only, and no linear clone up to fourth order follows it: \
         effects inside the plant cannot be told apart, only what stands at the output can be named; a simulation file says more"
    );
    Ok(StandIn { simulation, note })
}

fn clock(period_s: f64) -> String {
    format!("period_s = {period_s:e}")
}

/// Clones in order of size.
fn clones(inputs: &[String], column: &str, period_s: f64, gain: f64, samples: usize) -> Vec<String> {
    let listed: String = inputs.iter().enumerate().map(|(i, c)| format!("u{} = \"{c}\"\n", i + 1)).collect();
    let parameter = |name: &str, value: f64, low: f64, high: f64| {
        format!("{name} = {{ value = {value:e}, min = {low:e}, max = {high:e} }}\n")
    };
    let gains: String =
        (1..=inputs.len()).map(|i| parameter(&format!("g{i}"), gain, -1e3 * gain, 1e3 * gain)).collect();
    let drive = (1..=inputs.len()).map(|i| format!("g{i}*u{i}")).collect::<Vec<_>>().join(" + ");
    let head =
        format!("title = \"Clone of {column}\"\n[time]\n{}\n[inputs]\n{listed}[parameters]\n{gains}", clock(period_s));
    let length = samples as f64 * period_s;
    let slow = std::f64::consts::TAU * 2.0 / length;
    let fast = 1.5 / period_s;
    let middle = (slow * fast).sqrt();
    let tail = |y: &str| format!("[outputs]\n\"{column}\" = \"{y}\"\n");
    vec![
        format!(
            "{head}{}[states]\nx = {{ derivative = \"w*({drive} - x)\", initial = \"free\" }}\n{}",
            parameter("w", middle, slow, fast),
            tail("x")
        ),
        format!(
            "{head}{}{}[states]\nx = {{ derivative = \"v\", initial = \"free\" }}\nv = {{ derivative = \"w^2*({drive} - x) - 2*z*w*v\", initial = \"free\" }}\n{}",
            parameter("w", middle, slow, fast),
            parameter("z", 0.2, 1e-4, 5.0),
            tail("x")
        ),
        format!(
            "{head}{}{}{}{}[states]\nx = {{ derivative = \"v\", initial = \"free\" }}\nv = {{ derivative = \"w^2*({drive} - x) - 2*z*w*v\", initial = \"free\" }}\np = {{ derivative = \"q\", initial = \"free\" }}\nq = {{ derivative = \"w2^2*(x - p) - 2*z2*w2*q\", initial = \"free\" }}\n{}",
            parameter("w", middle, slow, fast),
            parameter("z", 0.2, 1e-4, 5.0),
            parameter("w2", 2.0 * middle, slow, 3.0 * fast),
            parameter("z2", 0.5, 1e-4, 5.0),
            tail("p")
        ),
    ]
}

/// Data of `hysid-plant` for each stretch.
pub fn plant_data(compiled: &Compiled, data: &DataSet) -> Option<Vec<Data>> {
    let states = compiled.simulation().states.len();
    data.stretches
        .iter()
        .map(|s| {
            let mut d = Data::new(compiled, "", s.drive.clone(), s.outputs.clone()).ok()?;
            d.offset = s.samples.start;
            if s.samples.start > 0 {
                d.free = (0..states).collect();
            }
            Some(d)
        })
        .collect()
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
