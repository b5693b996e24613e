//! How the fit of an effect ends: shapes that least squares cannot move (a time, a period, a knee) are searched line by line with the other
//! unknowns refitted, then all of it under the noise that is left.

use rayon::prelude::*;

use crate::budget::Step;
use crate::model::base::Base;
use crate::model::hypothesis::{Hypothesis, Setting};

/// The end of a fit: shapes that least squares cannot move, of the effects from `from` on, then a round under the hypothesis' own noise.
pub fn finish<'d>(setting: &Setting<'d>, h: &mut Hypothesis<'d>, from: usize) {
    for index in from..h.effects.len() {
        profile_shapes(setting, h, index);
    }
    if setting.budget.omits(Step::Fits) {
        return;
    }
    let polished = setting.further(&h.base, Some(&h.base.whitener), 1, setting.iterations);
    if let Some(p) = polished
        && p.log_likelihood > h.base.log_likelihood
    {
        h.base = p;
    }
    h.log_evidence = setting.evidence(&h.base);
}

/// Line search over shapes that least squares cannot move: where the derivative by the shape vanishes or the shape stands where it began,
/// its neighbourhood in the grid is searched by shrinking steps, the other unknowns refitted at each.
fn profile_shapes<'d>(setting: &Setting<'d>, h: &mut Hypothesis<'d>, index: usize) {
    let whole = h.base.model.simulation().clone();
    let effect = h.effects[index].clone();
    for shape in &effect.written.shapes {
        if !shape.searched || shape.grid.len() < 3 {
            continue;
        }
        let mut document = whole.clone();
        let Some(p) = document.parameter_mut(&shape.name) else { continue };
        let (low, high) = (p.lower(), p.upper());
        p.fixed = true;
        let here = |b: &Base<'_>| b.values().parameters.get(&shape.name).copied().unwrap_or(0.0);
        let spacing = shape.grid.windows(2).map(|w| w[1] - w[0]).fold(f64::INFINITY, f64::min);
        let mut step = 0.5 * spacing;
        let mut moved = false;
        for _ in 0..6 {
            if setting.budget.omits(Step::Fits) {
                break;
            }
            let x = here(&h.base);
            let trials: Vec<Option<Base<'d>>> = [x - step, x + step]
                .into_par_iter()
                .map(|value| {
                    if value < low || value > high {
                        return None;
                    }
                    let mut d = document.clone();
                    if let Some(p) = d.parameter_mut(&shape.name) {
                        p.value = value;
                    }
                    let mut from = h.base.values();
                    from.parameters.insert(shape.name.clone(), value);
                    setting.fit(&d, &from, Some(&h.base.whitener), 1, 3)
                })
                .collect();
            let better = trials
                .into_iter()
                .flatten()
                .filter(|t| t.log_likelihood > h.base.log_likelihood + 1e-3)
                .max_by(|a, b| a.log_likelihood.total_cmp(&b.log_likelihood));
            match better {
                Some(t) => (h.base, moved) = (t, true),
                None => step *= 0.4,
            }
        }
        if moved {
            // Back to the document in which the shape is an unknown again.
            for iterations in [2, 0] {
                let values = h.base.values();
                if let Some(b) = setting.fit(&whole, &values, Some(&h.base.whitener), 1, iterations)
                    && (b.log_likelihood >= h.base.log_likelihood || iterations == 0)
                {
                    h.base = b;
                    break;
                }
            }
        }
    }
}
