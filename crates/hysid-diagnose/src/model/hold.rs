//! Scoring on data that nothing was chosen on: free run before and after, on the hold-out.

use hysid_plant::{Initial, Simulation};

use super::{Model, Values};
use crate::data::DataSet;
use crate::evidence::Whitener;
use crate::refit::{LmOptions, levenberg_marquardt};

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

/// Runs a fitted simulation on data that it was not fitted to, with at least so many integration steps in each sampling period: a recording of another
/// level may need more than those that it was fitted to. Free initial states are estimated on the first [`HEAD`] of each stretch.
pub fn free_run(document: &Simulation, data: &DataSet, substeps: usize) -> Option<FreeRun> {
    let mut fixed = document.clone();
    fixed.parameters.iter_mut().for_each(|p| p.fixed = true);
    let substeps = steps_needed(&Model::new(&fixed, data, substeps).ok()?).max(substeps);
    let head = data.head(HEAD);
    let model = Model::new(&fixed, &head, substeps).ok()?;
    let free = !model.unknowns().is_empty();
    let mut values = Values::default();
    if free && !head.y.is_empty() {
        let noise: Whitener = head.layout.fit_noise(&head.about_means(), 0, &[]);
        let start = model.theta(&values);
        let options = LmOptions { iterations: 25, ..LmOptions::default() };
        if let Some(fit) = levenberg_marquardt(&model, &start, &head.layout, &noise, None, options) {
            values = model.values(&fit.theta);
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
            let skip = (HEAD * data.stretches[s.stretch].len() as f64).ceil() as usize;
            for (n, row) in s.rows.clone().enumerate() {
                if s.first + n * data.step < skip {
                    scored[row] = false;
                }
            }
        }
    }
    Some(FreeRun { prediction, scored })
}
