//! The operating region of an effect, in words: where along the trajectory its law does what the simulation's own terms cannot.

use hysid_plant::Expr;

use super::locate::{Coordinate, region};
use crate::evidence::Projector;
use crate::model::along;
use crate::model::hypothesis::Hypothesis;

/// What the effects of `best` add, along the augmented trajectory: where to (`d(v)/dt`, or an output's column), and the difference of the
/// first equation that changed.
pub(crate) fn added_law(none: &Hypothesis<'_>, best: &Hypothesis<'_>) -> Option<(String, Expr)> {
    let simulation = best.base.model.simulation();
    let original = none.base.model.simulation();
    let state = original.states.iter().find_map(|s| {
        let now = simulation.state(&s.name)?;
        (now.derivative != s.derivative)
            .then(|| (format!("d({})/dt", s.name), now.derivative.clone() - s.derivative.clone()))
    });
    state.or_else(|| {
        original.outputs.iter().find_map(|o| {
            let now = simulation.output(&o.column)?;
            (now.expression != o.expression).then(|| (o.column.clone(), now.expression.clone() - o.expression.clone()))
        })
    })
}

/// The region of the effects of `best`; `None` where they act everywhere alike, or there are none.
pub fn words(none: &Hypothesis<'_>, best: &Hypothesis<'_>) -> Option<String> {
    let effect = best.effects.first()?;
    let (_, law) = added_law(none, best)?;
    let names = ["x", "v", "u", "y", "w"];
    let quantities: Vec<(String, String, Expr)> = names
        .iter()
        .filter_map(|n| {
            let q = effect.slot.quantity(n)?;
            let symbol = match &q.expression {
                Expr::Symbol(s) => s.clone(),
                _ => (*n).to_owned(),
            };
            Some((symbol, q.unit.as_ref().map(ToString::to_string).unwrap_or_default(), q.expression.clone()))
        })
        .collect();
    let mut expressions = vec![law];
    expressions.extend(quantities.iter().map(|q| q.2.clone()));
    let series = along(&best.base, &expressions)?;
    let flat: Vec<Vec<f64>> = series.iter().map(|s| s.concat()).collect();
    if flat.iter().any(|s| s.iter().any(|x| !x.is_finite())) {
        return None;
    }
    let mut columns = vec![vec![1.0; flat[0].len()]];
    columns.extend(flat[1..].iter().cloned());
    let mut left = flat[0].clone();
    Projector::new(columns).remove(&mut left);
    let weight: Vec<f64> = left.iter().map(|x| x * x).collect();
    let coordinates: Vec<Coordinate> = quantities
        .into_iter()
        .zip(&flat[1..])
        .enumerate()
        .map(|(i, ((symbol, unit, _), values))| Coordinate {
            velocity: names.get(i) == Some(&"v") || symbol == "v",
            symbol,
            unit,
            values: values.clone(),
        })
        .collect();
    region(&coordinates, &weight)
}
