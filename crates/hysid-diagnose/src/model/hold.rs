//! Scoring on data that nothing was chosen on: free run before and after, on the hold-out.

use hysid_plant::{Initial, Simulation};

use super::{Model, Unknown, Values};
use crate::data::DataSet;
use crate::evidence::Whitener;
use crate::refit::{LmOptions, levenberg_marquardt};
use crate::slot::begins_anywhere;

/// The share of a recording on which a free initial state may be estimated; these samples are left out of the score.
pub const HEAD: f64 = 0.05;

/// A free run on a data set.
#[derive(Debug, Clone)]
pub struct FreeRun {
    /// The stacked prediction; `NaN` where it diverged.
    pub prediction: Vec<f64>,
    /// Rows that count for the score.
    pub scored: Vec<bool>,
}

/// Relative change of an output on twice as many integration steps that a score allows.
const STEP_TOLERANCE: f64 = 1e-5;

/// The integration steps in each sampling period that a simulation needs on its data, from where it starts of itself.
fn steps_needed(model: &Model<'_>) -> usize {
    let theta = model.theta(&Values::default());
    let parameters = model.parameters(&theta, &[]);
    let needed = |stretch: usize| {
        let start = model.start_of(stretch, &theta);
        let run = model.run_of(stretch, &parameters, &start);
        model.compiled.check_steps(run.drive, run.theta, run.start, STEP_TOLERANCE).substeps
    };
    (0..model.data.stretches.len()).map(needed).max().unwrap_or(1)
}

/// Shares of a recording on which an angle at which something begins to turn may be estimated where [`HEAD`] does not tell it, as of a rotor that stands
/// still at first.
const FURTHER: [f64; 3] = [0.1, 0.2, 0.4];
/// Standard error of such an angle from which it is told, in rad.
const TOLD: f64 = 0.1;

/// Free initial states as they are estimated on the first share of each stretch, and whether that tells the angles among them.
fn estimated(fixed: &Simulation, data: &DataSet, share: f64, substeps: usize) -> Option<(Values, bool)> {
    let head = data.head(share);
    let model = Model::new(fixed, &head, substeps).ok()?;
    if model.unknowns().is_empty() || head.y.is_empty() {
        return Some((Values::default(), true));
    }
    let noise: Whitener = head.layout.white_noise(&head.about_means());
    let options = LmOptions { iterations: 25, ..LmOptions::default() };
    let start = model.theta(&Values::default());
    let Some(fit) = levenberg_marquardt(&model, &start, &head.layout, &noise, None, options) else {
        return Some((Values::default(), true));
    };
    let covariance = fit.covariance(&head.layout, &noise, None, fit.cost / head.rows() as f64);
    let told = model.unknowns().iter().enumerate().all(|(i, unknown)| {
        let variance = covariance[i * (fit.theta.len() + 1)];
        match unknown {
            Unknown::Initial { state, .. } if begins_anywhere(&fixed.states[*state]) => {
                variance > 0.0 && variance < TOLD * TOLD
            }
            _ => true,
        }
    });
    Some((model.values(&fit.theta), told))
}

/// Runs a fitted simulation on data that it was not fitted to, with at least so many integration steps in each sampling period: a recording of another
/// level may need more than those that it was fitted to. Free initial states are estimated on the first [`HEAD`] of each stretch, and where that does not
/// tell the angle of what turns on more of it.
pub fn free_run(document: &Simulation, data: &DataSet, substeps: usize) -> Option<FreeRun> {
    let mut fixed = document.clone();
    fixed.parameters.iter_mut().for_each(|p| p.fixed = true);
    let substeps = steps_needed(&Model::new(&fixed, data, substeps).ok()?).max(substeps);
    let mut share = HEAD;
    let (mut values, mut told) = estimated(&fixed, data, share, substeps)?;
    for more in FURTHER {
        if !told {
            share = more;
            (values, told) = estimated(&fixed, data, share, substeps)?;
        }
    }
    let full = Model::new(&fixed, data, substeps).ok()?;
    let (outputs, _) = full.simulate(&full.theta(&values));
    let prediction = data.stack(&outputs);
    let has_free = |stretch: usize| {
        fixed.states.iter().any(|s| s.initial == Initial::Free || data.stretches[stretch].samples.start > 0)
    };
    let mut scored = vec![true; data.rows()];
    for s in &data.layout.series {
        if has_free(s.stretch) {
            let skip = (share * data.stretches[s.stretch].len() as f64).ceil() as usize;
            for (n, row) in s.rows.clone().enumerate() {
                if s.first + n * data.step < skip {
                    scored[row] = false;
                }
            }
        }
    }
    Some(FreeRun { prediction, scored })
}

#[cfg(test)]
mod tests {
    use hysid_plant::{Compiled, Drive, Run};

    use super::*;
    use crate::model::hypothesis::recorded;

    /// A table under a rotor out of balance, which stands still during the first quarter of the recording.
    #[test]
    fn the_angle_of_a_rotor_is_found_where_it_turns() {
        let text = "[time]\nperiod_s = 0.01\n[inputs]\nr = \"ref_rad_s\"\n[states]\n\
                    n = { derivative = \"2*(r - n)\", initial = 0.0 }\n\
                    x = { derivative = \"v\", initial = 0.0 }\n\
                    v = { derivative = \"n^2*sin(turn) - 4*v - 400*x\", initial = 0.0 }\n\
                    turn = { derivative = \"n\", initial = \"free\" }\n[outputs]\nx_mm = \"x\"\n";
        let document = Simulation::parse(text, "table.sim.toml").unwrap();
        let mut truth = document.clone();
        truth.states[3].initial = Initial::Number(2.0);
        let reference: Vec<f64> =
            (0..2000).map(|i| if i < 500 { 0.0 } else { 15.0 + 10.0 * (0.003 * f64::from(i)).sin() }).collect();
        let drive = Drive::new(0.0, 0.01, reference.len(), vec![reference.clone()]).unwrap();
        let compiled = Compiled::new(&truth).unwrap();
        let x = compiled.simulate(&Run::new(&drive, &compiled.theta()).with_substeps(4)).outputs.swap_remove(0);
        let data = recorded(&document, 0.01, [("ref_rad_s", reference), ("x_mm", x)]);
        let found = free_run(&document, &data, 4).unwrap();
        let rows = (0..data.rows()).filter(|row| found.scored[*row]);
        let (error, size) = rows.fold((0.0, 0.0), |(error, size), row| {
            (error + (found.prediction[row] - data.y[row]).powi(2), size + data.y[row].powi(2))
        });
        assert!(error < 1e-4 * size, "{error} of {size}");
        // On the head that it takes: twice as much does not do, and what it took is not scored.
        assert_eq!(found.scored.iter().filter(|scored| !**scored).count(), 800);
    }
}
