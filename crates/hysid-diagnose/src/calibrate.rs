//! Where a fair calibration starts from: the user's values, and others within the bounds.

use rand::RngExt;

use crate::model::{Model, Unknown, Values};
use crate::random::generator;
use crate::refit::Problem;

/// Starts, the user's own values first.
pub fn starts(model: &Model<'_>, seed: u64) -> Vec<Values> {
    let own = model.theta(&Values::default());
    let mut out = vec![model.values(&own)];
    for i in 0..5 {
        let mut rng = generator(seed, 0xCA1u64 << 32 | i);
        let theta: Vec<f64> = own
            .iter()
            .enumerate()
            .map(|(place, &x)| match model.unknowns()[place] {
                Unknown::Parameter(_) => {
                    let (lo, hi) = model.bounds()[place];
                    let factor: f64 = (rng.random_range(-1.0..1.0f64) * 0.7).exp();
                    (x * factor).clamp(lo, hi)
                }
                Unknown::Initial { .. } => x,
            })
            .collect();
        out.push(model.values(&theta));
    }
    out
}
