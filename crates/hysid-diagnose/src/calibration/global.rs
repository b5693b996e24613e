//! Where a fair calibration starts from: the global calibration of `hysid-plant`, and the user's own values.

use hysid_plant::{Compiled, Effort, Settings, Simulation};

use crate::data::DataSet;
use crate::data::plant::plant_data;
use crate::evidence::norm2;
use crate::model::{Model, Values};
use crate::refit::Problem;

/// Integration steps in each sampling period where the step-halving check gives no number.
const SUBSTEPS: usize = 2;
/// The most that are spent on accuracy.
pub const MOST_SUBSTEPS: usize = 8;
/// The most that a stiff simulation gets, which does not follow its own equations with fewer.
const MOST_OF_STIFF: usize = 64;
/// Error of integration, over the rms of the residual, from which on it is no matter of accuracy any more.
const ASTRAY: f64 = 0.3;
/// Size of a derivative, over that with half as long steps, or the other way round, below which it has settled.
const SETTLED: f64 = 1.5;
/// Steps for a simulation without states. It passes the check with one, but the memory that an effect adds to it does not: friction
/// that slides within a sample was integrated wrongly, and the errors told were not those of the simulation that was written.
const OF_STATIC: usize = 4;

/// Starts, most promising first, and the integration steps in each period that the step-halving check asks for.
pub fn starts(model: &Model<'_>, simulation: &Simulation, seed: u64) -> (Vec<Values>, usize) {
    let own = model.values(&model.theta(&Values::default()));
    let mut out = Vec::new();
    let mut substeps = SUBSTEPS;
    if let Some((values, steps)) = global(model, simulation, seed) {
        substeps = if simulation.is_static() {
            OF_STATIC
        } else {
            calm(model, &values, followed(model, &values, steps.max(1)), SETTLED)
        };
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
        let m = model.with_substeps(substeps)?;
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

/// These steps, or so many more that the derivatives by what is unknown are those of the simulation. A friction that is smoothed steeply
/// (`tanh(v/0.008)`) chatters within its bounds where the machine sticks and steps are too long: its outputs are right, and their derivatives
/// grow from step to step. Where no number of steps settles them to such a factor (impacts, chaos), these steps.
pub fn calm(model: &Model<'_>, values: &Values, substeps: usize, settled: f64) -> usize {
    let sizes = |substeps: usize| {
        let m = model.with_substeps(substeps)?;
        let (_, tangents) = m.tangent(&m.theta(values))?;
        Some(tangents.iter().map(|t| norm2(t).sqrt()).collect::<Vec<f64>>())
    };
    let mut steps = substeps;
    let mut now = sizes(steps);
    while 2 * steps <= MOST_OF_STIFF {
        let Some(finer) = sizes(2 * steps) else { break };
        let alike = |(a, b): (&f64, &f64)| *a < settled * b && *b < settled * a || a == b;
        if now.is_some_and(|now| now.iter().zip(&finer).all(alike)) {
            return steps;
        }
        (steps, now) = (2 * steps, Some(finer));
    }
    substeps
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

#[cfg(test)]
mod tests {
    use hysid_plant::Drive;

    use super::*;

    /// Steps that a drive which sticks gets in the place of eight, and its derivatives' size with these, over what it is with 64.
    fn calmed(friction: &str) -> (usize, Vec<f64>) {
        let text = format!(
            "[time]\nperiod_s = 0.005\n[inputs]\nu = \"torque_Nm\"\n[parameters]\nJ = {{ value = 0.0131, min = 0.005, max = 0.05 }}\nb = {{ value = 0.0256, min = 0.01, max = 0.07 }}\nFc = {{ value = 0.72, min = 0.2, max = 3.0 }}\n\
             [states]\nq = {{ derivative = \"w\", initial = 0.0 }}\nw = {{ derivative = \"(u - b*w - Fc*{friction})/J\", initial = 0.0 }}\n[outputs]\nangle_rad = \"q\"\n"
        );
        let simulation = Simulation::parse(&text, "drive.sim.toml").unwrap();
        let u: Vec<f64> = (0..2000).map(f64::from).map(|i| 1.1 * (0.013 * i).sin() + 0.5 * (0.031 * i).cos()).collect();
        let drive = Drive::new(0.0, 0.005, u.len(), vec![u.clone()]).unwrap();
        let data = DataSet::of_drive(drive, vec![u], 0.005);
        let model = Model::new(&simulation, &data, MOST_SUBSTEPS).unwrap();
        let sizes = |substeps: usize| -> Vec<f64> {
            let m = Model::new(&simulation, &data, substeps).unwrap();
            m.tangent(&m.theta(&Values::default())).unwrap().1.iter().map(|t| norm2(t).sqrt()).collect()
        };
        let steps = calm(&model, &Values::default(), MOST_SUBSTEPS, SETTLED);
        (steps, sizes(steps).iter().zip(sizes(64)).map(|(a, b)| a / b).collect())
    }

    #[test]
    fn what_chatters_asks_for_shorter_steps() {
        let (steps, sizes) = calmed("tanh(w/0.008)");
        assert!(steps > MOST_SUBSTEPS && sizes.iter().all(|s| (0.7..1.4).contains(s)), "{steps} {sizes:?}");
        // Dry friction that really sticks does not chatter.
        let (steps, sizes) = calmed("sign(w)");
        assert!(steps == MOST_SUBSTEPS && sizes.iter().all(|s| (0.99..1.01).contains(s)), "{steps} {sizes:?}");
    }
}
