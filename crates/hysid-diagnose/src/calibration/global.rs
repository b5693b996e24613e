//! Where a fair calibration starts from: the global calibration of `hysid-plant`, and the user's own values.

use hysid_plant::{Compiled, Effort, Settings, Simulation};

use crate::data::DataSet;
use crate::data::plant::plant_data;
use crate::model::{Model, Values};

/// Integration steps in each sampling period where the step-halving check gives no number.
const SUBSTEPS: usize = 2;
/// The most that are spent on accuracy.
pub const MOST_SUBSTEPS: usize = 8;
/// The most that a stiff simulation gets, which does not follow its own equations with fewer.
const MOST_OF_STIFF: usize = 64;
/// Error of integration, over the rms of the residual, from which on it is no matter of accuracy any more.
const ASTRAY: f64 = 0.3;
/// Steps for a simulation without states. It passes the check with one, but the memory that an effect adds to it does not: friction
/// that slides within a sample was integrated wrongly, and the errors told were not those of the simulation that was written.
const OF_STATIC: usize = 4;

/// Starts, most promising first, and the integration steps in each period that the step-halving check asks for.
pub fn starts(model: &Model<'_>, simulation: &Simulation, seed: u64) -> (Vec<Values>, usize) {
    let own = model.values(&model.theta(&Values::default()));
    let mut out = Vec::new();
    let mut substeps = SUBSTEPS;
    if let Some((values, steps)) = global(model, simulation, seed) {
        substeps = if simulation.is_static() { OF_STATIC } else { followed(model, &values, steps.max(1)) };
        out.push(values);
    }
    out.push(own);
    (out, substeps)
}

/// As many of the steps that the check asks for as are spent: no more than accuracy is worth, unless the simulation goes astray with so few. An overdamped
/// valve whose stem settles within a tenth of a sampling period explodes with 8 steps from a damping on that its bounds allow.
fn followed(model: &Model<'_>, values: &Values, asked: usize) -> usize {
    if asked <= MOST_SUBSTEPS {
        return asked;
    }
    let asked = asked.min(MOST_OF_STIFF);
    let predicted = |substeps: usize| {
        let m = Model::new(model.simulation(), model.data(), substeps).ok()?;
        m.predict(&m.theta(values))
    };
    let Some(exact) = predicted(asked) else { return MOST_SUBSTEPS };
    let left = |p: &[f64], of: &[f64]| {
        model.data().relative_squares(&p.iter().zip(of).map(|(a, b)| a - b).collect::<Vec<_>>())
    };
    let residual = left(&exact, &model.data().y);
    let astray = |substeps: &usize| predicted(*substeps).is_none_or(|p| left(&p, &exact) > ASTRAY * ASTRAY * residual);
    [MOST_SUBSTEPS, 16, 32].into_iter().find(|s| *s < asked && !astray(s)).unwrap_or(asked)
}

/// The global calibration by plain squares, with so many iterations of its fits.
fn settings(seed: u64, iterations: usize) -> Settings {
    Settings { effort: Effort::Global, seed, gls_rounds: 0, iterations, ..Settings::default() }
}

/// A simulation calibrated globally on a data set, with its rms error over all outputs; `None` where that fails.
pub fn calibrated_copy(simulation: &Simulation, data: &DataSet, seed: u64) -> Option<(Simulation, f64)> {
    let compiled = Compiled::new(simulation).ok()?;
    let all = plant_data(&compiled, data)?;
    let c = compiled.calibrate(&all, &settings(seed, 60)).ok()?;
    let mut copy = simulation.clone();
    for (p, x) in copy.parameters.iter_mut().zip(&c.theta) {
        p.value = *x;
    }
    let error = (c.rmse.iter().map(|e| e * e).sum::<f64>() / c.rmse.len().max(1) as f64).sqrt();
    error.is_finite().then_some((copy, error))
}

/// The global calibration; `None` where it fails (the user's own values remain).
fn global(model: &Model<'_>, simulation: &Simulation, seed: u64) -> Option<(Values, usize)> {
    let compiled = Compiled::new(simulation).ok()?;
    let all = plant_data(&compiled, model.data())?;
    let c = compiled.calibrate(&all, &settings(seed, 40)).ok()?;
    let mut values = Values::default();
    for (p, x) in simulation.parameters.iter().zip(&c.theta) {
        values.parameters.insert(p.name.clone(), *x);
    }
    for (stretch, (d, initial)) in all.iter().zip(&c.initial).enumerate() {
        for (&state, x) in d.free.iter().zip(initial) {
            values.initials.insert((stretch, simulation.states.get(state)?.name.clone()), *x);
        }
    }
    Some((values, c.steps.substeps))
}
