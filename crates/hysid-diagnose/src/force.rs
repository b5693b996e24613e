//! The ways by which an unknown force or flow reaches the outputs of a simulation: its equations linearised along its trajectory.
//!
//! A force enters where the catalogue's disturbances do: the derivative of a velocity, or of what is stored. The equations are linearised at
//! instants that are spread over the recordings, and each coefficient's mean is taken over the middle half of the instants: where dry
//! friction holds for some of them, or its smoothed sign is steep, the moving ones decide. The error of a simulation that follows the recorded input
//! has the response of the simulation as it is: a loop that the simulation contains is closed in it, one behind the recorded input is not.

use hysid_plant::Simulation;

use crate::evidence::ForcePath;
use crate::model::Model;
use crate::slot::{Place, Structure, Target};

/// Instants at which the equations are linearised.
const INSTANTS: usize = 24;
/// Most states at which a force may enter.
const MOST: usize = 3;

/// Names of the states whose derivative an unknown force or flow may enter.
pub fn pushed(simulation: &Simulation) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for slot in Structure::of(simulation).slots.iter().filter(|s| s.place == Place::Disturbance) {
        if let Target::Derivatives(states) = &slot.target {
            names.extend(states.iter().map(|(name, _)| name.clone()));
        }
    }
    names.truncate(MOST);
    names
}

/// The ways from a force at each of the `pushed` states to each output.
pub fn force_paths(model: &Model<'_>, theta: &[f64], pushed: &[String]) -> Vec<Vec<ForcePath>> {
    let simulation = model.simulation();
    let n = simulation.states.len();
    let entries: Vec<usize> =
        pushed.iter().filter_map(|name| simulation.states.iter().position(|s| s.name == *name)).collect();
    if entries.is_empty() {
        return Vec::new();
    }
    let points = model.linearised(theta, INSTANTS);
    if points.is_empty() {
        return Vec::new();
    }
    let a: Vec<f64> = (0..n * n).map(|i| middle(points.iter().map(|p| p.a[i]))).collect();
    let c: Vec<f64> = (0..n * simulation.outputs.len()).map(|i| middle(points.iter().map(|p| p.c[i]))).collect();
    let period_s = model.data().row_period_s();
    c.chunks_exact(n)
        .map(|c| entries.iter().filter_map(|&entry| ForcePath::held(&a, entry, c, period_s)).collect())
        .collect()
}

/// The mean of the middle half.
fn middle(values: impl Iterator<Item = f64>) -> f64 {
    let mut all: Vec<f64> = values.filter(|x| x.is_finite()).collect();
    all.sort_by(f64::total_cmp);
    let quarter = all.len() / 4;
    let half = &all[quarter..all.len() - quarter];
    half.iter().sum::<f64>() / half.len().max(1) as f64
}
